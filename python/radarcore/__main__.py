"""`python -m radarcore` is the command `radarcore`."""

import sys

from radarcore.cli.main import main

sys.exit(main())
