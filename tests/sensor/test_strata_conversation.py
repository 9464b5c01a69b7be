"""Requests of the driver, byte by byte, and answers that come late or not at all."""

import threading
from dataclasses import replace

import pytest

import radarcore as rc
from chip_settings import power_up
from doubles.boards import Numbered, change_answers, opened
from doubles.small_boards import is_soon
from radarcore.sensor import ProtocolError, RequestError, SensorDisconnectedError, SensorTimeoutError
from radarcore.sensor.bgt60.registers import FIFO_RESET, FSM_RESET, FSTAT, MAIN, start_words, write_word
from radarcore.sensor.bgt60.settings import Settings, registers_of
from radarcore.sensor.emulator.pty import Unplugged
from radarcore.sensor.emulator.source import Noise
from radarcore.sensor.emulator.strata import CdcBoard, Controller
from radarcore.sensor.strata import packets
from radarcore.sensor.strata.board import StrataBoard
from radarcore.sensor.strata.packets import Code, Component, DataPacket, Info, Kind, Request
from radarcore.sensor.strata.stream import StreamLink

# Request, value, index : payload, as in "Life cycle, message by message" (Strata).
PROBE = [
    "R 80 0001 0000 :",
    "W 0d 0004 0000 :",  # a board that was left measuring: this is not in the life cycle
    "R 20 0000 0103 :",
    "R 80 0002 0000 :",
    "T 80 0000 0000 :",
    "W 20 0103 0520 :",
    "W 20 0103 0130 : 0d100000",
    "T 20 0103 0130 : 04000000",
]
RESET = "W 20 0103 0130 : 011e827c"
START = [
    RESET,  # a FIFO that has overflown: this is not in the life cycle
    "W 0d 0001 0000 : 100000000000000060000018",
    "W 0d 0003 0000 :",
    # 38 words, the last one MAIN with FRAME_START; gain 33 dB and slices of 6144 samples.
    "W 20 0103 0130 : 030a021009e967fd0b0805b40d102bff0f010d00110000001300000015000000"
    "17000be0190000001b0000001d0000001f000b602113fc51237ff41f25703def2d0004903b00048049000480570004805911be0e"
    "5b62fc0a5d03f0005f787e1e61a2a85063000c886500017267000040690000006b0000006d0000006f393b107f0001008f0001009f000100"
    "ad000000b7000000011e8271",
]
STOP = ["W 0d 0004 0000 :", RESET]
TEMPERATURE = [
    "W 20 0103 0130 : 190000001f000be0110000001300100017000f8009800000011f82710d000000",
    "T 20 0103 0130 : ba000000",
    "W 20 0103 0130 : 17000d80",
    "T 20 0103 0130 : ba000000",
    "W 20 0103 0130 : 0f010f10",
    "T 20 0103 0130 : bc000000",
    "W 20 0103 0520 :",
]


def told(request):
    kind = {Kind.READ: "R", Kind.WRITE: "W", Kind.TRANSFER: "T"}[request.kind]
    text = f"{kind} {request.request:02x} {request.value:04x} {request.index:04x} : {request.payload.hex()}"
    return text.rstrip()


def test_conversation_is_that_of_the_vendors_host(monkeypatch):
    """But for the order of the questions, the resets before a start, and what is not asked at all."""
    heard = []
    change_answers(monkeypatch, lambda request, answer: heard.append(told(request)) or answer)

    def new():
        lines, heard[:] = list(heard), []
        return lines

    with opened(Controller(Numbered(), speed=None), "vendor") as sensor:
        assert new() == PROBE
        waveform = power_up(num_chirps=64, frame_interval=0.0772688463, chirp_interval=0.000591125)
        sensor.configure(waveform, if_gain_db=33)
        assert new() == [], "settings are sent with the start"
        frames = sensor.frames()
        next(frames)
        assert new() == START
        sensor.temperature()
        assert new() == ["T 20 0103 0130 : bc000000"]
        frames.close()
        assert new() == STOP
        sensor._board._temperature = (-1.0, 0.0)
        assert sensor.temperature() == sensor.temperature(), "at most 0.1 s old"
        assert new() == TEMPERATURE
    assert new() == [], "nothing was measured when it was closed"


def test_emulated_board_counts_radars_of_its_type_alone():
    controller = Controller(Noise())
    for index in (0x0101, 0x0102, 0x0103, 0x0104, 0x0105, 0x0201):
        response = controller.handle(Request.read(Code.COMPONENT, Component.COUNT, index, 1))
        assert (response.status, response.payload) == (0, bytes([index == 0x0103]))


def test_overflow_without_data_is_told_once_and_stays_until_the_fifo_is_reset():
    """FSTAT and the status of every SPI answer have it; the next function of registers is refused, once."""
    controller = Controller(Numbered(), speed=1000.0)
    settings = Settings.from_radar(rc.bgt60tr13c(num_samples=64, num_chirps=16, frame_interval=25e-3))
    image = registers_of(settings, 3072)
    controller.chip.execute(start_words(image))
    assert is_soon(lambda: controller.chip.has_overflown)

    def execute(word):
        return controller.handle(Request.transfer(*AT_CHIP, packets.encode_commands([word])))

    burst = Request.transfer(Code.COMPONENT, Component.AVIAN, 0x0410, bytes([1, FSTAT]))
    assert [controller.handle(burst).status for _ in range(2)] == [0x05, 0]
    (answer,) = packets.decode_values(execute(FSTAT << 25).payload)
    assert answer >> 24 & 0x08
    assert answer & 1 << 23
    assert len(controller.packets) == 0, "nobody has asked for data"
    execute(write_word(MAIN, image[MAIN] | FSM_RESET | FIFO_RESET))
    (answer,) = packets.decode_values(execute(FSTAT << 25).payload)
    assert not answer >> 24 & 0x08
    assert answer & 0xFFFFFF == 1 << 20, "empty"
    controller.close()


def test_fill_level_of_the_fifo_is_in_words_of_two_samples():
    """FSTAT counts words of 24 bits, of two codes of 12 bits each."""
    controller = Controller(Numbered())
    # No second frame comes before all levels are read, however busy the machine is.
    settings = Settings.from_radar(rc.bgt60tr13c(num_samples=64, num_chirps=16, frame_interval=10.0))
    controller.chip.execute(start_words(registers_of(settings, 3072)))  # a frame: 3 x 16 x 64 samples
    assert is_soon(lambda: controller.chip.has_samples(1))
    for words in (1536, 1036, 536, 36):
        (answer,) = controller.chip.execute([FSTAT << 25])
        assert answer & 0xFFFFFF == words
        controller.chip.take(1000)
    controller.close()


AT_CHIP = (Code.COMPONENT, Component.AVIAN, 0x0130)
VERSION = Request.read(Code.BOARD_INFO, Info.VERSION, 0, 16)
UUID = Request.read(Code.BOARD_INFO, Info.UUID, 0, 16)


class Delayed:
    """A byte stream to an emulated board whose answers come as late as a test wants, or not at all."""

    name = "delayed"

    def __init__(self):
        self.board = CdcBoard(Controller(Noise()))
        self.delays = []
        self.num_written = 0

    def write(self, data, timeout):
        if self.board._is_gone:
            raise SensorDisconnectedError("the board is gone")
        self.num_written += 1
        delay = self.delays.pop(0) if self.delays else 0.0
        if delay is not None:
            threading.Timer(delay, self.board.receive, [data]).start()

    def read(self, size, timeout):
        try:
            return self.board.send(size, timeout)
        except Unplugged:
            raise SensorDisconnectedError("the board is gone") from None

    def close(self):
        self.board.controller.close()


@pytest.fixture
def link():
    link = StreamLink(Delayed())
    yield link
    link.close()


def test_answer_that_comes_late_is_not_that_of_the_next_request(link, monkeypatch):
    monkeypatch.setattr("radarcore.sensor.strata.stream._LATE", 1.0)  # a busy host may come late, too
    link._stream.delays = [0.8, 0.1]
    with pytest.raises(SensorTimeoutError, match="no answer to request 0x80"):
        link.ask(VERSION, 0.2, retries=0)
    assert link.ask(UUID, 5.0) == link._stream.board.controller.identity.uuid
    # Both tries are answered, the first one late: each answer is discarded, or belongs to its request.
    link._stream.delays = [0.25, 0.12, 0.1]
    assert link.ask(VERSION, 0.2, retries=1) == link._stream.board.controller.identity.version.encode()
    assert link.ask(UUID, 5.0) == link._stream.board.controller.identity.uuid


def test_request_without_an_answer_is_made_three_times(link):
    link._stream.delays = [None, None, 0.0]
    assert len(link.ask(VERSION, 0.1)) == 16
    link._stream.num_written = 0
    link._stream.delays = [None, None, None]
    with pytest.raises(SensorTimeoutError, match=r"delayed: no answer to request 0x80 .* within 0\.2 s"):
        link.ask(VERSION, 0.1)
    assert link._stream.num_written == 3


def test_board_that_answers_nothing_is_asked_once_and_shortly_until_something_comes(link):
    link._stream.delays = [None, None, None, None, 0.0, None, 0.0]
    with pytest.raises(SensorTimeoutError):
        link.ask(VERSION, 0.1)
    with pytest.raises(SensorTimeoutError, match=r"within 0\.3 s"):
        link.ask(VERSION)
    assert link._stream.num_written == 4
    assert len(link.ask(VERSION)) == 16
    assert len(link.ask(VERSION, 0.35)) == 16, "with a retry again"
    assert link._stream.num_written == 7


def test_refusal_is_not_asked_again_but_damage_on_the_way_is(link, monkeypatch):
    with pytest.raises(RequestError, match="the board refuses request 0x80") as caught:
        link.ask(Request.read(Code.BOARD_INFO, 0x77, 0, 4))
    assert caught.value.status == 0x89
    assert link._stream.num_written == 1
    statuses = [0x84, 0x80]
    change_answers(
        monkeypatch, lambda _, answer: packets.Response(Kind.WRITE, statuses.pop(), b"") if statuses else answer
    )
    assert len(link.ask(VERSION)) == 16
    assert link._stream.num_written == 4


def test_answer_is_found_behind_a_packet_that_claims_more_than_comes(link):
    """The parser waits for the rest of a packet whose length is damaged; the next try looks for the answer anew."""
    assert len(link.ask(VERSION)) == 16  # in step
    link._stream.board._out += bytes.fromhex("d3 00 00 00 f0 0f")  # 4080 bytes are to follow
    assert len(link.ask(VERSION, 0.2)) == 16


def test_unplugged_board_is_told_again_and_again():
    stream = Delayed()
    link = StreamLink(stream)
    packet = DataPacket(b"abc", 0)
    stream.board._out += packets.encode_data(packet)
    stream.board._is_gone = True  # earlier data still comes
    assert link.packets(10.0) == [packet]
    for _ in range(2):
        with pytest.raises(SensorDisconnectedError, match="the board is gone"):
            link.packets(5.0)
        with pytest.raises(SensorDisconnectedError, match="the board is gone"):
            link.ask(VERSION)
    link.discard()
    link.close()


def is_register(request):
    return request.kind == Kind.TRANSFER and request.index == AT_CHIP[2]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (lambda request, answer: packets.Response(Kind.READ, 0, b"short"), "expected 16 bytes as answer"),
        (lambda request, answer: packets.Response(Kind.WRITE, 0, b""), "expected an answer of kind 0xC0, got 0x40"),
        (
            lambda request, answer: replace(answer, payload=answer.payload * (2 if is_register(request) else 1)),
            "expected 1 registers, got 2",
        ),
        (
            lambda request, answer: replace(answer, payload=answer.payload[:3]) if is_register(request) else answer,
            "^delayed: Strata values: expected a multiple of 4 bytes, got 3",
        ),
    ],
)
def test_answers_of_another_length_or_kind_are_no_answers(changes, message, monkeypatch, link):
    with monkeypatch.context() as patch:
        change_answers(patch, changes)
        with pytest.raises(ProtocolError, match=message):
            StrataBoard(link)


def test_function_that_only_tells_of_an_overflow_is_asked_again(link, monkeypatch):
    """Also with firmware that reports it for EXECUTE."""
    board, left = StrataBoard(link), [1]

    def complaining(request, answer):
        return packets.Response(request.kind, 0x05) if request.index == AT_CHIP[2] and left and left.pop() else answer

    change_answers(monkeypatch, complaining)
    assert board.temperature() == pytest.approx(25.0, abs=0.3)
