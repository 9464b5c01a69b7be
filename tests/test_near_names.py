"""Names that are spelled wrong: of choices and of attributes of packages."""

from __future__ import annotations

import subprocess
import sys

import pytest

import radarcore as rc


def test_choice_names_the_near_one_where_there_is_one() -> None:
    with pytest.raises(ValueError, match=r"sampling: expected .* got 'adaptiv'; did you mean 'adaptive'\?"):
        rc.Simulator(rc.Scene(), rc.bgt60tr13c(), sampling="adaptiv")
    with pytest.raises(ValueError, match=r"sampling: expected one of .*, got 'zzz'$"):
        rc.Simulator(rc.Scene(), rc.bgt60tr13c(), sampling="zzz")


@pytest.mark.parametrize(
    ("wrong", "meant"),
    [
        ("radarcore.Simulater", "Simulator"),
        ("radarcore.adapters.mujoko", "mujoco"),
        ("radarcore.plot.spectogram", "spectrogram"),
        ("radarcore.shapes.spher", "sphere"),
    ],
)
def test_interpreter_suggests_the_near_attribute(wrong: str, meant: str) -> None:
    """It does as it prints the error: in a process of its own."""
    result = subprocess.run([sys.executable, "-c", f"import radarcore\n{wrong}"], capture_output=True, text=True)
    assert result.returncode == 1
    assert result.stderr.rstrip().endswith(f"has no attribute '{wrong.split('.')[-1]}'. Did you mean: '{meant}'?")
