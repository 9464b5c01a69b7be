"""All pictures of docs/gallery.md, made by the examples and stored with 256 colours: docs/gallery/*.png.

Give a recording of a real sensor for the example that takes one: python examples/gallery.py [RECORDING]
"""

import subprocess
import sys
from pathlib import Path

from PIL import Image

EXAMPLES = Path(__file__).parent
GALLERY = EXAMPLES.parent / "docs" / "gallery"
NAMES = (
    "walker_from_moving_arm",
    "walking_person",
    "propeller",
    "corner_reflector",
    "oblique_wall",
    "multipath_ghost",
    "mimo_angles",
    "interference",
    "beam_steering",
    "depth_camera",
    "real_recording",
    "virtual_sensor",
    "live_loop",
)

if __name__ == "__main__":
    GALLERY.mkdir(exist_ok=True)
    for name in NAMES:
        print(f"{name}:", flush=True)
        recording = sys.argv[1:] if name == "real_recording" else []
        if name == "real_recording" and not recording:
            print("left as it is: no recording given")
            continue
        path = GALLERY / f"{name}.png"
        subprocess.run([sys.executable, EXAMPLES / f"{name}.py", *recording, "-o", path], check=True)
        with Image.open(path) as picture:
            picture.convert("RGB").quantize(256, Image.Quantize.MAXCOVERAGE).save(path, optimize=True)
