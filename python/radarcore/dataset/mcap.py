"""Samples of datasets as ROS bags."""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from pathlib import Path

from radarcore import check
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.raw_frames import FrameWriter
from radarcore.dataset.export import Samples, made_of, opened_samples
from radarcore.radar.radar import Radar
from radarcore.recording.codes import adc_codes
from radarcore.recording.frame import TRUTH_FIELDS, Frame, Truth


def to_mcap(
    dataset: Samples | str | PathLike[str],
    out: str | PathLike[str],
    *,
    sample: int,
    topic: str = "/radar",
    start_ns: int = 0,
    overwrite: bool = False,
) -> None:
    """Write the frames of a sample as an MCAP file of ROS 2, as recordings in bags are (extra `ros`: rosbags).

    Cube, times and radar, and the truth where it is among the labels: `adapters.ros.BagFrames` gives the frames as
    they were simulated, to the bit. The other labels are not in it.

    Parameters
    ----------
    dataset : Dataset or path
        As of `to_hdf5`.
    out : path
        File to be made, ``.mcap``.
    sample : int
        Its index.
    topic, start_ns
        As of `adapters.ros.FrameWriter`.
    overwrite : bool
        Replace a bag that is there.

    Raises
    ------
    ValueError
        For a sample that failed or is missing.
    ImportError
        When rosbags is missing.

    See Also
    --------
    adapters.ros.BagFrames : Reads it.

    Examples
    --------
    >>> lines = ['radar.preset = "bgt60tr13c"', "run.stop = 0.05", "[[point]]", "position = [2.0, 0.0, 0.0]"]
    >>> np.savetxt("scene.toml", lines, fmt="%s")
    >>> dataset = rc.dataset.make("scene.toml", "out", count=2, seed=1, workers=1, progress=False)
    >>> rc.dataset.to_mcap(dataset, "one.mcap", sample=1)
    >>> with rc.adapters.ros.BagReader("one.mcap") as bag:
    ...     print(len(rc.adapters.ros.BagFrames(bag)))
    2
    """
    samples = opened_samples(dataset)
    index = check.index("sample", sample, len(samples))
    if index not in made_of(samples):
        raise ValueError(f"sample: expected one that was made, got {index}, which failed or is missing")
    path = Path(out)
    if path.suffix != ".mcap":
        raise ValueError(f"out: expected a file .mcap, got {str(out)!r}")
    with BagWriter(path, "mcap", overwrite=overwrite) as bag:
        writer = FrameWriter(bag, samples.radar, source={"sample": index}, topic=topic, start_ns=start_ns)
        for frame in frames_of(samples, index):
            writer.append(frame)
        writer.close()


def frames_of(samples: Samples, index: int) -> Iterator[Frame]:
    """Frames of a sample, with their truth where it is among the labels."""
    radar, arrays = _radar_of(samples, index), samples[index]
    rows = [arrays[f"true_{name}"] for name in TRUTH_FIELDS if f"true_{name}" in arrays]
    has_truth = len(rows) == len(TRUTH_FIELDS)
    names = tuple(map(str, samples.values("body"))) if has_truth else ()
    for number, (cube, time) in enumerate(zip(arrays["cube"], arrays["time"], strict=True)):
        truth = Truth(names, *(row[number] for row in rows)) if has_truth else None
        yield Frame(cube, float(time), radar, truth, raw=adc_codes(cube, radar))


def _radar_of(samples: Samples, index: int) -> Radar:
    """Radar of a sample: the scene may vary it."""
    drawn = getattr(samples, "sample", None)
    if drawn is None:
        return samples.radar
    radar: Radar = drawn(index).simulation().radar
    return radar
