"""Dense integrations of real meshes, which take minutes and are kept for the tests and for benches/accuracy.py.

    python benches/references.py            integrate all views again, and compare with what is kept
    python benches/references.py --write    also keep them
    python benches/references.py --tiny     one view on few rays

Needs the extra `robots`: pip install radarcore[robots].
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

from proof.measure import FULL, TINY
from proof.real_meshes import (
    INSTALL_HINT,
    STORED,
    integrated,
    profile_errors,
    stored_arrays,
    stored_reference,
    views,
)
from radarcore.models import robots


def main() -> None:
    parser = argparse.ArgumentParser(description="Dense integrations of real meshes.")
    parser.add_argument("--tiny", action="store_true", help="one view, on few rays")
    parser.add_argument("--write", action="store_true", help=f"keep them in benches/proof/{STORED.name}")
    arguments = parser.parse_args()
    if not robots.is_available():
        print(INSTALL_HINT)
        return
    run = TINY if arguments.tiny else FULL
    arrays: dict[str, Any] = {}
    for view in views(run):
        reference = integrated(view, run.pitch, run.shifts)
        kept = stored_reference(view) if STORED.exists() else None
        if kept is None:
            difference = "nothing is kept of these meshes and poses"
        else:
            errors = profile_errors(reference.transfer_function, kept.transfer_function, kept.nearest, kept.farthest)
            difference = f"{100.0 * errors.relative:.2f} % from what is kept"
        print(f"{view.group}, {view.name}: {1e-6 * reference.num_rays:.1f} million rays, {difference}", flush=True)
        arrays |= stored_arrays(view, reference)
    if arguments.write:
        np.savez_compressed(STORED, **arrays)


if __name__ == "__main__":
    main()
