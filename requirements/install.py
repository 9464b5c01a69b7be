"""Install packages into an environment with uv, in a fifth of pip's time, or with pip where uv cannot.

    python requirements/install.py PYTHON ARGUMENTS

PYTHON is the interpreter of the environment, and ARGUMENTS are those of `pip install`. uv reads no settings of pip, so
its index, folders and certificates are passed on. Where others are set, of a proxy for instance, pip installs.
"""

import ast
import os
import re
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path

TOOLS = Path(sys.executable).parent
"""Folder that uv is installed in."""

PIP = [sys.executable, "-m", "pip", "--disable-pip-version-check"]

SETTINGS = {
    "cert": "SSL_CERT_FILE",
    "default-timeout": "UV_HTTP_TIMEOUT",
    "extra-index-url": "UV_INDEX",
    "find-links": "UV_FIND_LINKS",
    "index-url": "UV_DEFAULT_INDEX",
    "timeout": "UV_HTTP_TIMEOUT",
    "trusted-host": "UV_INSECURE_HOST",
}
"""Settings of pip that uv has in an environment variable."""

IRRELEVANT = {
    "config-file",
    "disable-pip-version-check",
    "no-cache-dir",
    "no-color",
    "no-input",
    "no-warn-script-location",
    "progress-bar",
    "quiet",
    "require-virtualenv",
    "retries",
    "root-user-action",
    "verbose",
}
"""Settings of pip that do not change what is installed from where."""


SECTIONS = ("global", "install", ":env:")
"""Sources of pip's settings, those that count most last."""


def settings_for_uv(environment: Mapping[str, str]) -> dict[str, str] | None:
    """Environment variables for uv from the settings of pip, or None where only pip has what is set."""
    # Where it is told to be quiet, pip lists nothing.
    command = [*PIP, "config", "list"]
    done = subprocess.run(
        command, env={**environment, "PIP_QUIET": "0"}, capture_output=True, encoding="utf-8", check=False
    )
    # What is wrong with its files pip says best.
    return variables_for_uv(done.stdout) if done.returncode == 0 else None


def variables_for_uv(listing: str) -> dict[str, str] | None:
    """Environment variables for uv from what `pip config list` prints, or None."""
    found = re.findall(r"^(global|install|:env:)\.([\w-]+)=(.*)$", listing, flags=re.M)
    variables = {}
    for section, name, text in sorted(found, key=lambda entry: SECTIONS.index(entry[0])):
        words = str(ast.literal_eval(text)).split()
        if not words or name in IRRELEVANT:
            continue
        # Releases of pip that list every file by itself leave open which of two counts.
        is_unclear = len({entry for entry in found if entry[:2] == (section, name)}) > 1
        # Folders that pip finds and uv does not.
        is_for_pip = name == "find-links" and re.search("[,~]", text)
        if name not in SETTINGS or is_unclear or is_for_pip:
            return None
        variables[SETTINGS[name]] = ("," if name == "find-links" else " ").join(words)
    return variables


def install(python: str, arguments: list[str]) -> int:
    """Exit status of `pip install ARGUMENTS` for the environment of an interpreter."""
    variables = settings_for_uv(os.environ)
    uv = TOOLS / ("uv.exe" if os.name == "nt" else "uv")
    if variables is not None and uv.exists():
        command = [str(uv), "pip", "install", "--quiet", "--python", python, *arguments]
        if subprocess.run(command, env=os.environ | variables, check=False).returncode == 0:
            return 0
        sys.stderr.write("uv could not install them; now with pip\n")
    command = [*PIP, "--quiet", "--python", python, "install", "--no-compile", *arguments]
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(install(sys.argv[1], sys.argv[2:]))
