"""Tutorials as pages: texts and code of their sources, and what `make notebooks` has kept of their outputs."""

import json
from pathlib import Path

import jupytext
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

TUTORIALS = Path(__file__).resolve().parents[1] / "tutorials"


def page(source: Path) -> str:
    outputs = iter(json.loads(source.with_suffix(".json").read_text(encoding="utf-8")))
    lines: list[str] = []
    for cell in jupytext.read(source).cells:
        if cell.cell_type == "markdown":
            lines += [cell.source.replace(".py)", ".md)"), ""]
        else:
            lines += ["```python", cell.source, "```", ""]
            for output in next(outputs):
                lines += [*written(output), ""]
        if len(lines) == 2:  # below the title
            where = f"docs/tutorials/{source.name}"
            lines += [f"*A notebook: `{where}`, which Jupyter opens with jupytext, or runs as it is in Python.*", ""]
    return "\n".join(lines)


def written(output: dict[str, str]) -> list[str]:
    if "png" in output:
        return [f"![Picture of the cell above]({output['png']})"]
    if "html" in output:
        return ["<details><summary>Output, a table</summary>", output["html"], "</details>"]
    return ["```text", output["text"].rstrip("\n"), "```"]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page per source; it comes after the hook of sources, which reads pages that are files."""
    for source in sorted(TUTORIALS.glob("*.py")):
        files.append(File.generated(config, f"tutorials/{source.stem}.md", content=page(source)))
    return files
