"""URDF files as XML, with the errors and warnings of all readers."""

from __future__ import annotations

import re
from os import PathLike, fspath
from pathlib import Path
from xml.etree import ElementTree as ET

from radarcore import notice

_XACRO = re.compile(rb"</?(?:\{[^}]*xacro/?\}|xacro:)|\$\{|\$\((?:find|arg|eval|env|optenv) ")
"""Elements of xacro, with and without a declared namespace, and its expressions."""


def parsed(path: str | PathLike[str]) -> ET.Element:
    """The <robot> of a URDF file."""
    try:
        root = ET.parse(path).getroot()
    except ET.ParseError as error:
        if _XACRO.search(Path(path).read_bytes()):
            raise _unexpanded(path) from None
        raise ValueError(f"{fspath(path)}:{error.position[0]}: {error}") from None
    if root.tag != "robot":
        raise ValueError(f"{fspath(path)}: expected <robot>, got <{root.tag}>")
    if any(
        _XACRO.search(text.encode())
        for element in root.iter()
        for text in (f"<{element.tag}", *element.attrib.values())
    ):
        raise _unexpanded(path)
    return root


def warn_of_no_shapes(path: str | PathLike[str], root: ET.Element, geometry: str, argument: str) -> None:
    """Warn of a robot whose shapes are all of the kind that `argument` leaves out."""
    other = "visual" if geometry == "collision" else "collision"
    if root.find(f"link/{geometry}") is None and (shapes := root.findall(f"link/{other}")):
        notice.warn(
            f"{fspath(path)}: no link has a <{geometry}> shape, so the robot has no bodies; {argument}={other!r} takes "
            f"its {len(shapes)} of kind <{other}>"
        )


def _unexpanded(path: str | PathLike[str]) -> ValueError:
    return ValueError(
        f"{fspath(path)}: expected a URDF file, got one with macros of xacro; expand it first: xacro FILE > robot.urdf"
    )
