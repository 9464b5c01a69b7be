"""URDF files as XML, with the errors and warnings of all readers."""

from __future__ import annotations

import re
from os import PathLike, fspath
from pathlib import Path
from xml.etree import ElementTree as ET

from radarcore import notice

_XACRO = re.compile(rb'xmlns:ns\d+="[^"]*xacro/?"|</?xacro:|\$\{|\$\((?:find|arg|eval|env|optenv) ')
"""Elements of xacro, with and without a declared namespace, and its expressions."""


def parsed(path: str | PathLike[str]) -> ET.Element:
    """The <robot> of a URDF file."""
    content = Path(path).read_bytes()
    try:
        root = ET.fromstring(content)
    except ET.ParseError as error:
        fault = f":{error.position[0]}: {error}"
    else:
        content = ET.tostring(root)  # without comments
        fault = "" if root.tag == "robot" else f": expected <robot>, got <{root.tag}>"
    if _XACRO.search(content):
        fault = ": expected a URDF file, got one with macros of xacro; expand it first: xacro FILE > robot.urdf"
    if fault:
        raise ValueError(f"{fspath(path)}{fault}")
    return root


def warn_of_no_shapes(path: str | PathLike[str], root: ET.Element, geometry: str, argument: str) -> None:
    """Warn of a robot whose shapes are all of the kind that `argument` leaves out."""
    other = "visual" if geometry == "collision" else "collision"
    if root.find(f"link/{geometry}") is None and (shapes := root.findall(f"link/{other}")):
        notice.warn(
            f"{fspath(path)}: no link has a <{geometry}> shape, so the robot has no bodies; {argument}={other!r} takes "
            f"its {len(shapes)} of kind <{other}>"
        )
