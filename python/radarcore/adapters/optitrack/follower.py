"""Live motion capture in the background."""

from __future__ import annotations

import threading
from collections.abc import Iterator

from radarcore.adapters.optitrack.capture import MotionCapture
from radarcore.adapters.optitrack.live_frames import CapturedFrame, capture_of, one_take, without_poses

_POLL = 0.005
"""Time after which a wait for frames looks again [s]."""


class Follower:
    """Frames that a client receives in the background."""

    def __init__(self, frames: Iterator[CapturedFrame], axes: str, *, keep: bool) -> None:
        self._frames, self._axes, self._keep = frames, axes, keep
        self._kept: list[CapturedFrame] = []
        self._newest: CapturedFrame | None = None
        self._count = 0
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._run, name="motion capture", daemon=True)
        self._thread.start()

    def __len__(self) -> int:
        """Number of frames that have come."""
        return self._count

    @property
    def newest(self) -> CapturedFrame | None:
        """The newest frame, or None before the first."""
        return self._newest

    def capture(self) -> MotionCapture:
        """All frames so far, up to the end of the take; an error of the stream is raised."""
        self.check()
        if not self._keep:
            raise ValueError("capture: expected frames that are kept, got the newest alone; give follow(keep=True)")
        return capture_of(list(self._kept), self._axes)

    def check(self) -> None:
        """Raise the error of the stream, if there was one."""
        if self._error is not None:
            raise self._error

    def wait(self, num_frames: int) -> None:
        """Wait until some frames have come; an error of the stream is raised."""
        while self._count < num_frames and self._thread.is_alive():
            self._thread.join(_POLL)
        self.check()

    def join(self) -> None:
        """Wait for the end."""
        self._thread.join()

    def _run(self) -> None:
        try:
            for frame in one_take(self._frames) if self._keep else self._frames:
                if self._keep:
                    self._kept.append(without_poses(frame))  # others read it meanwhile
                self._newest = frame
                self._count += 1
        except Exception as error:  # raised where the user sees it
            self._error = error
