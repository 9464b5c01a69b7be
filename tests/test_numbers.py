"""Numbers on pages: results come from what commands wrote, so that a quantity has one number everywhere."""

import re

import pytest

from page import ACCURACY, DOCS, ROOT, numbers, section_of, tables_of, with_numbers
from summaries import CELLS, PLACES

WRITTEN = re.compile(r"^```.*?^```$|<!-- (benches/\w+\.py) -->.*?<!-- end of \1 -->", flags=re.DOTALL | re.MULTILINE)
"""Code, whose output the tests compare, and sections that benches write."""

RESULT = re.compile(
    r"(?<![\w.])(?:\d+(?:\.\d+)? ?%|\d+(?:\.\d+)? (?:ms|us|dB|rad|bytes|kB|MB|GB|times|frames per second)\b"
    r"|\d+(?:\.\d+)?(?= x \|)|(?<=\| )\d+\.\d+(?= *\|))"
)
"""Numbers with units of results, and decimals in tables."""

TYPED = {
    "README.md": ["40 frames per second"],
    "docs/accuracy.md": ["1 %"],
    "docs/angles.md": ["99 %", "0.5 %", "0.5 %", "0.5 rad", "20 us"],
    "docs/comparison.md": ["0.1 ms"],
    "docs/coppeliasim.md": ["25 ms", "50 ms"],
    "docs/datasets.md": ["60 dB", "0.01 dB"],
    "docs/detection.md": ["60 dB"],
    "docs/gallery.md": ["40 times"],
    "docs/install.md": ["512 kB", "5 MB"],
    "docs/interference.md": ["80 dB", "64 times", "2 %", "0.2 us"],
    "docs/live.md": ["20 ms"],
    "docs/motion-capture.md": ["2 ms"],
    "docs/mujoco.md": ["20 ms"],
    "docs/python.md": ["0.5 ms"],
    "docs/radar.md": ["30 %", "20 dB"],
    "docs/receiver.md": ["0.1 %", "0 dB", "2 %", "12 dB", "50 dB", "23 dB"],
    "docs/robotics.md": ["25 ms", "95 %"],
    "docs/ros.md": ["0.1 us"],
    "docs/sampling.md": ["20 dB", "40 dB", "2.5 rad", "1 rad"],
    "docs/sensor.md": ["1 ms", "15 dB"],
    "docs/tracking.md": ["0.5 rad"],
    "docs/vital-signs.md": ["6 frames per second", "10 frames per second"],
    "docs/waveforms.md": ["0.4 %"],
}
"""Such numbers that no command writes: settings, limits and data sheets, and besides these

- arithmetic: a small sphere (accuracy), phases of moving targets (angles, comparison), flashes of two blades (gallery),
  motion of a body (live), rounding of times since 1970 (interference, ros);
- bounds that a test holds: 2 % of 64 steps (interference), 2 ms (motion-capture), 2 % of a variance (receiver).
"""


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
        found[name] = RESULT.findall(WRITTEN.sub("", blank))
    assert {name: typed for name, typed in found.items() if typed} == TYPED
