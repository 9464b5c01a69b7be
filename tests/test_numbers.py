"""Numbers on pages: a quantity has one number everywhere, and results come from what the benches wrote."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PERFORMANCE, ACCURACY = "benches/results/performance.md", "benches/results/accuracy.md"
NUMBER = r"(\d[\d.e-]*)"

QUANTITIES = {
    "frame from a static sensor [ms]": {
        PERFORMANCE: rf"^\| all +\| +{NUMBER}",
        "README.md": rf"two threads \| {NUMBER} ms",
        "docs/performance.md": rf"static sensor \| 2 \| {NUMBER}",
        "docs/robotics.md": rf"static sensor \| default \| {NUMBER}",
    },
    "the same with fast sampling [ms]": {
        PERFORMANCE: rf"^\| all +\| +[\d.]+ \| +{NUMBER}",
        "README.md": rf"with fast sampling {NUMBER} ms",
        "docs/performance.md": rf'sampling="fast"` \| 2 \| {NUMBER}',
        "docs/robotics.md": rf'static sensor .*\n.*"fast"` \| {NUMBER}',
    },
    "frame from the moving arm [ms]": {
        PERFORMANCE: rf"^\| all +\| +[\d.]+ \| +[\d.]+ \| +{NUMBER}",
        "docs/performance.md": rf"moving arm \| 2 \| {NUMBER}",
        "docs/robotics.md": rf"rays are reused \| default \| {NUMBER}",
    },
    "frame of live bodies [ms]": {
        PERFORMANCE: rf"^\| a frame, median +\| +{NUMBER}",
        "docs/performance.md": rf"updates included \| 2 \| {NUMBER}",
        "docs/robotics.md": rf"updates included \| default \| {NUMBER}",
    },
    "record on four threads [ms]": {
        PERFORMANCE: rf"^\| record +\|.*?\|.*?\| +{NUMBER}",
        "docs/performance.md": rf"{NUMBER} ms on four\.",
        "docs/robotics.md": rf"four threads \| default \| {NUMBER}",
        "docs/machine-learning.md": rf"{NUMBER} ms on four",
    },
    "frame on one thread [ms]": {
        PERFORMANCE: rf"^\| frame, all +\| +{NUMBER}",
        "docs/performance.md": rf"takes {NUMBER} ms on one thread",
        "docs/robotics.md": rf"one thread \| default \| {NUMBER}",
    },
    "beat signal of 65 536 paths [ms]": {
        PERFORMANCE: rf"^\| random order, 1 GHz \| auto +\| +1e-03 \|.*?\| +[\d.e-]+ \| +{NUMBER}",
        "README.md": rf"one thread \| {NUMBER} ms",
        "docs/performance.md": rf"error [\d.e-]+ \| 1 \| {NUMBER}",
    },
    "its error": {
        PERFORMANCE: rf"^\| random order, 1 GHz \| auto +\| +1e-03 \|.*?\| +{NUMBER}",
        "README.md": rf"paths, error {NUMBER};",
        "docs/performance.md": rf"paths, error {NUMBER} ",
    },
    "the direct sum in C [ms]": {
        PERFORMANCE: rf"^\| random order, 1 GHz \| C f64 .*?e-13 \| +{NUMBER}",
        "README.md": rf"direct sum in C takes {NUMBER} ms",
        "docs/performance.md": rf"direct sum in C \| 1 \| {NUMBER}",
    },
    "level of spheres [dB]": {
        ACCURACY: rf"default, spheres and cylinder, any .*level.*?\| +[\d.]+ \| +{NUMBER}",
        "README.md": rf"errors up to {NUMBER} dB, 0.14",
        "docs/accuracy.md": rf"and a cylinder are at most {NUMBER}",
        "docs/radar-engineers.md": rf"^\| spheres .*?\| {NUMBER} dB",
    },
    "phase of spheres [rad]": {
        ACCURACY: rf"default, spheres and cylinder, any .*phase.*?\| +[\d.]+ \| +{NUMBER}",
        "README.md": rf"0.99 dB, {NUMBER} rad",
        "docs/accuracy.md": rf"and a cylinder are at most .* {NUMBER} rad",
        "docs/radar-engineers.md": rf"^\| spheres .*?dB, {NUMBER} rad",
    },
    "level of plates [dB]": {
        ACCURACY: rf"default, plates and discs, any .*level.*?\| +[\d.]+ \| +{NUMBER}",
        "README.md": rf"plates and discs \| errors up to {NUMBER} dB",
        "docs/accuracy.md": rf"plates and discs are at most {NUMBER}",
        "docs/radar-engineers.md": rf"^\| plates .*?\| {NUMBER} dB",
    },
    "profile of arm and person, worst [%]": {
        ACCURACY: rf"default, arm and human +\| range profile.*?\| +[\d.]+ \| +{NUMBER}",
        "README.md": rf"worst {NUMBER} %",
        "docs/radar-engineers.md": rf"dense integration \| {NUMBER} %",
    },
    "profile of arm and person, median [%]": {
        ACCURACY: rf"default, arm and human +\| range profile.*?\| +[\d.]+ \| +[\d.]+ \| +{NUMBER}",
        "README.md": rf"median error {NUMBER} %",
        "docs/radar-engineers.md": rf"median {NUMBER} %",
    },
}

WRITTEN = re.compile(r"^```.*?^```$|<!-- (benches/\w+\.py) -->.*?<!-- end of \1 -->", flags=re.DOTALL | re.MULTILINE)
"""Code, whose output the tests compare, and sections that benches write."""

WITH_UNIT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)(?: ?%| (?:ms|us|dB|frames per second)\b| x \|)")

SUMMARIES = ("README.md", "docs/performance.md", "docs/radar-engineers.md", "docs/machine-learning.md")
"""Pages whose results are in the tables of the benches."""

TYPED = {
    "angles": 4,
    "calibration": 1,
    "comparison": 1,
    "coppeliasim": 2,
    "datasets": 2,
    "detection": 2,
    "interference": 3,
    "live": 1,
    "motion-capture": 1,
    "mujoco": 1,
    "python": 1,
    "radar": 2,
    "receiver": 13,
    "robotics": 2,
    "ros": 1,
    "sampling": 2,
    "sensor": 3,
    "vital-signs": 2,
    "waveforms": 1,
}
"""Most numbers with such a unit, by page, that no bench writes: settings, limits, results of examples and tests."""


def text_of(path: str | Path) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def typed(path: str) -> list[str]:
    return [found[1] for found in WITH_UNIT.finditer(WRITTEN.sub("", text_of(path)))]


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_quantity_has_one_number_everywhere(quantity: str) -> None:
    found = {path: re.search(pattern, text_of(path), re.MULTILINE) for path, pattern in QUANTITIES[quantity].items()}
    assert None not in found.values(), found
    assert len({one[1] for one in found.values() if one is not None}) == 1, found


@pytest.mark.parametrize("path", SUMMARIES)
def test_summaries_show_numbers_of_the_tables(path: str) -> None:
    measured = set(re.findall(r"\d[\d.]*", text_of(PERFORMANCE) + text_of(ACCURACY)))
    assert set(typed(path)) - {"40"} <= measured  # frames of a BGT60 per second


def test_results_are_not_typed() -> None:
    """A new one belongs into a section or a table of a bench. The count grows for settings and limits only."""
    pages = {page.relative_to(ROOT).as_posix() for page in (ROOT / "docs").glob("**/*.md")}
    counts = {page: len(typed(page)) for page in pages - {*SUMMARIES, "docs/accuracy.md"}}
    assert {page: count for page, count in counts.items() if count > TYPED.get(page[5:-3], 0)} == {}
