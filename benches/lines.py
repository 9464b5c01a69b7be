"""Lines of the package and its tests by folder: code, docstrings, comments; one row per folder, one table per commit.

    python benches/lines.py [COMMIT ...]    # without a commit, the files as they are
    python benches/lines.py --tiny          # a single folder

Blank lines, comments and docstrings do not count as code. Stubs (.pyi) are left out. Rust is counted without its unit
tests (`mod tests` at the foot of a file, and files called tests).
"""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
UNIT_TESTS = re.compile(r"^#\[cfg\(test\)\]\nmod tests \{", re.MULTILINE)


def git(*arguments: str) -> str:
    return subprocess.run(["git", "-C", ROOT, *arguments], capture_output=True, text=True, check=True).stdout


def sources(commit: str | None, folders: Iterable[str]) -> dict[str, str]:
    """Text of every Python and Rust source, by its path."""
    if commit is None:
        names = git("ls-files", *folders).split("\n")
        return {name: (ROOT / name).read_text() for name in names if is_source(name) and (ROOT / name).exists()}
    names = git("ls-tree", "-r", "--name-only", commit, *folders).split("\n")
    return {name: git("show", f"{commit}:{name}") for name in names if is_source(name)}


def is_source(name: str) -> bool:
    return name.endswith((".py", ".rs"))


def docstring_lines(text: str) -> set[int]:
    """Numbers of the lines that belong to strings which stand as statements."""
    found: set[int] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return found


def count_python(text: str) -> tuple[int, int, int]:
    """Lines of code, docstrings, comments."""
    docstrings = docstring_lines(text)
    rest = [line.strip() for number, line in enumerate(text.splitlines(), 1) if number not in docstrings]
    comments = sum(line.startswith("#") for line in rest)
    return sum(bool(line) for line in rest) - comments, len(docstrings), comments


def count_rust(text: str) -> tuple[int, int, int]:
    """Lines of code, documentation, comments, without unit tests."""
    if tests := UNIT_TESTS.search(text):
        text = text[: tests.start()]
    lines = [line.strip() for line in text.splitlines()]
    documentation = sum(line.startswith(("///", "//!")) for line in lines)
    comments = sum(line.startswith("//") for line in lines) - documentation
    return sum(bool(line) for line in lines) - documentation - comments, documentation, comments


def folder(name: str) -> str:
    """The folder of the table: two floors of the package, one of tests and Rust."""
    parts = name.split("/")[:-1]
    return "/".join(parts[:3] if parts[0] == "python" else parts[:2])


def table(commit: str | None, folders: Iterable[str] = ("python", "tests", "rust")) -> None:
    rows: dict[str, list[int]] = defaultdict(lambda: [0, 0, 0, 0])
    for name, text in sources(commit, folders).items():
        if name.endswith(".rs") and (name.startswith("tests/") or name.endswith("tests.rs")):
            continue
        counts = count_python(text) if name.endswith(".py") else count_rust(text)
        for key in (folder(name), f"{name.split('/')[0]} (all)"):
            rows[key] = [old + new for old, new in zip(rows[key], (1, *counts), strict=True)]
    print(f"{commit or 'files as they are':34} files   code  docs  comments")
    for key in sorted(rows):
        files, code, documentation, comments = rows[key]
        print(f"{key:34} {files:5} {code:6} {documentation:5} {comments:9}")


if __name__ == "__main__":
    if "--tiny" in sys.argv:
        table(None, ["tests/fuzz"])
    else:
        for named in sys.argv[1:] or [None]:
            table(named)
