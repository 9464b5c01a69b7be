"""Command `python -m tests.fuzz`."""

import sys
from pathlib import Path

# Tests share their modules by this path, as pytest has it.
sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from fuzz.command import main

sys.exit(main())
