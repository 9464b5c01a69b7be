"""Paths of recordings with topics of bags."""

from __future__ import annotations

from pathlib import Path, PurePath, PurePosixPath, PureWindowsPath

import pytest

from radarcore.cli.source import path_and_topic


@pytest.mark.parametrize(
    ("source", "expected"),
    [
        (PurePosixPath("take.mcap:/radar"), ("take.mcap", "/radar")),
        (PurePosixPath("/data/take.mcap:/robot/radar"), ("/data/take.mcap", "/robot/radar")),
        (PurePosixPath("/data/take.mcap"), ("/data/take.mcap", "")),
        (PureWindowsPath(r"C:\data\take.mcap:/radar"), ("C:/data/take.mcap", "/radar")),
        (PureWindowsPath("take.mcap:/robot/radar"), ("take.mcap", "/robot/radar")),
        (r"C:\data\take.mcap", (r"C:\data\take.mcap", "")),
        (r"C:\data\take.mcap:/radar", (r"C:\data\take.mcap", "/radar")),
    ],
)
def test_drive_of_windows_is_no_topic_of_a_bag(source: PurePath | str, expected: tuple[str, str]) -> None:
    assert path_and_topic(source) == (Path(expected[0]), expected[1])
