"""A fifth less time to build the site: search and highlighting do nothing in vain, and garbage is looked for seldom."""

import gc
import re
from collections.abc import Iterator
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import CombinedEvent, event_priority
from mkdocs.structure.nav import Navigation
from mkdocs.structure.pages import Page
from pygments.style import Style, StyleMeta

LISTING = re.compile(r"<pre\b.*?</pre>", flags=re.DOTALL)
COLOUR = re.compile(r"</?span\b[^>]*>")


def on_startup(*, command: str, dirty: bool) -> None:
    """Look for garbage seldom: pages are made of very many objects, nearly all of which stay."""
    gc.set_threshold(100_000, 50, 100)


class NoStyles(StyleMeta):
    """No styles: Pygments would make one for every kind of word and every listing, and the theme has its own."""

    def __iter__(self) -> Iterator[tuple[Any, Any]]:
        return iter(())


class ThemesOwn(Style, metaclass=NoStyles):
    pass


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    config.mdx_configs.setdefault("pymdownx.highlight", {})["pygments_style"] = ThemesOwn
    return config


class Colours:
    """Listings without their colours, which are most of the tags of a page, while the search reads it."""

    def __init__(self) -> None:
        self._listings: list[str] = []

    @event_priority(100)
    def take_out(self, context: dict[str, Any], *, page: Page, config: MkDocsConfig, nav: Navigation) -> None:
        self._listings = LISTING.findall(page.content or "")
        page.content = LISTING.sub(lambda listing: COLOUR.sub("", listing[0]), page.content or "")

    @event_priority(-100)
    def put_back(self, context: dict[str, Any], *, page: Page, config: MkDocsConfig, nav: Navigation) -> None:
        listings = iter(self._listings)
        page.content = LISTING.sub(lambda _: next(listings), page.content or "")


COLOURS = Colours()
on_page_context = CombinedEvent(COLOURS.take_out, COLOURS.put_back)
