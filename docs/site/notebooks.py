"""Tutorials as executed notebooks, and what their cells print and draw, for the site: `make notebooks`."""

import argparse
import base64
import io
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

import jupytext
import nbformat
from nbclient import NotebookClient
from nbformat import NotebookNode
from PIL import Image
from traitlets.config import Config

ROOT = Path(__file__).resolve().parents[2]
TUTORIALS = ROOT / "docs" / "tutorials"
NOTEBOOKS = ROOT / "out" / "notebooks"


def sources() -> list[Path]:
    return sorted(TUTORIALS.glob("*.py"))


def executed(source: Path) -> NotebookNode:
    """The notebook of a source, run by a kernel in an empty folder; an error in a cell is raised."""
    notebook = jupytext.read(source)
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as sockets:
        # The kernel listens to files, not to ports that others could reach.
        config = Config(ConnectionFileMixin={"transport": "ipc", "ip": f"{sockets}/kernel"})
        resources = {"metadata": {"path": folder}}
        return NotebookClient(notebook, config=config, timeout=600, resources=resources).execute()


def with_links_from(folder: Path, notebook: NotebookNode) -> NotebookNode:
    """Links of the texts, which lead from docs/tutorials, made to lead from another folder to the same pages."""
    docs = Path(os.path.relpath(ROOT / "docs", folder.resolve())).as_posix()
    for cell in notebook.cells:
        if cell.cell_type == "markdown":
            cell.source = cell.source.replace("](../", f"]({docs}/").replace(".py)", ".ipynb)")
    return notebook


def outputs(notebook: NotebookNode) -> list[list[dict[str, str]]]:
    """Per cell of code what it puts out, in order: by kind ("text", "html", "png" in base64)."""
    return [
        [shown(output) for output in cell.outputs if output.get("name") != "stderr"]
        for cell in notebook.cells
        if cell.cell_type == "code"
    ]


def shown(output: NotebookNode) -> dict[str, str]:
    if output.output_type == "stream":
        return {"text": output.text}
    for kind, name in (("image/png", "png"), ("text/html", "html"), ("text/plain", "text")):
        if kind in output.data:
            return {name: output.data[kind]}
    raise ValueError(f"output: expected a picture, HTML or text, got {', '.join(output.data)}")


def small(png: bytes) -> bytes:
    """A picture with a palette: a third of the size, and the same to the eye."""
    small = io.BytesIO()
    picture = Image.open(io.BytesIO(png)).convert("RGB")
    picture.quantize(256, Image.Quantize.MAXCOVERAGE).save(small, "png", optimize=True)
    return small.getvalue()


def keep(name: str, cells: list[list[dict[str, str]]]) -> None:
    """Write pictures as NAME-1.png and so on, and what is put out as NAME.json, with the names of pictures."""
    for old in TUTORIALS.glob(f"{name}-*.png"):
        old.unlink()
    kept: list[list[dict[str, Any]]] = []
    count = 0
    for cell in cells:
        kept.append([])
        for output in cell:
            if "png" in output:
                count += 1
                picture = f"{name}-{count}.png"
                (TUTORIALS / picture).write_bytes(small(base64.b64decode(output["png"])))
                kept[-1].append({"png": picture})
            else:
                kept[-1].append(output)
    (TUTORIALS / f"{name}.json").write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def differs(name: str, cells: list[list[dict[str, str]]]) -> bool:
    """True where other things are put out than the site shows, but for details of pictures and tables."""
    kept = json.loads((TUTORIALS / f"{name}.json").read_text(encoding="utf-8"))
    return [[text_or_kind(output) for output in cell] for cell in cells] != [
        [text_or_kind(output) for output in cell] for cell in kept
    ]


def text_or_kind(output: dict[str, str]) -> str:
    return output["text"] if "text" in output else next(iter(output))


def main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("names", nargs="*", help="tutorials; default: all")
    options.add_argument("-o", "--output", type=Path, default=NOTEBOOKS, help="folder of the notebooks")
    options.add_argument("--check", action="store_true", help="end with 1 where the site shows other outputs")
    given = options.parse_args()
    given.output.mkdir(parents=True, exist_ok=True)
    status = 0
    for source in [TUTORIALS / f"{name}.py" for name in given.names] or sources():
        notebook = executed(source)
        found = outputs(notebook)
        if not given.check:
            keep(source.stem, found)
        elif differs(source.stem, found):
            sys.stderr.write(f"{source.name}: the site shows other outputs: make notebooks\n")
            status = 1
        path = given.output / f"{source.stem}.ipynb"
        nbformat.write(with_links_from(given.output, notebook), path)
        sys.stdout.write(f"{path}\n")
    return status


if __name__ == "__main__":
    sys.exit(main())
