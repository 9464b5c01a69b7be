"""Samples of datasets as ROS bags."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from radarcore import check
from radarcore.adapters.ros.bag_writer import BagWriter
from radarcore.adapters.ros.frames import FrameWriter
from radarcore.dataset.export import made_of, opened_samples, refuse_dataset
from radarcore.dataset.samples import Samples
from radarcore.dataset.stored import frames_of


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
    refuse_dataset(samples, path)
    with BagWriter(path, "mcap", overwrite=overwrite) as bag:
        writer = FrameWriter(bag, samples.radar, source={"sample": index}, topic=topic, start_ns=start_ns)
        arrays = samples[index]
        for frame in frames_of(samples, index, arrays, range(len(arrays["time"]))):
            writer.append(frame)
        writer.close()
