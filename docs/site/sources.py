"""Files beside docs/ that pages link to become part of the site: links lead somewhere on the forge and here.

Pages in Markdown become pages, and everything else, scripts and scenes, becomes a listing.
"""

import posixpath
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).resolve().parents[2]
LINK = re.compile(r"(\]\(|src=\")([^()\s\"#]+)((?:#[^()\s\"]*)?[)\"])")
FENCED = re.compile(r"^ *```.*?^ *```$", flags=re.DOTALL | re.MULTILINE)
OUTSIDE = ("examples/", "python/", "benches/", "CHANGELOG", "CONTRIBUTING", "LICENSE")
"""Beginnings of paths beside docs/ that pages may link to."""

AS_THEY_ARE = {".md", ".png", ".svg", ".gif"}
LANGUAGES = {".py": "python", ".toml": "toml", ".rs": "rust"}
LISTING = """---
search:
  exclude: true
---
# {path}

````{language}
{text}
````
"""


def uri_of(path: str) -> str:
    """Place of a file of the repository on the site."""
    if path.startswith("docs/"):
        inside = path.removeprefix("docs/")
        return inside.replace(".py", ".md") if inside.startswith("tutorials/") else inside
    return path if Path(path).suffix in AS_THEY_ARE else f"{path}.md"


def path_of(uri: str) -> str:
    """Which file of the repository a page of the site is; a listing has no links."""
    return uri if uri.startswith(OUTSIDE) else f"docs/{uri}"


def resolved(path: str, target: str) -> str:
    """Path in the repository of what a page there links to."""
    return posixpath.normpath(posixpath.join(posixpath.dirname(path), target))


def added(path: str, config: MkDocsConfig) -> File:
    if uri_of(path) == path:
        return File.generated(config, path, abs_src_path=str(ROOT / path))
    text = (ROOT / path).read_text(encoding="utf-8").rstrip("\n")
    listing = LISTING.format(path=path, language=LANGUAGES.get(Path(path).suffix, "text"), text=text)
    return File.generated(config, uri_of(path), content=listing)


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add what pages link to beside docs/, and what those link to."""
    files.append(added("CHANGELOG.md", config))
    pages = [path_of(file.src_uri) for file in files.documentation_pages() if not file.src_uri.startswith("api/")]
    while pages:
        page = pages.pop()
        text = FENCED.sub("", (ROOT / page).read_text(encoding="utf-8"))
        for path in [resolved(page, target) for _, target, _ in LINK.findall(text) if "://" not in target]:
            if path.startswith(OUTSIDE) and (ROOT / path).is_file() and uri_of(path) not in files.src_uris:
                files.append(added(path, config))
                if path.endswith(".md"):
                    pages.append(path)
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Links as they are in the repository, made to lead to the same on the site."""
    here = page.file.src_uri
    if here.startswith("api/") or not (ROOT / path_of(here)).is_file():
        return markdown

    def on_site(match: re.Match[str]) -> str:
        before, target, after = match.groups()
        if "://" in target:
            return match[0]
        there = uri_of(resolved(path_of(here), target))
        return before + posixpath.relpath(there, posixpath.dirname(here) or ".") + after

    return LINK.sub(on_site, markdown)
