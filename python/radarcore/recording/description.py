"""Description of samples that do not say themselves what they are: bare arrays and raw captures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from os import PathLike

from radarcore.radar.radar import Radar


@dataclass(frozen=True)
class Description:
    """Description of bare samples by the user.

    Parameters
    ----------
    radar : Radar, optional
        Radar of the samples.
    config : path, optional
        File with their radar, in place of `radar`.
    shape : str or sequence, optional
        Axes of the array, see `radarcore.recording.axes`.
    dtype : str, optional
        Type of the numbers of a raw file, as NumPy calls it: ``"int16"``, ``">u2"``.
    variable : str, optional
        Name of the array in a ``.mat`` or ``.npz`` file.
    """

    radar: Radar | None = None
    config: str | PathLike[str] | None = None
    shape: str | Sequence[str | int] | None = None
    dtype: str | None = None
    variable: str | None = None

    @property
    def given(self) -> dict[str, object]:
        """Given parts of the description, by name."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        return {name: value for name, value in values.items() if value is not None}

    def refuse(self, path: object, what: str, *names: str) -> None:
        """Refuse fields that files of a kind do not need, with a TypeError; all of them without `names`."""
        for name, value in self.given.items():
            if not names or name in names:
                got = type(value).__name__ if isinstance(value, Radar) else repr(str(value))
                raise TypeError(f"{name}: expected none, as {path} is {what}, got {got}")


NOTHING_SAID = Description()
"""Description of recordings that need none."""
