"""Count of what a link has damaged, for the message of a time-out."""

from __future__ import annotations

from dataclasses import dataclass

from radarcore.sensor.strata.byte_stream import Damage


@dataclass
class DamageCount:
    """Damage since the last good frame or answer.

    Attributes
    ----------
    num_places : int
        How often the stream went wrong.
    num_bytes : int
        Bytes that were dropped.
    num_lost : int
        Packets that are missing, or were thrown away with a slice that is not whole.
    reason : str
        Reason of the last damage.
    """

    num_places: int = 0
    num_bytes: int = 0
    num_lost: int = 0
    reason: str = ""

    def add(self, damage: Damage) -> None:
        """Count dropped bytes."""
        self.num_places += damage.status != 0
        self.num_bytes += damage.num_bytes
        self.reason = damage.reason

    def text(self, num_held: int = 0) -> str:
        """Text such as "12 bytes dropped at 1 place (bad CRC of a packet of 12 bytes), 3 packets lost".

        `num_held` are bytes of packets that are not whole. Empty where nothing was damaged.
        """
        parts = []
        if self.num_bytes:
            places = _number(max(self.num_places, 1), "place")
            parts.append(f"{_number(self.num_bytes, 'byte')} dropped at {places} ({self.reason})")
        if self.num_lost:
            parts.append(f"{_number(self.num_lost, 'packet')} lost")
        if num_held:
            parts.append(f"{_number(num_held, 'byte')} of a packet that is not whole")
        return ", ".join(parts)


def _number(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"
