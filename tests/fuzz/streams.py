"""Inputs of sensors: packets of Strata and ComLib, and captures of whole conversations."""

from __future__ import annotations

import json
import tempfile
from contextlib import closing, suppress
from functools import cache
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

from doubles.boards import Numbered
from doubles.comlib_boards import ComLibDouble, Pipe
from doubles.comlib_boards import radar as comlib_radar
from fuzz.cases import Case, damaged, damaged_tree, json_bytes
from radarcore.radar.bgt60_presets import bgt60tr13c
from radarcore.sensor.comlib import messages as comlib
from radarcore.sensor.comlib.board import ComLibBoard
from radarcore.sensor.emulator.strata import CdcBoard, Controller, slice_size_of
from radarcore.sensor.errors import ProtocolError, RequestError
from radarcore.sensor.interface import Board, Damage
from radarcore.sensor.strata import packets
from radarcore.sensor.strata import stream as strata_stream
from radarcore.sensor.strata.board import StrataBoard
from radarcore.sensor.strata.packets import DataPacket
from radarcore.sensor.strata.slices import SliceAssembler
from radarcore.sensor.transport.capture import Capture, Replay

# Parsers: whatever comes, they say what they discard.


def _pieces(data: bytes) -> list[bytes]:
    """Data in pieces of sizes that depend on it alone."""
    random = Random(len(data))
    pieces = []
    while data:
        size = random.choice((1, 3, 64, 512, 5000))
        pieces.append(data[:size])
        data = data[size:]
    return pieces


def make_stream(random: Random) -> Case:
    """Packets of a board, some lost, doubled, exchanged, cut or damaged."""
    answers = [bytes.fromhex(line["bytes"]) for line in _lines(random) if line.get("direction") == "read"]
    first = random.randrange(len(answers))
    sent = answers[first : first + random.randint(1, 12)]
    for _ in range(random.choice((0, 1, 2, 5))):
        at, other = random.randrange(len(sent)), random.randrange(len(sent))
        match random.randrange(6):
            case 0:
                del sent[at]
            case 1:
                sent.insert(other, sent[at])
            case 2:
                sent[at], sent[other] = sent[other], sent[at]
            case 3:
                sent[at] = damaged(sent[at], random, sent)
            case 4:
                sent[at] = _resealed(damaged(sent[at], random, sent), random)
            case _:
                sent.insert(at, random.randbytes(random.choice((1, 2, 8, 100))))
        sent = sent or [b""]
    return {"stream.bin": b"".join(sent)}


def stream_seeds() -> list[Case]:
    return [make_stream(Random(seed)) for seed in range(10)]


def read_stream(folder: Path) -> None:
    """Both protocols read the bytes, and all that decode a payload."""
    data = (folder / "stream.bin").read_bytes()
    assembler = SliceAssembler(3000)
    payloads = [data]
    for parser in (strata_stream.HostParser(), strata_stream.BoardParser()):
        num_bytes = 0
        for piece in _pieces(data):
            found = parser.feed(piece)
            assert parser.num_held == len(parser._buffer) <= parser._largest
            for item in found:
                num_bytes += item.num_bytes if isinstance(item, Damage) else len(item.payload)
                if isinstance(item, DataPacket):
                    assert all(len(getattr(part, "data", b"")) <= 3000 for part in assembler.feed(item))
                elif not isinstance(item, Damage):
                    payloads.append(item.payload)
        assert num_bytes <= len(data)
    comlib_parser = comlib.Parser()
    for number, piece in enumerate(_pieces(data)):
        messages = [item for item in comlib_parser.feed(piece) if isinstance(item, comlib.Message)]
        payloads += [message.payload for message in messages]
        assert len(comlib_parser._buffer) <= 65541
        if number % 3 == 2:  # a silence
            comlib_parser.reset()
    comlib_parser.reset()
    assert comlib_parser.feed(comlib.Message(1, b"\x22").encode()) == [comlib.Message(1, b"\x22")]
    for payload in payloads:
        for decode in DECODERS:
            with suppress(ProtocolError, RequestError):
                decode(payload)


DECODERS: Any = (
    *(packets.decode_data, packets.Version.decode, packets.decode_board_info, packets.decode_text, packets.uuid_text),
    *(packets.decode_values, packets.decode_commands, slice_size_of),
    lambda payload: [endpoint.letters for endpoint in comlib.decode_endpoints(payload)],
    *(comlib.Firmware.decode, comlib.Info.decode, comlib.Format.decode, comlib.FmcwSettings.decode),
    *(comlib.AdcSettings.decode, comlib.Temperature.decode, comlib.decode_number),
    comlib.Frame.decode,
)


# Captures: the driver in conversation with a file.

QUICK = 0.005
"""Time-out of an answer [s]: a file has it at once, or never."""


class _QuickLink(strata_stream.StreamLink):
    """A link that asks once."""

    def ask(self, request: packets.Request, timeout: float = QUICK, *, retries: int = 0) -> bytes:
        del timeout, retries
        return super().ask(request, QUICK, retries=0)


def _talk(board: Board, radar: Any) -> None:
    """Measure a few frames."""
    with closing(board):
        with suppress(ValueError):  # a damaged answer may say that the radar is beyond the board's limits
            board.configure(radar)
        board.start()
        for _ in range(3):
            board.read(QUICK)
        board.stop()
        board.details()


STRATA_RADAR = bgt60tr13c(num_samples=16, num_chirps=2, chirp_interval=5e-4, frame_interval=0.02)
COMLIB_RADAR = comlib_radar(2, num_samples=16, num_chirps=2)


@cache
def capture_seeds() -> list[Case]:
    """Conversations with emulated boards."""
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "capture.jsonl"
        controller = Controller(Numbered(), speed=None)
        with patch.object(strata_stream, "_LATE", QUICK):
            _talk(StrataBoard(strata_stream.StreamLink(Capture(Pipe(CdcBoard(controller)), path))), STRATA_RADAR)
        controller.close()
        strata = path.read_bytes()
        _talk(ComLibBoard(Capture(Pipe(ComLibDouble()), path), timeout=0.1, board_timeout=0.2), COMLIB_RADAR)
        both = [b"\n".join(data.splitlines()[:300]) + b"\n" for data in (strata, path.read_bytes())]
    return [{"capture.jsonl": data} for data in both]


def _lines(random: Random) -> list[dict[str, Any]]:
    return [json.loads(line) for line in random.choice(capture_seeds())["capture.jsonl"].splitlines()]


def make_capture(random: Random) -> Case:
    """A conversation with damaged answers, or with lines that are damaged, lost or doubled."""
    lines = _lines(random)
    answers = [line for line in lines if line.get("direction") == "read"]
    for line in random.sample(answers, random.choice((0, 1, 1, 3))):
        data = bytes.fromhex(line["bytes"])
        line["bytes"] = _resealed(damaged(data, random, [data]), random).hex()
    for at in random.sample(range(len(lines)), random.choice((0, 0, 1, 2))):
        lines[at] = random.choice(({}, damaged_tree(lines[at], random), random.choice(lines)))
    return {"capture.jsonl": b"".join(json_bytes(line) + b"\n" for line in lines)}


def _resealed(data: bytes, random: Random) -> bytes:
    """A damaged answer of Strata or ComLib, often with the length and the end that it should have."""
    first = data[:1]
    header = 4 if first in (b"\x40", b"\x43", b"\xc0") else 6 if first >= b"\xd0" else len(data)
    if header + 2 < len(data) <= packets.MAX_PACKET and random.random() < 0.8:
        body = data[: header - 2] + (len(data) - header - 2).to_bytes(2, "little") + data[header:-2]
        return body + packets.crc(body).to_bytes(2, "big")
    return data


class _AnyWrite(Replay):
    """Every write stands for the next recorded one."""

    def write(self, data: bytes, timeout: float) -> None:
        del data, timeout
        if self._events:
            self._events.popleft()
            self._advance()


def read_capture(folder: Path) -> None:
    path = folder / "capture.jsonl"
    is_comlib = b"5a00" in path.read_bytes()[:500]
    with closing(_AnyWrite(path)) as stream, patch.object(strata_stream, "_LATE", QUICK):
        if is_comlib:
            _talk(ComLibBoard(stream, timeout=QUICK, board_timeout=0.0), COMLIB_RADAR)
        else:
            with closing(_QuickLink(stream)) as link:
                _talk(StrataBoard(link), STRATA_RADAR)
