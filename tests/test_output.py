"""What is written never deletes or replaces anything else: one table of everything that writes."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from radarcore import output


def test_lock_ends_with_its_process(tmp_path: Path) -> None:
    program = (
        "import sys, time; from pathlib import Path; from radarcore.output import Lock\n"
        "lock = Lock(Path(sys.argv[1])); print('mine', flush=True); time.sleep(60)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-c", program, tmp_path], env=environment, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "mine\n"
        with pytest.raises(BlockingIOError, match=f"process {other.pid}, which writes there now") as refused:
            output.Lock(tmp_path)
        assert refused.value.filename == str(tmp_path)
        other.kill()
    with output.Lock(tmp_path), pytest.raises(BlockingIOError, match=f"process {os.getpid()}"):
        output.Lock(tmp_path)
    assert list(tmp_path.iterdir()) == []
