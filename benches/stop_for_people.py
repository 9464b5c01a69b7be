"""The loop of examples/stop_for_people.py: whether an arm stops for people in time.

python benches/stop_for_people.py            print the table
python benches/stop_for_people.py --write    also write the section of docs/separation.md
python benches/stop_for_people.py --tiny     one approach
"""

from __future__ import annotations

import argparse
import runpy

from page import DOCS, ROOT, printed_into


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--tiny", action="store_true")
    parser.add_argument("--write", action="store_true", help="write the section of docs/separation.md")
    options = parser.parse_args()
    example = runpy.run_path(str(ROOT / "examples" / "stop_for_people.py"))
    with printed_into(DOCS / "separation.md", "stop_for_people", write=options.write):
        example["main"](*((1, 0.01) if options.tiny else (100, 3.0)))


if __name__ == "__main__":
    main()
