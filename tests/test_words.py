"""Wording: phrases that CONTRIBUTING asks to avoid stay rare, and pages stay short."""

from pathlib import Path

import pytest

import words

ROOT = Path(__file__).resolve().parents[1]
PHRASES = [
    ("that of, those of", "The error is that of a sphere. Those of plates are smaller."),
    ("what or who as the subject", "What is weaker is lost. Who comes later waits."),
    ("told", "The arm is told to stop, or left untold."),
]
LIMITS = {"pages": 5, "package": 50, "benches, examples": 12, "Rust": 5, "tests": 37}
"""Most matches by area: in all about a twentieth of the 2093 at 507e0be."""


def number_of_words(*patterns: str) -> int:
    return sum(len(path.read_text(encoding="utf-8").split()) for pattern in patterns for path in ROOT.glob(pattern))


@pytest.mark.parametrize(("kind", "text"), PHRASES)
def test_phrases_are_found_in_pages_comments_docstrings_and_messages(tmp_path: Path, kind: str, text: str) -> None:
    folder = tmp_path / "python"
    folder.mkdir()
    (tmp_path / "README.md").write_text(f"# Title\n\n{text}\n\n```sh\necho {text}\n```\n", encoding="utf-8")
    (folder / "a.py").write_text(f'"""{text}"""\n# {text}\nraise ValueError("{text}")\n', encoding="utf-8")
    found = words.counts(tmp_path)
    assert (found["pages"][kind], found["package"][kind]) == (2, 6)


def test_questions_and_plain_sentences_are_not_counted(tmp_path: Path) -> None:
    text = "What is this? The radar sees what the rays hit. Nobody knows who that is."
    (tmp_path / "README.md").write_text(text, encoding="utf-8")
    assert words.counts(tmp_path)["pages"].total() == 0


def test_few_phrases_are_left() -> None:
    found = {area: kinds.total() for area, kinds in words.counts(ROOT).items()}
    assert {area: number for area, number in found.items() if number > LIMITS[area]} == {}


def test_pages_are_short() -> None:
    assert number_of_words("README.md", "docs/*.md", "docs/tutorials/*.md") <= 40_000
    assert number_of_words("README.md") <= 550
    assert len((ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()) <= 20


def test_readme_begins_with_a_clone_two_commands_and_the_picture() -> None:
    top = "\n".join((ROOT / "README.md").read_text(encoding="utf-8").splitlines()[:40])
    assert "git clone" in top
    assert "make demo" in top
    assert "![" in top
