"""Windows, against SciPy's."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from scipy.signal import get_window

from radarcore.processing.spectra.windows import symmetric_window, window_weights


@pytest.mark.parametrize("window", ["boxcar", "hann", "hamming", "blackman", "blackmanharris"])
def test_named_windows_are_scipys_to_the_last_bit(window: str) -> None:
    for length in (1, 2, 3, 8, 31, 64, 127, 128, 1000):
        np.testing.assert_array_equal(window_weights("window", window, length), get_window(window, length))
        symmetric = get_window(window, length, fftbins=False)
        np.testing.assert_array_equal(symmetric_window("window", window, length), symmetric)


def test_the_first_map_does_not_wait_for_scipy() -> None:
    code = (
        "import sys, numpy as np, radarcore as rc\n"
        "frame = rc.Frame(np.zeros((3, 16, 128)), 0.0, rc.bgt60tr13c(num_chirps=16))\n"
        "rc.range_doppler(frame), rc.strongest_peak(frame)\n"
        "assert 'scipy.signal' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
