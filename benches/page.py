"""Texts that the benches write into benches/results and docs: tables, sections between two comments, and numbers.

python benches/page.py --write    put the numbers of the tables into the summary pages, as every bench with --write does
"""

from __future__ import annotations

import io
import os
import platform
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path

from summaries import CELLS, PLACES

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
RESULTS = Path(__file__).parent / "results"
PERFORMANCE, ACCURACY, POINTS = RESULTS / "performance.md", RESULTS / "accuracy.md", RESULTS / "accuracy.csv"

NUMBER = r"\d+(?:\.\d+)?(?:e[+-]\d+)?"


def table(header: list[str], rows: Iterable[list[str]]) -> str:
    """A Markdown table with aligned columns; numbers to the right."""
    cells = [header, *rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    is_text = [column[1][:1].isalpha() for column in zip(*cells, strict=True)]
    rule = ["-" * w if text else "-" * (w - 1) + ":" for w, text in zip(widths, is_text, strict=True)]
    return "\n".join(
        "| " + " | ".join(f"{c:{'<' if t else '>'}{w}}" for c, w, t in zip(row, widths, is_text, strict=True)) + " |"
        for row in [cells[0], rule, *cells[1:]]
    )


def tables_of(text: str) -> list[list[dict[str, str]]]:
    """Rows of all Markdown tables of a text, by the names of their columns."""
    blocks = re.findall(r"(?:^\|.*\n?)+", text, flags=re.MULTILINE)
    grids = [[[cell.strip() for cell in line.split("|")[1:-1]] for line in block.splitlines()] for block in blocks]
    return [[dict(zip(grid[0], row, strict=True)) for row in grid[2:]] for grid in grids]


def milliseconds(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}"


def machine() -> str:
    """The highest instruction set and the number of cores."""
    cpu = Path("/proc/cpuinfo")
    flags = cpu.read_text(encoding="utf-8") if cpu.exists() else ""
    instructions = next((name for flag, name in (("avx512f", "AVX-512"), ("avx2", "AVX2")) if flag in flags), None)
    return f"{instructions or platform.machine()}, {os.cpu_count()} cores"


def section_of(page: Path, bench: str) -> str:
    """The section of one bench."""
    found = page.read_text(encoding="utf-8").partition(f"<!-- benches/{bench}.py -->\n")[2]
    return found.partition(f"<!-- end of benches/{bench}.py -->")[0]


def write_section(page: Path, bench: str, text: str) -> None:
    """Replace the section of one bench, and the numbers of the summary pages."""
    page.write_text(with_section(page.read_text(encoding="utf-8"), bench, text), encoding="utf-8")
    write_numbers()


def write_numbers() -> None:
    """Put the numbers of the tables into the summary pages."""
    found = numbers()
    for name, places in PLACES.items():
        text = (ROOT / name).read_text(encoding="utf-8")
        (ROOT / name).write_text(with_numbers(text, places, found), encoding="utf-8")


def numbers() -> dict[str, str]:
    """The numbers of the tables, by name."""
    results = "".join(page.read_text(encoding="utf-8") for page in (PERFORMANCE, ACCURACY))
    return {name: cell_of(results, cell) for name, cell in CELLS.items()}


def cell_of(text: str, cell: str) -> str:
    """The number in a cell: the beginning of the line above its table, the first cells of its row, its column."""
    line, *start, column = cell.split(" | ")
    below = text.partition(f"\n{line}")[2].partition("\n|")[2].partition("\n\n")[0]
    (found,) = (row[column] for row in tables_of(f"|{below}")[0] if list(row.values())[: len(start)] == start)
    return found.partition(" ")[0]


def with_numbers(page: str, places: Iterable[str], numbers: dict[str, str]) -> str:
    """The page with numbers in their places: texts with names in braces, each once on the page."""
    for place in places:
        texts, names = re.split(r"\{\w+\}", place), re.findall(r"\{(\w+)\}", place)
        pattern = NUMBER.join("(" + re.escape(text).replace(r"\ ", r"\s+") + ")" for text in texts)
        found = list(re.finditer(pattern, page))
        if len(found) != 1:
            raise ValueError(f"page: expected {place!r} once, got {len(found)} times")
        values = [*(numbers[name] for name in names), ""]
        filled = "".join(text + value for text, value in zip(found[0].groups(), values, strict=True))
        page = page[: found[0].start()] + filled + page[found[0].end() :]
    return page


@contextmanager
def printed_into(page: Path, bench: str, *, write: bool) -> Iterator[None]:
    """Print; with `write`, the same text also becomes the section of a bench."""

    class Both(io.StringIO):
        def write(self, text: str) -> int:
            terminal.write(text)
            return super().write(text)

    terminal, kept = sys.stdout, Both()
    with redirect_stdout(kept):
        yield
    if write:
        write_section(page, bench, f"```text\n{kept.getvalue().strip()}\n```")


def with_section(page: str, bench: str, text: str) -> str:
    """The page with `text` between the two comments of `bench`, which are added at its end if it has none."""
    start, end = f"<!-- benches/{bench}.py -->\n", f"<!-- end of benches/{bench}.py -->\n"
    section = f"{start}\n{text.strip()}\n\n{end}"
    before, found, rest = page.partition(start)
    if not found:
        return f"{page.rstrip()}\n\n{section}"
    _, found, after = rest.partition(end)
    if not found:
        raise ValueError(f"page: expected {end.strip()!r} after {start.strip()!r}")
    return before + section + after


if __name__ == "__main__" and "--write" in sys.argv:
    write_numbers()
