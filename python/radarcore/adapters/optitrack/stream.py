"""Messages of NatNet: frames, names, and descriptions of servers."""

from __future__ import annotations

from dataclasses import dataclass, field

Version = tuple[int, int]
"""Major and minor number of the protocol."""


@dataclass(frozen=True)
class ServerInfo:
    """Answer of a server to a client that connects.

    Attributes
    ----------
    name : str
        Of the program.
    version : (int, int)
        Of the protocol.
    clock_frequency : int
        Ticks per second of the stamps.
    data_port : int
        Port of multicast frames.
    is_multicast : bool
        Frames come by multicast, to all that have joined; otherwise to the address that connected.
    multicast_address : str
    """

    name: str
    version: Version
    clock_frequency: int
    data_port: int
    is_multicast: bool
    multicast_address: str


@dataclass(frozen=True)
class BodyState:
    """A rigid body, or bone, in a frame, in Motive's axes.

    Attributes
    ----------
    id : int
    position : (float, float, float)
        [m].
    quaternion : (float, float, float, float)
        Order (w, x, y, z).
    mean_marker_error : float
        [m].
    is_tracked : bool
        Position and quaternion are of this frame; otherwise they are old.
    """

    id: int
    position: tuple[float, ...]
    quaternion: tuple[float, ...]
    mean_marker_error: float
    is_tracked: bool


@dataclass(frozen=True)
class MarkerState:
    """A marker in a frame, in Motive's axes.

    Attributes
    ----------
    model : int
        Identity of the body that it belongs to.
    member : int
        Number of the marker in it.
    position : (float, float, float)
        [m].
    size : float
        Diameter [m].
    is_occluded, is_unlabelled : bool
    residual : float
        Mean distance of the cameras' rays from the marker, as Motive gives it.
    """

    model: int
    member: int
    position: tuple[float, ...]
    size: float
    is_occluded: bool
    is_unlabelled: bool
    residual: float


@dataclass(frozen=True)
class NatNetFrame:
    """A frame of the stream.

    Attributes
    ----------
    number : int
    bodies : tuple of BodyState
        Rigid bodies.
    skeletons, assets : mapping of int to tuple of BodyState
        Bones by the identity of the skeleton or of the asset.
    markers : tuple of MarkerState
    timestamp : float
        Of the program, from its start or that of the take [s].
    exposure_ticks, received_ticks, transmitted_ticks : int
        Middle of the cameras' exposure, arrival of their data, departure of the frame, by the server's clock.
    is_recording, is_model_changed : bool
        `is_model_changed`: names are to be asked for again.
    """

    number: int
    bodies: tuple[BodyState, ...]
    skeletons: dict[int, tuple[BodyState, ...]]
    assets: dict[int, tuple[BodyState, ...]]
    markers: tuple[MarkerState, ...]
    timestamp: float
    exposure_ticks: int
    received_ticks: int
    transmitted_ticks: int
    is_recording: bool
    is_model_changed: bool


@dataclass
class ModelNames:
    """Names of what a stream has, by identity."""

    bodies: dict[int, str] = field(default_factory=dict)
    skeletons: dict[int, tuple[str, dict[int, str]]] = field(default_factory=dict)
    """Name of the skeleton, and of its bones."""
    assets: dict[int, tuple[str, dict[int, str]]] = field(default_factory=dict)
