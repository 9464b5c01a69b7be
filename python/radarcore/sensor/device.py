"""Sensor: configure a board, and receive frames like simulated ones."""

from __future__ import annotations

import queue
import threading
import weakref
from _thread import start_new_thread
from collections import deque
from collections.abc import Callable, Collection, Generator, Iterator
from contextlib import closing, suppress
from dataclasses import replace
from datetime import datetime
from functools import partial
from os import PathLike
from time import monotonic
from types import TracebackType
from typing import Any

from radarcore import check, notice
from radarcore.radar.radar import Radar
from radarcore.recording.frame import FULL_SCALE, Frame, frame_of, to_samples
from radarcore.recording.native import RecordingWriter
from radarcore.recording.recording import Recording
from radarcore.sensor.checks import Check
from radarcore.sensor.errors import FramesLostWarning, SensorError, SensorTimeoutError
from radarcore.sensor.interface import Board, BoardInfo, RawFrame
from radarcore.sensor.selftest import GROUPS, run_checks

_POLL = 0.02
"""Frames are waited for so long at once [s]; so long the thread may take that is asked to end."""
_SILENCE = 2.0
"""A frame that is so much later than its time does not come [s]: boards wake up in less than 2 ms."""


class Sensor:
    """Radar board that measures; made by `open_sensor`.

    Use it as a context manager. Frames are as in the simulator: ``(channel, chirp, sample)`` float32 between -1 and
    1 of full scale, the codes of the ADC in `Frame.raw`. Their times count from the start of the first one: by the
    board's time stamps where it has some, else by the frame interval it has achieved.

    `Frame.stats` has ``index`` (of the frame, lost ones counted), ``lost_before`` (frames lost just before it),
    ``lost_reason``, ``host_time`` (arrival, seconds since 1970) and ``device_time`` (the board's own clock [s], where
    it has one).

    Attributes
    ----------
    info : BoardInfo
        Port, name, chip, firmware and serial number.
    radar : Radar or None
        Achieved settings of the board; None before `configure`.
    num_lost : int
        Frames lost since the last start.

    See Also
    --------
    open_sensor : Makes one.
    plot.view : Shows its frames.

    Examples
    --------
    >>> radar = sensor.configure(rc.bgt60tr13c(num_chirps=16))
    >>> for frame in sensor.frames(2):
    ...     print(frame.cube.shape, frame.cube.dtype)
    (3, 16, 128) float32
    (3, 16, 128) float32
    """

    def __init__(self, board: Board, *, queue_size: int = 64) -> None:
        self._board = board
        self._queue_size = check.count("queue_size", queue_size)
        self.info: BoardInfo = board.info
        self.radar: Radar | None = None
        self.num_lost: int = 0
        self._is_open = True
        self._closing = threading.RLock()
        self._board_lock = _BoardLock()
        self._reader: _Reader | None = None
        # A forgotten sensor gives its port back too, at the latest when the program ends.
        self._forgotten = weakref.finalize(self, _close_forgotten, board, self._board_lock)

    def __repr__(self) -> str:
        return f"<Sensor {self.info.chip} on {self.info.port}, firmware {self.info.firmware}>"

    def __enter__(self) -> Sensor:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def configure(self, radar: Radar, **options: Any) -> Radar:
        """Set the board to a radar; ends what is being measured, as `stop` does.

        Parameters
        ----------
        radar : Radar
            Wanted waveform and receivers; a board sets power and gains by `options`. Phases of the receivers
            (`Receiver.rx_phase_deg`) and weights of the channels are kept, so that angles are right.
        **options
            Options of a BGT60TR13C: ``tx_power_level`` (0 to 31), ``if_gain_db`` (18 to 60), ``highpass_cutoff`` [Hz],
            ``is_transmitting`` (False: the transmitter is off), ``has_test_pattern`` (in place of RX1's samples).

        Returns
        -------
        radar : Radar
            Achieved radar: times and frequencies in the steps of the board. Frames have this radar.

        Raises
        ------
        ValueError
            For a radar beyond the board's limits, with the nearest possible value.

        See Also
        --------
        bgt60tr13c : Radars that these boards can be.
        sensor.Sensor.frames : Measure.

        Examples
        --------
        >>> radar = sensor.configure(rc.bgt60tr13c(frame_interval=0.0501234567), if_gain_db=40)
        >>> print(f"{radar.waveform.frame_interval:.9f} s")
        0.050121813 s
        """
        self._check_open()
        check.instance("radar", radar, Radar)
        for name, value in options.items():
            if name not in self._board.options:
                known = " or ".join(self._board.options)
                raise TypeError(f"{name}: expected an option of {self.info.chip} ({known}), got {value!r}")
        self.stop()
        with self._board_lock.waiting, self._board_lock.used:
            self.radar = _with_phases(self._board.configure(radar, **options), radar)
        return self.radar

    def frames(self, num_frames: int | None = None, *, timeout: float | None = None) -> Generator[Frame, None, None]:
        """Measure, and yield frames as they come; measuring ends with the iteration.

        Parameters
        ----------
        num_frames : int, optional
            Number of frames; default: no end.
        timeout : float, optional
            Longest time without a frame [s]; default: one frame interval and 2 s. A virtual board that takes longer to
            simulate a frame needs more.

        Raises
        ------
        SensorTimeoutError
            When no frame comes in time; the message has the damage that came in their place.
        SensorDisconnectedError
            When the board is unplugged; open it again when it is back.

        See Also
        --------
        sensor.Sensor.record : Measure into a file.
        detect : Detections of a frame.
        plot.view : Shows frames as they come.

        Examples
        --------
        >>> radar = sensor.configure(rc.bgt60tr13c(num_chirps=16))
        >>> print([frame.stats["index"] for frame in sensor.frames(3)])
        [0, 1, 2]
        """
        self._configured("frames")
        wanted = None if num_frames is None else check.count("num_frames", num_frames, 0)
        return self._frames(wanted, None if timeout is None else check.positive("timeout", timeout, "s"))

    def _frames(self, wanted: int | None, timeout: float | None) -> Generator[Frame, None, None]:
        # Here begins the first frame, long after `frames` perhaps.
        radar = self._configured("frames")
        self._end("measuring was begun anew")
        self.num_lost = 0
        times = _FrameTimes(radar.waveform.frame_interval)
        if timeout is None:
            timeout = radar.waveform.frame_interval + _SILENCE
        num_given, last_index = 0, -1
        reader: _Reader | None = None
        try:
            with self._board_lock.waiting, self._board_lock.used:
                self._board.start()
            reader = self._reader = _Reader(self._board, self._board_lock, self._queue_size)
            reader.start()
            self._check_open()  # another thread may have closed it meanwhile
            while wanted is None or num_given < wanted:
                raw = reader.take(timeout)
                if raw is None:
                    break
                lost, last_index = raw.index - last_index - 1, raw.index
                stats: dict[str, Any] = {"index": raw.index, "lost_before": lost, "host_time": raw.host_time}
                if lost > 0:
                    stats["lost_reason"] = ", ".join(raw.lost_reasons)
                    is_first_loss = self.num_lost == 0
                    self.num_lost += lost
                    if is_first_loss:
                        notice.warn(f"{self.info.port}: {lost} lost: {stats['lost_reason']}", FramesLostWarning)
                if raw.device_time is not None:
                    stats["device_time"] = raw.device_time
                yield frame_of(to_samples(raw.codes), times.of(raw), radar, stats=stats, raw=raw.codes)
                num_given += 1
        except BaseException as error:
            if self._reader is reader:
                with suppress(SensorError):  # report the first error
                    self._end(finish=partial(self._board.stop, is_silent=isinstance(error, SensorTimeoutError)))
            raise
        if self._reader is reader:
            self._end()

    def stop(self) -> None:
        """End measuring, and iterations over frames with it; does nothing where nothing is measured.

        See Also
        --------
        sensor.Sensor.close : Give the port back as well.

        Examples
        --------
        >>> radar = sensor.configure(rc.bgt60tr13c(num_chirps=16))
        >>> for frame in sensor.frames():
        ...     sensor.stop()
        >>> print(frame.stats["index"])
        0
        """
        self._end()

    def _end(self, reason: str = "", finish: Callable[[], None] | None = None) -> None:
        """End measuring by `finish`, or else a stop; with a reason, iterations that still ask for frames raise it."""
        reader, self._reader = self._reader, None
        if reader is not None:  # known to be over before Ctrl-C can come, which it does at calls
            reader.reason, reader.is_over = reason, True
        try:
            if reader is not None:
                reader.close()
        finally:
            with self._board_lock.waiting, self._board_lock.used:
                (finish or self._board.stop)()

    def record(
        self,
        path: str | PathLike[str],
        *,
        duration: float | None = None,
        num_frames: int | None = None,
        progress: bool = True,
        overwrite: bool = False,
    ) -> Recording:
        """Measure into a recording's directory, frame by frame; it is readable at any moment.

        Parameters
        ----------
        path : path
            A new directory.
        duration : float, optional
            Duration [s]; default, without `num_frames`: until Ctrl-C.
        num_frames : int, optional
            Number of frames.
        progress : bool
            Show a progress bar when run in a terminal.
        overwrite : bool
            Replace a recording at `path`.

        Returns
        -------
        recording : Recording
            Read from `path`. After Ctrl-C (KeyboardInterrupt is raised on) what was written is there to be loaded.

        See Also
        --------
        sensor.Sensor.frames : One frame at a time.
        Recording.load : Read it again.

        Examples
        --------
        >>> radar = sensor.configure(rc.bgt60tr13c(num_chirps=16))
        >>> print(sensor.record("measured", num_frames=3).cube.shape)
        (3, 3, 16, 128)
        """
        radar = self._configured("record")
        if duration is not None and num_frames is not None:
            raise ValueError("duration: expected either duration or num_frames, got both")
        if duration is not None:
            seconds = check.positive("duration", duration, "s")
            num_frames = max(1, round(seconds / radar.waveform.frame_interval))
        if num_frames is not None:
            num_frames = check.count("num_frames", num_frames)
        frames = self.frames(num_frames)
        bar = notice.progress(frames, "recording", "frame", total=num_frames, shown=progress)
        with (
            RecordingWriter(path, radar, num_frames=num_frames, source=self.source(), overwrite=overwrite) as writer,
            closing(frames),  # measuring ends here, also where writing fails
            bar,
        ):
            for frame in bar:
                writer.append(frame)
        return Recording.load(path)

    def source(self) -> dict[str, Any]:
        """Origin of frames that are measured from now on, for `Recording.source`.

        Raises
        ------
        SensorError
            Before `configure`.

        See Also
        --------
        Recording : Has it as `source`.

        Examples
        --------
        >>> radar = sensor.configure(rc.bgt60tr13c(num_chirps=16))
        >>> print(sensor.source()["cube_unit"])
        full scale
        """
        self._configured("source")
        now = datetime.now().astimezone()
        details = self._board.details()
        if "infineon" in details:  # in the words of that format
            details["infineon"]["date_captured"] = now.strftime("%Y-%m-%dT%H:%M:%S%z")
        date = now.isoformat(timespec="seconds")
        return {"sensor": dict(vars(self.info)), "date": date, "cube_unit": FULL_SCALE, **details}

    def temperature(self) -> float:
        """Temperature of the chip [degrees Celsius].

        See Also
        --------
        sensor.Sensor.selftest : Checks of the board.

        Examples
        --------
        >>> print(20.0 < sensor.temperature() < 60.0)
        True
        """
        self._check_open()
        with self._board_lock.waiting, self._board_lock.used:
            return self._board.temperature()

    def selftest(self, groups: Collection[str] = GROUPS, *, duration: float = 2.5) -> Iterator[Check]:
        """Check the board, one thing after the other; ends what is being measured.

        Parameters
        ----------
        groups : collection of str
            Some of ``"identity"``, ``"registers"``, ``"pattern"``, ``"noise"`` and ``"frames"``.
        duration : float
            Length of the measurement whose frame rate is checked [s].

        Returns
        -------
        checks : iterator of Check
            Name, result (``"PASS"``, ``"FAIL"``, ``"SKIP"``), measured and expected values; each is yielded when it is
            done. The board needs `configure` afterwards.

        See Also
        --------
        sensor.Check : The results, one by one.

        Examples
        --------
        >>> print({check.name: check.result for check in sensor.selftest(["identity"])}["chip id"])
        PASS
        """
        self._check_open()
        if isinstance(groups, str):
            groups = (groups,)
        for group in groups:
            check.choice("groups", group, GROUPS)
        seconds = check.positive("duration", duration, "s")
        self.stop()
        self.radar = None
        return self._checks(run_checks(self._board, groups, duration=seconds))

    def _checks(self, checks: Iterator[Check]) -> Iterator[Check]:
        """Checks, each with the board for itself: meanwhile other threads wait."""
        is_done = False
        while not is_done:
            with self._board_lock.waiting, self._board_lock.used:
                self._check_open()
                found = next(checks, None)
            is_done = found is None
            if found is not None:
                yield found

    def close(self) -> None:
        """End measuring and give the port back; may be called twice.

        See Also
        --------
        open_sensor : In a ``with`` block this happens by itself.

        Examples
        --------
        >>> sensor.close()
        >>> print(sensor.info.chip, "is free for others")
        BGT60TR13C is free for others
        """
        with self._closing:  # a concurrent close waits, so the port is free afterwards
            if not self._is_open:
                return
            self._is_open = False
            self._end("the sensor was closed", self._board.close)
            self._forgotten.detach()

    def _configured(self, method: str) -> Radar:
        """The radar; an error where there is none, or no board any more."""
        self._check_open()
        if self.radar is None:
            raise SensorError(f"{self.info.port}: expected configure(radar) before {method}")
        return self.radar

    def _check_open(self) -> None:
        if not self._is_open:
            raise SensorError(f"{self.info.port}: expected an open sensor, got one that is closed")


class _BoardLock:
    """Locks of a board, which one thread uses at a time: `waiting`, then `used`.

    The thread that takes frames holds `used` nearly all the time. It lets go first who holds `waiting`.
    """

    def __init__(self) -> None:
        self.waiting = threading.Lock()
        self.used = threading.Lock()


def _close_forgotten(board: Board, lock: _BoardLock) -> None:
    """Close the board of a sensor without references."""

    def close() -> None:
        with lock.waiting, lock.used:
            board.close()

    if threading.current_thread() is threading.main_thread():
        close()
    else:
        # The collector may run in a thread of the board itself, which cannot wait for its own end.
        threading.Thread(target=close, name="radarcore-close").start()


class _FrameTimes:
    """Times of frames [s] from the start of the first one on: they always grow.

    By the board's clock where it has one. Where that goes back (it has wrapped, or begins anew with every start), and
    without it, by the frame interval.
    """

    def __init__(self, interval: float) -> None:
        self._interval = interval
        self._origin: float | None = None
        self._last: tuple[int, float] | None = None

    def of(self, raw: RawFrame) -> float:
        """Time of the next frame."""
        last_index, last_time = self._last or (0, 0.0)
        time = last_time + (raw.index - last_index) * self._interval
        if raw.device_time is not None:
            by_clock = time if self._origin is None else raw.device_time - self._origin
            if self._last is None or by_clock > last_time:
                time = by_clock
            self._origin = raw.device_time - time
        self._last = (raw.index, time)
        return time


class _Reader:
    """Takes frames from the board in a thread of its own, so that a slow consumer loses whole frames and no bytes."""

    def __init__(self, board: Board, board_lock: _BoardLock, size: int) -> None:
        self._board = board
        self._board_lock = board_lock
        self._size = size
        # Lock, queues and thread are implemented in C: in Python ones Ctrl-C may be lost, or leave them locked.
        self._lock = threading.Lock()
        self._news: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._over: queue.SimpleQueue[None] = queue.SimpleQueue()
        self._frames: deque[RawFrame] = deque()
        self._failure: Exception | None = None
        self._is_running = False
        self.is_over = False
        """Set to end the thread; pending frames are discarded."""
        self.reason = ""
        """Message for waiting readers; empty for none."""

    def start(self) -> None:
        """Begin to take frames, once a caller can end it."""
        start_new_thread(self._read, ())

    def take(self, timeout: float) -> RawFrame | None:
        """The next frame; None if measuring was ended."""
        deadline = monotonic() + timeout
        while True:
            with self._lock:
                if self.is_over:
                    if self.reason:
                        raise SensorError(f"{self._board.info.port}: no more frames, {self.reason}")
                    return None
                if self._frames:
                    return self._frames.popleft()
                if self._failure is not None:
                    raise self._failure
                remaining = deadline - monotonic()
                if remaining <= 0.0:
                    because = self._board.damage()
                    text = f"no frame within {timeout:.3g} s{'; ' if because else ''}{because}"
                    raise SensorTimeoutError(f"{self._board.info.port}: {text}")
            with suppress(queue.Empty):
                self._news.get(timeout=remaining)

    def close(self) -> None:
        """Wait for the end of the thread, which `is_over` asks for."""
        self._tell()
        while self._is_running:
            with suppress(queue.Empty):
                self._over.get(timeout=_POLL)

    def _tell(self) -> None:
        """Wake readers that wait for news, unless news wait already."""
        if self._news.empty():
            self._news.put(None)

    def _read(self) -> None:
        with self._lock:
            if self.is_over:  # before it began
                return
            self._is_running = True
        try:
            while not self.is_over:
                with self._board_lock.waiting:
                    pass
                with self._board_lock.used:
                    frames = self._board.read(_POLL)
                for frame in frames:
                    with self._lock:
                        self._put(frame)
                    self._tell()
        except Exception as error:  # for readers of frames
            with self._lock:
                self._failure = error
        finally:
            self._is_running = False
            self._over.put(None)
            self._tell()

    def _put(self, frame: RawFrame) -> None:
        self._frames.append(frame)
        if len(self._frames) > self._size:
            dropped = self._frames.popleft()
            oldest = self._frames[0]
            reasons = (*dropped.lost_reasons, "frames were not taken in time", *oldest.lost_reasons)
            self._frames[0] = replace(oldest, lost_reasons=tuple(dict.fromkeys(reasons)))


def _with_phases(radar: Radar, wanted: Radar) -> Radar:
    """The radar of a board with the phases of receivers and weights of channels that are known."""
    if wanted.channel_weights is not None:
        radar = replace(radar, channel_weights=wanted.channel_weights)
    known = wanted.receiver
    if known is None or known.rx_phase_deg is None or radar.receiver is None:
        return radar
    return replace(radar, receiver=replace(radar.receiver, rx_phase_deg=known.rx_phase_deg))
