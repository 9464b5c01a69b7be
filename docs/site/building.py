"""A site that is built sooner: its search reads listings without their colours, and garbage is looked for seldom."""

import gc
import re
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.plugins import CombinedEvent, event_priority
from mkdocs.structure.nav import Navigation
from mkdocs.structure.pages import Page

LISTING = re.compile(r"<pre\b.*?</pre>", flags=re.DOTALL)
COLOUR = re.compile(r"</?span\b[^>]*>")


def on_startup(*, command: str, dirty: bool) -> None:
    """Collect garbage seldom: pages consist of very many objects, and nearly all stay."""
    gc.set_threshold(100_000, 50, 100)


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
