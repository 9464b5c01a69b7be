"""The site: every page is in its navigation, and it builds without a warning, dead links among them."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PUBLIC = tuple(f"{package}__init__.pyi" for package in ("", "dataset/", "models/", "plot/", "processing/", "sensor/"))
"""Stubs with the public names of their packages."""

NOT_SHOWN = {"__version__", "adapters", "dataset", "models", "plot", "processing", "sensor", "shapes", "robots"}
"""Of these the contents are shown, not the packages."""


def text_of(path: str | Path) -> str:
    return (ROOT / path).read_text(encoding="utf-8")


def test_navigation_has_every_page() -> None:
    named = re.findall(r"(\S+\.md)$", text_of("mkdocs.yml").partition("\nnav:")[2], flags=re.MULTILINE)
    assert len(named) == len(set(named))
    assert set(named) >= {page.name for page in (ROOT / "docs").glob("*.md")}


LOADED = re.compile(r'<(?:script|img|iframe|link)\b[^>]*?\b(?:src|href)="([^"]*)"')
"""Addresses that a page loads."""


def check_equations(theory: str) -> None:
    """All are MathML, and numbered ones have anchors."""
    assert theory.count("<math ") > 50
    for number in re.findall(r"\\tag\{(\d+)\}", text_of("docs/theory.md")):
        assert f'id="eq-{number}"' in theory
    assert not re.findall(r"\$\$|\\(?:frac|sqrt|tag|left|text)\b", theory)


def check_reference(table: str) -> None:
    for stub in PUBLIC:
        names = set(re.findall(r" as (\w+)$", text_of(Path("python/radarcore") / stub), flags=re.MULTILINE))
        assert not [name for name in names - NOT_SHOWN if not re.search(rf'#radarcore\.[\w.]+\.{name}"', table)]


def test_site_builds_and_needs_nothing_from_elsewhere(tmp_path: Path) -> None:
    pytest.importorskip("material", reason="needs mkdocs-material: pip install -r requirements/test.txt")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", str(tmp_path)]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    pages = {str(page.relative_to(tmp_path)): text_of(page) for page in tmp_path.rglob("*.html")}
    assert len(pages) > 60
    loaded = {address for text in pages.values() for address in LOADED.findall(text)}
    assert "site/style.css" in loaded
    assert not {address for address in loaded if address.startswith(("http:", "https:", "//"))}
    check_equations(pages["theory.html"])
    check_reference(pages[str(Path("api/index.html"))])
