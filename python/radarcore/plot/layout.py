"""Layout of the figures: constrained, by what is written beside the axes. Loaded with the first figure."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

from matplotlib.layout_engine import ConstrainedLayoutEngine

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Layout(ConstrainedLayoutEngine):
    """Leaves out the borders of axes, which reach out by half a line: measuring one places all ticks once more."""

    def execute(self, fig: Figure) -> None:
        """Give everything its place."""
        for ax in itertools.chain(fig.axes, *(ax.child_axes for ax in fig.axes)):
            for spine in ax.spines.values():
                spine.set_in_layout(False)
        super().execute(fig)
