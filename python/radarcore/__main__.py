"""`python -m radarcore` is the command `radarcore`."""

import sys

from radarcore.cli import main

sys.exit(main())
