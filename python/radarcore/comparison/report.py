"""Tables of a comparison: as text, as one HTML file with the pictures, and as plain numbers."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import Any

from radarcore._core import __version__
from radarcore.comparison.figure import draw, over_time
from radarcore.comparison.record import Record, Side
from radarcore.comparison.targets import TargetErrors
from radarcore.table import Table, finite

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; color: #222; max-width: 72rem; margin: 2rem auto; padding: 0 1rem }
h1 { font-size: 1.6rem } h2 { font-size: 1.15rem; margin-top: 2rem }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
th, td { padding: .25rem .7rem; text-align: right; border-bottom: 1px solid #ddd; vertical-align: bottom }
th:first-child, td:first-child { text-align: left } th { font-weight: 600; border-bottom-color: #888 }
img { max-width: 100%; height: auto } p { max-width: 50rem } .note { color: #666 }
"""


def text(comparison: Record) -> str:
    """The tables as text."""
    return "\n\n".join(map(str, tables(comparison)))


def html(comparison: Record, *, time: float | None = None, max_range: float | None = None) -> str:
    """The tables and pictures as a self-contained page."""
    title = " and ".join(side.name for side in comparison.sides)
    parts = [
        "<!DOCTYPE html>",
        f'<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title><style>{_STYLE}</style></head>',
        "<body>",
        f"<h1>Comparison: {escape(title)}</h1>",
        _picture(draw(comparison, None, time=time, max_range=max_range), "Range-velocity maps, ranges and velocities"),
    ]
    for table in tables(comparison):
        parts.append(f"<h2>{escape(table.title)}</h2>")
        head = "".join(f"<th>{escape(cell).replace(chr(10), '<br>')}</th>" for cell in table.header)
        rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows)
        parts += [f"<table><tr>{head}</tr>{rows}</table>"] if table.rows else []
        parts += [f'<p class="note">{escape(table.note)}</p>'] if table.note else []
    parts += [
        "<h2>Power over time</h2>",
        _picture(over_time(comparison, max_range=max_range), "Ranges over time"),
        f'<p class="note">radarcore {escape(__version__)}</p></body></html>',
    ]
    return "\n".join(parts) + "\n"


def facts(comparison: Record) -> dict[str, Any]:
    """Everything except the series as plain numbers and texts; None for unknown values."""
    return {
        "truth": comparison.truth_source or None,
        "recordings": [
            {
                "name": side.name,
                "frames": len(side.recording),
                "start": float(side.recording.time[0]),
                "offset": side.offset.seconds,
                "offset_deviation": side.offset.deviation,
                "offset_is_estimated": side.offset.is_estimated,
                "dropped": [dict(vars(one)) for one in side.dropped],
                "range_bin": side.bins[0],
                "velocity_bin": side.bins[1],
            }
            for side in comparison.sides
        ],
        "differences": [one._asdict() for one in comparison.differences],
        "targets": [
            {
                "name": target.name,
                "errors": [finite(one.to_dict()) for one in target.errors],
                "difference": None if target.difference is None else finite(target.difference.to_dict()),
                "echo": None if target.echo is None else finite(dict(vars(target.echo))),
            }
            for target in comparison.targets
        ],
    }


def tables(comparison: Record) -> Iterator[Table]:
    """The tables, one after the other."""
    sides = comparison.sides
    yield _recordings(sides)
    if len(sides) == 2:
        header = ("", *(side.name for side in sides))
        note = "" if comparison.differences else "None: the radars have equal settings."
        yield Table(header, comparison.differences, "Settings that differ", note)
    for k, side in enumerate(sides):
        if comparison.truth_source:
            rows = [_errors(target.errors[k]) for target in comparison.targets]
            note = f"Truth: {comparison.truth_source}. Shares are of the frames in which a target was visible."
            yield Table(_HEADER, rows, f"Errors of {side.name} against the truth", note)
    if len(sides) == 2:
        a, b = (side.name for side in sides)
        differing = [_errors(target.difference) for target in comparison.targets if target.difference is not None]
        yield Table(_HEADER, differing, f"{b} less {a}", f"Over the frames of {b} in which {a} tracks the target.")
        yield _echoes(comparison, a, b)
    yield _dropped(sides)


def _recordings(sides: Sequence[Side]) -> Table:
    header = ("", "frames", "from [s]", "to [s]", "range bin [m]", "velocity bin [m/s]", "clock offset [s]", "dropped")
    rows = []
    for side in sides:
        offset = f"{side.offset.seconds:+.6f}"
        if side.offset.is_estimated:
            offset += f" ± {side.offset.deviation:.6f}"
        rows.append(
            (
                side.name,
                str(len(side.recording)),
                f"{side.recording.time[0] + side.offset.seconds:.3f}",
                f"{side.recording.time[-1] + side.offset.seconds:.3f}",
                f"{side.bins[0]:.4f}",
                f"{side.bins[1]:.4f}",
                offset,
                str(sum(one.count for one in side.dropped)),
            )
        )
    estimated = any(side.offset.is_estimated for side in sides)
    note = "Offsets with a deviation are estimated from changing velocities." if estimated else ""
    return Table(header, rows, "Recordings, by the common time base", note)


_HEADER = (
    "",
    *("frames\nvisible", "\ntracked", "\npredicted"),
    *("range\nbias", "error\nmedian", "[m]\nrms", "\nlargest", "[bins]\nmedian", "\n95 %", "\nlargest"),
    *("velocity\nbias", "error\nmedian", "[m/s]\nrms", "\nlargest", "[bins]\nmedian", "\n95 %", "\nlargest"),
    *("below\n1/2 bin", "below\n1 bin"),
)
"""Columns of errors; a line break within."""


def _errors(errors: TargetErrors) -> tuple[str, ...]:
    cells = [errors.name, *map(str, (errors.num_frames, errors.num_tracked, errors.num_predicted))]
    for part in (errors.range, errors.velocity):
        cells += [_number(part.bias, "+.4f"), *(_number(v, ".4f") for v in (part.median, part.rms, part.largest))]
        cells += [_number(v, ".3f") for v in (part.median_bins, part.percentile_95_bins, part.largest_bins)]
    return (*cells, _share(errors.range_share), _share(errors.velocity_share))


def _echoes(comparison: Record, a: str, b: str) -> Table:
    header = (
        "",
        "frames",
        "amplitude [dB]",
        "spread [dB]",
        "phase [°]",
        "spread [°]",
        "channels against the first [°]",
    )
    rows, notes = [], []
    for target in comparison.targets:
        if (echo := target.echo) is None:
            continue
        notes += [note for note in echo.note.split("; ") if note and note not in notes]
        rows.append(
            (
                target.name,
                str(echo.num_frames),
                _number(echo.ratio_db, "+.2f"),
                _number(echo.ratio_spread_db, ".2f"),
                _number(echo.phase_deg, "+.1f"),
                _number(echo.phase_spread_deg, ".1f"),
                ", ".join(f"{phase:+.1f}" for phase in echo.channel_phases_deg[1:]) or "-",
            )
        )
    note = f"{'; '.join(notes)}." if notes else ""
    return Table(header, rows, f"Echoes of {b} relative to {a}", note[:1].upper() + note[1:])


def _dropped(sides: Sequence[Side]) -> Table:
    rows = [
        (side.name, str(one.frame), f"{one.time:.3f}", str(one.count), "counted" if one.is_counted else "gap")
        for side in sides
        for one in side.dropped
    ]
    header = ("", "before frame", "at [s]", "frames", "known by")
    return Table(header, rows, "Dropped frames", "" if rows else "None.")


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"


def _share(value: float) -> str:
    return f"{100.0 * value:.0f} %" if math.isfinite(value) else "-"


def _picture(figure: Any, description: str) -> str:
    """A figure within the page."""
    data = io.BytesIO()
    figure.savefig(data, dpi=110)
    code = base64.b64encode(data.getvalue()).decode("ascii")
    return f'<img alt="{escape(description)}" src="data:image/png;base64,{code}">'
