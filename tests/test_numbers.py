"""Numbers on pages: results come from what commands wrote, so that a quantity has one number everywhere."""

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest

import radarcore as rc
from page import ACCURACY, DOCS, ROOT, numbers, section_of, tables_of, with_numbers
from summaries import CELLS, PLACES

WRITTEN = re.compile(r"^```.*?^```$|<!-- (benches/\w+\.py) -->.*?<!-- end of \1 -->", flags=re.DOTALL | re.MULTILINE)
"""Code, whose output the tests compare, and sections that benches write."""

RESULT = re.compile(
    r"(?<![\w.])(?:\d+(?:\.\d+)? ?%|\d+(?:\.\d+)? (?:[mu]?s|dB|rad|degrees?|[cm]?m(?:/s)?|[kMG]?Hz|bytes|[kMG]B|times"
    r"|frames per second)\b|\d+(?:\.\d+)?(?= x \|)|(?<=\| )\d+\.\d+(?= *\|))"
)
"""Numbers with units, and decimals in tables."""

TYPED = {
    "README.md": "40 frames per second; 60 GHz",
    "docs/accuracy.md": "64 GHz; 1 %; 4 cm; 0.1 mm",
    "docs/angles.md": "8 m; 8 m; 99 %; 0.5 %; 0.5 %; 8 m/s; 77 GHz; 0.5 rad; 20 us",
    "docs/bags.md": "0.2 s; 0.9 s",
    "docs/calibration.md": "10 cm; 5 m; 1 cm; 2 m; 0.3 degrees; 0.3 m",
    "docs/comparison.md": "0.1 ms; 14 degrees; 1 m/s; 60 GHz; 120 Hz; 40 Hz; 13 cm",
    "docs/coppeliasim.md": "25 ms; 40 Hz; 50 ms; 0.1 m; 1 cm; 3 m; 2 degrees; 60 GHz",
    "docs/datasets.md": "60 dB; 0.01 dB",
    "docs/demo.md": "250 mm/s; 5 s; 40 frames per second",
    "docs/depth-images.md": "60 GHz; 1.4 degrees; 42 degrees; 0.1 m",
    "docs/detection.md": "60 dB",
    "docs/ego-motion.md": "0.1 s; 45 degrees; 0.25 m/s",
    "docs/gallery.md": "40 times; 20 degrees; 0.6 m",
    "docs/install.md": "512 kB; 5 MB",
    "docs/interference.md": "30 m; 80 dB; 64 times; 2 %; 0.2 us",
    "docs/live.md": "20 ms; 5 m; 40 Hz",
    "docs/meshes.md": "60 GHz; 5 mm; 0.1 mm; 60 GHz; 45 degrees",
    "docs/motion-capture.md": "0.1 s; 0.1 m; 1 m/s; 0.1 s; 2 ms; 40 Hz; 1 cm; 240 Hz",
    "docs/mujoco.md": "0.05 mm; 20 m; 1 mm; 20 ms",
    "docs/own-mesh.md": "60 GHz; 5 mm",
    "docs/python.md": "0.5 ms",
    "docs/questions.md": "40 Hz",
    "docs/radar-engineers.md": "10 m; 10 degrees",
    "docs/radar.md": "100 MHz; 30 %; 0.1 s; 20 dB; 150 degrees",
    "docs/receiver.md": "0.1 %; 0 dB; 2 %; 12 dB; 50 dB; 63.5 GHz; 23 dB; 80 kHz",
    "docs/robotics.md": "40 Hz; 25 ms; 95 %; 40 Hz",
    "docs/ros.md": "60 GHz; 42 degrees; 0.1 us",
    "docs/sampling.md": (
        "60 degrees; 60 degrees; 20 dB; 150 degrees; 180 degrees; 110 degrees; 90.6 degrees; 110 degrees; 40 dB; "
        "2.5 rad; 1 rad; 20 degrees; 60 degrees; 0.1 mm"
    ),
    "docs/sensor.md": (
        "10 m; 16 cm; 4 m/s; 239 MHz; 20 m; 1 GHz; 2 s; 0 m; 0 m; 0 m; 1 ms; 10 s; 75 degrees; 15 dB; 0 Hz; 40 Hz; 6 s"
    ),
    "docs/separation.md": "1.6 m/s; 40 Hz; 0.25 m/s; 1.9 m; 1.6 m/s; 0.3 s; 0.3 m; 5 s; 0.5 m; 0.5 m/s; 1 m; 5 s",
    "docs/theory.md": "1 cm; 5 m; 77 GHz; 10 degrees; 0.5 m; 60 GHz",
    "docs/tracking.md": "0.5 m; 0.8 m; 0.5 m; 3 m/s; 0.1 m/s; 0.8 m; 0.3 m; 0.15 m; 0.5 rad",
    "docs/truth.md": "0.1 m",
    "docs/velocity.md": "2.3 m/s; 4 GHz; 1 ms",
    "docs/vital-signs.md": "60 GHz; 4 mm; 5 s; 6 frames per second; 10 frames per second; 20 s",
    "docs/waveforms.md": "0.4 %",
}
"""Such numbers that no command writes: settings, limits and data sheets, and besides these

- arithmetic: phases and angles of a distance or a velocity, a small sphere (accuracy), flashes of two blades (gallery),
  motion of a body (live), rounding of times since 1970 (interference, ros), an error of assembly (calibration);
- bounds that a test holds: 2 % of 64 steps (interference), 2 ms (motion-capture), 1 mm (mujoco), 2 % of a variance
  (receiver), boxes of 0.3 to 5 m (theory).
"""

BEFORE = re.compile(r"([\d.]+) ([\w/]+) \(`(\w+)=?`\)")
AFTER = re.compile(r"`(\w+)` \(([\d.]+) ([\w/]+)[,)]")
"""A setting and its default: "0.1 s (`max_gap`)", "`max_gap` (0.1 s)"."""

UNITS = {"mm": 1e-3}
"""Units of pages that arguments do not have."""


@pytest.mark.parametrize("name", PLACES)
def test_pages_have_the_numbers_of_the_tables(name: str) -> None:
    """`python benches/page.py --write` would change nothing."""
    text = (ROOT / name).read_text(encoding="utf-8")
    assert with_numbers(text, PLACES[name], numbers()) == text


def test_bounds_on_the_page_of_accuracy_are_the_default_ones_of_its_tables() -> None:
    page = tables_of(section_of(DOCS / "accuracy.md", "accuracy"))[0]
    every = tables_of(ACCURACY.read_text(encoding="utf-8").partition("\n## Bounds\n")[2])[0]
    default = [row for row in every if row["what"].startswith("adaptive, default, ")]
    named = [{**row, "what": f"adaptive, default, {row['what']}", "held": "yes"} for row in page]
    assert named == [row for row in default if row in named]


def test_numbers_replace_older_ones_and_keep_the_text() -> None:
    page, place = "It takes 1.5 ms,\nthen 2.1e+03. Here 7 ms.\n", "takes {one} ms, then {other}."
    assert with_numbers(page, [place], {"one": "12", "other": "0.3"}) == "It takes 12 ms,\nthen 0.3. Here 7 ms.\n"
    for text in (page + page, "It takes as long."):
        with pytest.raises(ValueError, match=r"expected 'takes \{one\} ms, then \{other\}\.' once, got [02] times"):
            with_numbers(text, [place], {"one": "12", "other": "0.3"})


def test_results_are_not_typed() -> None:
    """A new one belongs into a section or a table of a bench, a new setting into `TYPED`."""
    found = {}
    for path in (ROOT / "README.md", *DOCS.glob("**/*.md")):
        name, text = path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")
        blank = with_numbers(text, PLACES.get(name, ()), dict.fromkeys(CELLS, ""))
        found[name] = RESULT.findall(WRITTEN.sub("", blank).replace("\n", " "))
    assert {name: "; ".join(typed) for name, typed in found.items() if typed} == TYPED


def defaults() -> dict[str, set[object]]:
    """Constants that are defaults of arguments and fields of the package, by name."""
    found: dict[str, set[object]] = defaultdict(set)
    for path in Path(rc.__file__).parent.glob("**/*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            pairs: list[tuple[str, ast.expr | None]] = []
            if isinstance(node, ast.arguments):
                pairs = [(one.arg, value) for one, value in zip(node.args[::-1], node.defaults[::-1], strict=False)]
                pairs += [(one.arg, value) for one, value in zip(node.kwonlyargs, node.kw_defaults, strict=True)]
            elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                pairs = [(node.target.id, node.value)]
            for name, value in pairs:
                if isinstance(value, ast.Constant):
                    found[name].add(value.value)
    return found


def test_defaults_on_pages_are_up_to_date() -> None:
    known, found = defaults(), set()
    for path in DOCS.glob("**/*.md"):
        text = path.read_text(encoding="utf-8")
        swapped = [(value, unit, name) for name, value, unit in AFTER.findall(text)]
        for value, unit, name in BEFORE.findall(text) + swapped:
            found.add(name)
            assert float(value) * UNITS.get(unit, 1.0) in known[name], f"{path.name}: {name}, {value} {unit}"
    assert {"max_gap", "max_age", "retrace_deg", "plane_size"} <= found
