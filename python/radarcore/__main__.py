"""The command `radarcore`, also as `python -m radarcore`."""

import sys


def run() -> int:
    """Run the command of the command line; returns its exit status. Ctrl-C may come while it is being read, too."""
    try:
        from radarcore.cli.main import main
    except KeyboardInterrupt:
        sys.stderr.write("radarcore: interrupted\n")
        return 130
    return main()


if __name__ == "__main__":
    sys.exit(run())
