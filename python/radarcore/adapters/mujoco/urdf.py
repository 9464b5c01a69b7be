"""Robots in URDF files as MuJoCo's MjSpec, to be attached to a world."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from radarcore import check, notice
from radarcore.adapters.mujoco.model import mujoco_module
from radarcore.geometry.urdf_files import parsed, warn_of_no_shapes

GEOMETRIES = ("collision", "visual")

_COMPILER = {
    "discardvisual": "false",
    "strippath": "false",
    "fusestatic": "false",
    "balanceinertia": "true",
    "boundmass": "1e-4",
    "boundinertia": "1e-6",
}
"""Links without a mass are permitted, and all geoms and bodies stay."""

_READABLE = (".stl", ".obj", ".msh")
"""Mesh files that MuJoCo reads."""

_SCHEME = "package://"


def spec_from_urdf(
    path: str | PathLike[str],
    *,
    geometry: str = "collision",
    packages: Mapping[str, str | PathLike[str]] | None = None,
) -> Any:
    """A URDF file as an ``MjSpec``.

    Into a world: ``world.attach(spec, prefix="arm_", frame=world.worldbody.add_frame(pos=[0, 0, 0.8]))``.

    Parameters
    ----------
    path : path
    geometry : "collision" or "visual"
        Shapes that the robot gets. Meshes of other formats than STL, OBJ and MSH are left out, with a warning.
    packages : mapping of str to path, optional
        Folders of the packages that ``package://NAME/...`` names. Default: a folder of that name above the file.

    Raises
    ------
    ImportError
        Without the extra `mujoco`.
    ValueError
        For packages and meshes that are not found.

    See Also
    --------
    models.RobotArm.from_urdf : Without MuJoCo.
    adapters.mujoco.LiveModel : Bodies of the model.

    Examples
    --------
    >>> from pathlib import Path
    >>> box = '<collision><geometry><box size="0.1 0.1 0.2"/></geometry></collision>'
    >>> size = Path("box.urdf").write_text(f'<robot name="box"><link name="base">{box}</link></robot>')
    >>> rc.adapters.mujoco.spec_from_urdf("box.urdf").compile().ngeom
    1
    """
    mujoco = mujoco_module()
    check.choice("geometry", geometry, GEOMETRIES)
    file = Path(path).resolve()
    folders = {name: Path(folder) for name, folder in (packages or {}).items()}
    root = parsed(file)
    warn_of_no_shapes(file, root, geometry, "geometry")
    for origin in root.iter("origin"):
        if (quaternion := origin.attrib.pop("quat_xyzw", None)) is not None:  # of URDF 1.1: MuJoCo leaves it out
            origin.set("rpy", _rpy(quaternion, file))
    root.insert(0, ET.Element("mujoco"))
    ET.SubElement(root[0], "compiler", _COMPILER)
    left_out: list[str] = []
    for link in root.iterfind("link"):
        for kind in GEOMETRIES:
            for shape in link.findall(kind):
                mesh = shape.find("geometry/mesh")
                name = "" if mesh is None else mesh.get("filename", "")
                if kind != geometry:
                    link.remove(shape)
                elif mesh is not None and not name.lower().endswith(_READABLE):
                    link.remove(shape)
                    left_out.append(name)
                elif mesh is not None:
                    mesh.set("filename", str(_located(name, file, folders)))
    if left_out:
        notice.warn(f"{file}: MuJoCo reads STL, OBJ and MSH; {len(left_out)} meshes are left out, as {left_out[0]}")
    return mujoco.MjSpec.from_string(ET.tostring(root, encoding="unicode"))


def _rpy(quaternion: str, file: Path) -> str:
    """Roll, pitch and yaw of the text of a quaternion."""
    from scipy.spatial.transform import Rotation  # takes longer to load than the rest

    try:
        rotation = Rotation.from_quat([float(word) for word in quaternion.split()])
    except ValueError as error:
        raise ValueError(f"{file}: quat_xyzw: expected a quaternion, got {quaternion!r}") from error
    return " ".join(map(repr, rotation.as_euler("xyz", suppress_warnings=True).tolist()))


def _located(name: str, file: Path, folders: Mapping[str, Path]) -> Path:
    """Path of a mesh file."""
    if not name.startswith(_SCHEME):
        found = file.parent / name.removeprefix("file://")
    else:
        package, _, rest = name.removeprefix(_SCHEME).partition("/")
        above = (parent / package for parent in file.parents if (parent / package).is_dir())
        folder = folders.get(package) or next(above, None)
        if folder is None:
            raise ValueError(f"packages: expected the folder of {package!r}, which {name} in {file} needs, got none")
        found = folder / rest
    if not found.is_file():
        raise ValueError(f"{file}: mesh {name} is not there: {found}")
    return found.resolve()
