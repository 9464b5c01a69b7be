"""Pages of the reference, made from the names that the stubs of the package list and from their docstrings."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path
from typing import NamedTuple

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

SOURCES = Path(__file__).resolve().parents[2] / "python"
TITLES = {
    "radar": "Radars",
    "geometry": "Shapes, meshes, poses",
    "motion": "Motions",
    "scene": "Scenes",
    "simulate": "Simulation",
    "recording": "Frames and recordings",
    "processing": "Processing",
    "comparison": "Comparison",
    "depth": "Depth images",
    "scenefile": "Scene files",
    "dataset": "Datasets",
    "models": "Arms and people",
    "plot": "Pictures",
    "sensor": "Sensors",
    "adapters": "Other programs",
}
"""Title of the page of each folder."""

FIRST = (
    *("Radar", "Waveform", "Receiver", "bgt60tr13c", "load_mesh", "Mesh", "Pose", "Linear", "Trajectory", "Live"),
    *("Scene", "Body", "PointTarget", "Simulator", "Frame", "Truth", "Recording", "range_doppler", "range_profile"),
    *("strongest_peak", "detect", "Detections", "track", "Tracker", "compare", "load_scene", "Human", "RobotArm"),
    "open_sensor",
)
"""Names that a reader looks for: these come before the others of their page."""


CODE = re.compile(r"(<[^>]*>)?<code>(rc\.)?([A-Za-z_]\w*)((?:\.\w+)*)([^<]*)</code>")
"""Words in code, with the tag before, as texts have them: `rc.detect`, `Radar.max_velocity`, `strongest_peak(...)`."""


SEE_ALSO = re.compile(r'(<details class="see-also"[^>]*>\s*<summary>[^<]*</summary>)\s*<p>(.*?)</p>', flags=re.DOTALL)
SEE_NAME = re.compile(r"\s*(?:rc\.)?([A-Za-z_]\w*)((?:\.\w+)*)\s*")


class Name(NamedTuple):
    """A public name: as users write it after its package, that package, and the module that defines it."""

    name: str
    package: str
    module: str

    @property
    def written(self) -> str:
        return f"{written(self.package)}.{self.name}"

    @property
    def target(self) -> str:
        return f"{self.module}.{self.name.rpartition('.')[2]}"

    @property
    def summary(self) -> str:
        """First paragraph of its docstring."""
        defined = self.name.rpartition(".")[2]
        if is_module(defined, self.module):
            return paragraph(docstring(f"{self.module}.{defined}"))
        tree = tree_of(self.module)
        found = [node for node in tree.body if getattr(node, "name", None) == defined]
        return paragraph((ast.get_docstring(found[0]) or "") if found else below(defined, tree))


def written(package: str) -> str:
    return package.replace("radarcore", "rc", 1)


def paragraph(text: str) -> str:
    return text.partition("\n\n")[0].replace("\n", " ").replace("|", r"\|")


@cache
def tree_of(module: str) -> ast.Module:
    path = SOURCES.joinpath(*module.split("."))
    path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(path.read_text(encoding="utf-8"))


def docstring(module: str) -> str:
    return ast.get_docstring(tree_of(module)) or ""


def below(name: str, tree: ast.Module) -> str:
    """The string below the assignment of a name."""
    for assigned, after in zip(tree.body, tree.body[1:], strict=False):
        targets = [assigned.target] if isinstance(assigned, ast.AnnAssign) else getattr(assigned, "targets", [])
        if any(getattr(target, "id", None) == name for target in targets) and isinstance(after, ast.Expr):
            return str(ast.literal_eval(after.value))
    return ""


def is_module(name: str, module: str) -> bool:
    path = SOURCES.joinpath(*module.split("."), name)
    return path.is_dir() or path.with_suffix(".py").is_file()


def stub(package: str) -> list[Name]:
    """Public names of a package: lines ``from MODULE import NAME as NAME`` of its stub, if it has one."""
    path = SOURCES.joinpath(*package.split("."), "__init__.pyi")
    words = [line.split() for line in path.read_text(encoding="utf-8").splitlines()] if path.is_file() else []
    names = [Name(line[3], package, line[1]) for line in words]
    return [name if is_module(name.name, name.module) else at_its_origin(name) for name in names]


def at_its_origin(name: Name) -> Name:
    """The name with the module that defines it, where another package only offers it."""
    offered = {other.name: other.module for other in stub(name.module)}
    return name._replace(module=offered.get(name.name, name.module))


def defined_in(module: str, prefix: str = "", package: str = "") -> list[Name]:
    """Public classes and functions of a module."""
    nodes = [node for node in tree_of(module).body if isinstance(node, ast.ClassDef | ast.FunctionDef)]
    return [Name(prefix + node.name, package or module, module) for node in nodes if not node.name.startswith("_")]


def pages() -> dict[str, list[Name]]:
    """Names per page of the reference."""
    found = defaultdict(list)
    for name in stub("radarcore"):
        folder = name.module.removeprefix("radarcore.").partition(".")[0]
        if name.name == "shapes":
            found["geometry"] += defined_in(f"{name.module}.shapes", "shapes.", "radarcore")
        elif folder in TITLES:
            found[folder].append(name)
    for folder in found:
        found[folder].sort(key=lambda name: FIRST.index(name.name) if name.name in FIRST else len(FIRST))
    for package in ("dataset", "models", "models.robots", "plot", "processing", "sensor"):
        page = found[package.partition(".")[0]]
        known = {name.name for name in page}
        page += [
            name
            for name in stub(f"radarcore.{package}")
            if name.name not in known and not is_module(name.name, name.module)
        ]
    for adapter in stub("radarcore.adapters"):
        package = f"radarcore.adapters.{adapter.name}"
        found["adapters"] += stub(package) or defined_in(package)
    return found


def page_of(folder: str, names: list[Name]) -> str:
    lines = [f"# {TITLES[folder]}", "", docstring(f"radarcore.{folder}"), ""]
    package = "radarcore"
    for name in names:
        if name.package != package:
            package = name.package
            lines += [f"## {written(package)}", "", docstring(package), ""]
        lines += [f"::: {name.target}", "    options:", f"      heading_level: {2 if package == 'radarcore' else 3}"]
        lines += [f'      heading: "{name.written}"', f'      toc_label: "{name.name}"', ""]
    return "\n".join(lines)


def index(found: dict[str, list[Name]]) -> str:
    lines = ["# Reference", "", "Every public name, by topic, after `import radarcore as rc`.", ""]
    for folder, title in TITLES.items():
        lines += [f"## [{title}]({folder}.md)", "", "| name | |", "|---|---|"]
        lines += [f"| [`{name.written}`][{name.target}] | {name.summary} |" for name in found[folder]]
        lines.append("")
    return "\n".join(lines)


@cache
def targets() -> dict[str, str]:
    """Places of definitions by name: as written after
    ``rc.``, or alone; for names in several packages the place in ``rc``."""
    names = [name for page in pages().values() for name in page]
    alone = {name.name: name.target for name in reversed(names)}
    return {name.written.removeprefix("rc."): name.target for name in names} | alone


def entry(name: str) -> str | None:
    """Place where a name such as `Radar.max_unambiguous_range` or `plot.rcs` is defined; None for what has no entry."""
    parts = name.split(".")
    heads = (".".join(parts[:number]) for number in range(len(parts), 0, -1))
    head = next((head for head in heads if head in targets()), None)
    return None if head is None else targets()[head] + name.removeprefix(head)


def link(name: str, code: str) -> str:
    """A name in code as a link into the reference; names without an entry stay text."""
    target = entry(name)
    shown = f"<code>{code}</code>"
    return shown if target is None else f'<autoref identifier="{target}" optional>{shown}</autoref>'


def linked(match: re.Match[str]) -> str:
    """A name in code, as a link where it can mean nothing else."""
    before, prefix, name, rest, after = (part or "" for part in match.groups())
    means_a_name = prefix != "" or name[0].isupper() or "_" in name
    if (
        entry(name + rest) is None
        or not means_a_name
        or before.startswith(("<a", "<h"))
        or (after and after[0] not in "([@")
    ):
        return match[0]
    return before + link(name + rest, f"{prefix}{name}{rest}{after}")


def listed(match: re.Match[str]) -> str:
    """A section "See Also" as a list: lines ``name, name : text``, or text that goes on."""
    items: list[str] = []
    for line in match[2].splitlines():
        names, _, text = line.partition(" : ")
        found = [SEE_NAME.fullmatch(name) for name in names.split(",")]
        if text and all(found):
            items.append(", ".join(link(name[1] + name[2], name[1] + name[2]) for name in found if name) + f": {text}")
        elif items:
            items[-1] += f" {line}"
        else:
            items.append(line)
    return match[1] + "<ul>" + "".join(f"<li>{item}</li>" for item in items) + "</ul>"


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Link names in code, and names in sections "See Also"."""
    return CODE.sub(linked, SEE_ALSO.sub(listed, html)) if not page.file.src_uri.startswith("CHANGELOG") else html


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add a page per topic and the table of all names."""
    found = pages()
    files.append(File.generated(config, "api/index.md", content=index(found)))
    for folder in TITLES:
        files.append(File.generated(config, f"api/{folder}.md", content=page_of(folder, found[folder])))
    return files
