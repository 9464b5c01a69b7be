"""Files for contributors: CONTRIBUTING names existing files and folders; citation and issue forms are readable."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

import pytest

from radarcore import notice
from test_layers import MAY_IMPORT

ROOT = Path(__file__).resolve().parents[1]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
FORMS = ("bug", "board", "idea")
TEMPLATES = ROOT / ".github" / "ISSUE_TEMPLATE"
PATH = re.compile(r"`((?:[\w.-]+/)+[\w.-]*|[\w-]+\.(?:md|yml|toml|py|rs))`")


def read_yaml(path: Path) -> Any:
    yaml = pytest.importorskip("yaml", reason="needs PyYAML: pip install -r requirements/test.txt")
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def folders_of_table(title: str) -> set[str]:
    """Names in the first column of the table with a title."""
    table = CONTRIBUTING.partition(f"\n| {title} |")[2].partition("\n\n")[0]
    return {name for row in table.splitlines()[2:] for name in re.findall(r"`(\w+)`", row.split("|")[1])}


def test_every_path_in_contributing_exists() -> None:
    named = {path for path in PATH.findall(CONTRIBUTING) if not path.startswith(("out/", "zharfanw/"))}
    missing = {path for path in named if not (ROOT / path).exists() and not (ROOT / "benches" / path).exists()}
    assert missing == {"shared/recordings"}  # beside the clone, where somebody has put it
    assert len(named) > 50


def test_commands_in_contributing_name_tests_and_targets_that_exist() -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE))
    assert set(re.findall(r"\bmake ([a-z-]+)", CONTRIBUTING)) <= targets
    for path in re.findall(r"(?:pytest|python) ((?:tests|benches)/[\w./]+)", CONTRIBUTING):
        assert (ROOT / path).exists(), path
    for kind, name in re.findall(r"cargo (?:bench|test) --(bench|test) (\w+)", CONTRIBUTING):
        assert (ROOT / {"bench": "benches", "test": "tests"}[kind] / f"{name}.rs").is_file(), name


def test_tables_of_layers_have_every_folder() -> None:
    assert folders_of_table("Python, `python/radarcore/`") == set(MAY_IMPORT)
    layers = (ROOT / "tests" / "layers.rs").read_text(encoding="utf-8").partition("const LAYERS")[2].partition("];")[0]
    assert folders_of_table("Rust, `rust/`") == set(re.findall(r'\(\s*"(\w+)",', layers))


def test_a_deprecation_warns_at_the_line_of_the_user() -> None:
    with pytest.warns(DeprecationWarning, match="use other_name") as warned:
        notice.warn("name: use other_name; ends with 0.4", DeprecationWarning)
    assert warned[0].filename == __file__


def test_citation_has_the_version_of_the_package_and_the_paper() -> None:
    citation = read_yaml(ROOT / "CITATION.cff")
    package = tomllib.loads((ROOT / "Cargo.toml").read_text(encoding="utf-8"))["package"]
    assert (citation["cff-version"], citation["type"]) == ("1.2.0", "software")
    assert (citation["title"], str(citation["version"])) == (package["name"], package["version"])
    holder = re.search(r"Copyright \(c\) \d+ (.*)", (ROOT / "LICENSE").read_text(encoding="utf-8"))
    assert holder is not None
    assert citation["authors"] == [{"name": holder[1]}]
    (paper,) = citation["references"]
    assert paper["year"] == 2020
    assert [author["family-names"] for author in paper["authors"]] == ["Stetco", "Ubezio", "Mühlbacher-Karrer", "Zangl"]


@pytest.mark.parametrize("name", FORMS)
def test_issue_form_asks_with_the_keys_of_forms(name: str) -> None:
    form = read_yaml(TEMPLATES / f"{name}.yml")
    assert {"name", "description", "body"} <= set(form)
    assert len({field["id"] for field in form["body"]}) == len(form["body"])
    for field in form["body"]:
        assert field["type"] in ("input", "textarea", "dropdown", "checkboxes")
        assert field["attributes"]["label"]
    assert any(field.get("validations", {}).get("required") for field in form["body"])


def test_forms_are_all_listed_and_name_no_address() -> None:
    assert {path.name for path in TEMPLATES.iterdir()} == {"config.yml", *(f"{name}.yml" for name in FORMS)}
    assert read_yaml(TEMPLATES / "config.yml") == {"blank_issues_enabled": True}
    for path in (*TEMPLATES.iterdir(), ROOT / ".github" / "PULL_REQUEST_TEMPLATE.md", ROOT / "CITATION.cff"):
        assert "://" not in path.read_text(encoding="utf-8"), path.name
