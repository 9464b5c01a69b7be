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

    See Also
    --------
    adapters.optitrack.decode_server_info : Makes one.
    adapters.optitrack.MotionCaptureClient : Has it as `info`.

    Examples
    --------
    >>> motions = {"ball": rc.Linear(rc.Pose([2.0, 0.0, 1.0]), velocity=[-0.5, 0.0, 0.0])}
    >>> with rc.adapters.optitrack.MotionCaptureServer(motions) as server:
    ...     with rc.adapters.optitrack.MotionCaptureClient(command_port=server.command_port) as client:
    ...         print(client.info.version, client.info.is_multicast)
    (4, 1) False
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

    See Also
    --------
    adapters.optitrack.CapturedFrame : Has one for each body.

    Examples
    --------
    >>> state = rc.adapters.optitrack.BodyState(1, (0.0, 1.0, 2.0), (1.0, 0.0, 0.0, 0.0), 1e-4, is_tracked=True)
    >>> state.position
    (0.0, 1.0, 2.0)
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

    See Also
    --------
    adapters.optitrack.NatNetFrame : Has one for each marker.

    Examples
    --------
    >>> marker = rc.adapters.optitrack.MarkerState(1, 2, (0.0, 1.0, 2.0), 0.014, False, False, residual=1e-4)
    >>> marker.member
    2
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

    See Also
    --------
    adapters.optitrack.decode_frame : Makes one.
    adapters.optitrack.CapturedFrame : The same with names, in the axes of a client.

    Examples
    --------
    >>> frame = rc.adapters.optitrack.NatNetFrame(17, (), {}, {}, (), 12.5, 1, 2, 3, False, False)
    >>> frame.number, frame.timestamp
    (17, 12.5)
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
    """Names of what a stream has, by identity.

    See Also
    --------
    adapters.optitrack.decode_model : Makes one.

    Examples
    --------
    >>> rc.adapters.optitrack.ModelNames(bodies={1: "ball"}).bodies[1]
    'ball'
    """

    bodies: dict[int, str] = field(default_factory=dict)
    skeletons: dict[int, tuple[str, dict[int, str]]] = field(default_factory=dict)
    """Name of the skeleton, and of its bones."""
    assets: dict[int, tuple[str, dict[int, str]]] = field(default_factory=dict)
