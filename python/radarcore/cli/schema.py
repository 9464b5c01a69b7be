"""The command `radarcore schema`: keys of scene files."""

from __future__ import annotations

import json
from typing import Annotated

from cyclopts import Parameter

from radarcore.scenefile import schema


def run(
    *,
    as_json: Annotated[
        bool, Parameter(name="--json", show_default=False, help="print the JSON schema, for editors")
    ] = False,
) -> None:
    """List every key of a scene file with unit and default."""
    print(json.dumps(schema.json_schema(), indent=2) if as_json else schema.text())
