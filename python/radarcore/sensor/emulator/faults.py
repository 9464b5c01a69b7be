"""Faults of a link and a board, on demand or at random, and counts of them."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, fields

import numpy as np

from radarcore import check


@dataclass
class Faults:
    """Probability of every fault per packet to the host; zero: never.

    Parameters
    ----------
    bad_crc : float
        A bit of the packet is turned.
    lost : float
        The packet is not sent.
    cut : float
        The packet ends early.
    duplicated : float
        The packet is sent twice.
    lost_counter : float
        The counter of data packets jumps although nothing is lost.
    rubbish : float
        Bytes of no packet come before it.
    overflow : float
        The FIFO overflows: measuring ends with an error packet.
    stall : float
        Nothing is sent for `stall_time`.
    stall_time : float
        [s]
    unplug : float
        The board is gone in the middle of the packet.
    has_any_transfers : bool
        Packets are cut and joined to transfers of any size.
    seed : int
    """

    bad_crc: float = 0.0
    lost: float = 0.0
    cut: float = 0.0
    duplicated: float = 0.0
    lost_counter: float = 0.0
    rubbish: float = 0.0
    overflow: float = 0.0
    stall: float = 0.0
    stall_time: float = 0.05
    unplug: float = 0.0
    has_any_transfers: bool = False
    seed: int = 0
    done: Counter[str] = field(default_factory=Counter, init=False)

    def __post_init__(self) -> None:
        for entry in fields(self):
            if entry.type == "float" and entry.name != "stall_time":
                value = check.number(entry.name, getattr(self, entry.name))
                if not 0.0 <= value <= 1.0:
                    raise ValueError(f"{entry.name}: expected a probability from 0 to 1, got {value:g}")
        self.stall_time = check.non_negative("stall_time", self.stall_time, "s")
        self._rng = np.random.default_rng(check.count("seed", self.seed, 0))

    def happens(self, name: str) -> bool:
        """Draw a fault: true when it happens, which is counted in `done`."""
        probability = getattr(self, name)
        if probability == 0.0 or self._rng.random() >= probability:
            return False
        self.done[name] += 1
        return True

    def jump(self) -> int:
        """Jump of a counter: at least 1."""
        return int(self._rng.integers(1, 1000)) if self.happens("lost_counter") else 0

    def damage(self, packet: bytes) -> bytes:
        """The bytes that are sent for a packet."""
        sent = bytearray(packet)
        if self.happens("lost"):
            sent.clear()
        if sent and self.happens("bad_crc"):
            bit = int(self._rng.integers(8 * len(sent)))
            sent[bit // 8] ^= 1 << bit % 8
        if sent and self.happens("cut"):
            del sent[int(self._rng.integers(len(sent))) :]
        if self.happens("duplicated"):
            sent *= 2
        if self.happens("rubbish"):
            sent[:0] = self._rng.bytes(int(self._rng.integers(1, 200)))
        return bytes(sent)

    def transfer_size(self, size: int) -> int:
        """Largest size of the next transfer [bytes]."""
        return int(self._rng.integers(1, size + 1)) if self.has_any_transfers else size

    def part(self, packet: bytes) -> bytes:
        """Part of a packet that arrives when the board is unplugged in the middle of it."""
        return packet[: int(self._rng.integers(len(packet)))]
