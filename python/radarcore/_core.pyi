"""The compiled core. Arrays are C-contiguous and of the exact dtype; Python checks and casts before calling."""

from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Antennas",
    "Bounces",
    "Hits",
    "Material",
    "Pattern",
    "Report",
    "Samples",
    "Scatterers",
    "Scene",
    "Surface",
    "Waveform",
    "__version__",
    "beat_signal",
    "cross_sections",
    "image_scatterers",
    "levels",
    "load_obj",
    "plan_beat_signal",
]

__version__: str

def load_obj(
    path: str,
) -> tuple[NDArray[np.float64], NDArray[np.uint32], list[tuple[NDArray[np.uint32], list[str]]]]:
    """Vertices (n, 3), triangles (m, 3) and, for objects, groups and materials, number per triangle and names."""

def beat_signal(
    delay: NDArray[np.float64],
    amplitude: NDArray[np.complex128],
    delay_rate: NDArray[np.float64] | None = None,
    delay_acceleration: NDArray[np.float64] | None = None,
    *,
    waveform: Waveform,
    tolerance: float,
    method: str,
    threads: int | None = None,
    level: str | None = None,
    split_still: bool = True,
    skip_rows: bool = True,
) -> tuple[Any, Report]:
    """Samples (channel, chirp, sample) of paths (path,), (channel, path) or (node, channel, path), and what was done.

    complex64, or complex128 for tolerances below 1e-6. Methods: "auto", "direct", "grid", "recurrence", "lanes".
    """

def plan_beat_signal(
    delay: NDArray[np.float64],
    amplitude: NDArray[np.complex128],
    delay_rate: NDArray[np.float64] | None = None,
    delay_acceleration: NDArray[np.float64] | None = None,
    *,
    waveform: Waveform,
    tolerance: float,
    method: str,
    threads: int | None = None,
    level: str | None = None,
    split_still: bool = True,
    skip_rows: bool = True,
) -> Report:
    """What `beat_signal` would do."""

def levels() -> list[str]:
    """Names of the instruction sets that this processor has, slowest first."""

def image_scatterers(
    distance: NDArray[np.float64],
    normals: NDArray[np.float64],
    reflection: NDArray[np.complex128],
    albedo: NDArray[np.float64],
    body: NDArray[np.int32],
    *,
    num_bodies: int,
    focal_length: tuple[float, float],
    principal_point: tuple[float, float],
    antennas: Antennas,
    is_footprint: bool,
    seed: int,
    threads: int | None = None,
) -> Scatterers:
    """Material points of the surface elements (rows, columns) of an image; the bodies' frames are the sensor frame.

    No return where the distance along the ray is not positive and finite or the body number is negative. Normals are
    unit vectors towards the sensor; focal lengths and principal point are in pixels.
    """

def cross_sections(
    surface: Surface,
    transmitter: NDArray[np.float64],
    receiver: NDArray[np.float64],
    *,
    frequency: float,
    polarization: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    max_bounces: int,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """Radar cross-sections [m^2] of a perfect conductor, (direction,), by up to `max_bounces` reflections.

    Unit vectors (direction, 3) lead from the surface to both antennas; `polarization` has those along their fields.
    """

@final
class Waveform:
    """Times and frequencies of a frame."""

    def __new__(
        cls,
        *,
        start_frequency: float,
        slope: float,
        sample_rate: float,
        adc_delay: float,
        num_samples: int,
        chirp_times: NDArray[np.float64],
    ) -> Waveform: ...

@final
class Report:
    """What is, or was, done with which paths; `str` has one line per class of paths."""

    @property
    def error(self) -> float:
        """Predicted error of the plan, relative to l2(amplitudes)."""
    @property
    def memory(self) -> int:
        """Memory beside input and result [bytes]."""
    @property
    def rows(self) -> int:
        """Velocity rows that were transformed."""
    @property
    def rows_skipped(self) -> int:
        """Velocity rows that no path had touched."""
    @property
    def runs(self) -> int:
        """How many plans were run: more than one where paths add up in phase, or differ from the samples."""
    @property
    def gain(self) -> float:
        """Largest rms of the samples of a channel relative to its l2(amplitudes)."""
    def parts(self) -> list[tuple[str, int, str, str, int, list[int], list[int], float, int]]:
        """Per class of paths what `PlanPart` has."""

@final
class Surface:
    """Triangles, tree and shading of one body."""

    def __new__(
        cls,
        vertices: NDArray[np.float64],
        triangles: NDArray[np.uint32],
        *,
        crease_angle: float | None = None,
        report: Callable[[float], object] | None = None,
    ) -> Surface: ...
    def kept(self) -> NDArray[np.uint32] | None:
        """Rows of the triangles that were kept, (m,); None where all were."""

    def deform(self, vertices: NDArray[np.float64], *, threads: int | None = None) -> Surface:
        """The same triangles between vertices (n, 3) at other places, with the shading and the speckle of this surface.

        The tree is refitted, or built anew where it has become much worse; hits do not depend on it. Material points on
        such a surface stay with their facets, see `Scatterers.deforming`.
        """

    def quality(
        self, *, crease_angle: float, wavelength: float, threads: int | None = None
    ) -> tuple[list[int], list[float]]:
        """What the mesh is good for, if facets that meet below the crease angle [rad] stand for a curved surface.

        Numbers of parts, of open, non-manifold and inconsistent edges, of doubled and of thin triangles; area and
        smooth area [m^2], largest and mean sagitta [m], largest and rms difference of the echoes of flat facets at the
        wavelength [m], relative to the rms echo.
        """

    @property
    def memory(self) -> tuple[int, int]:
        """Memory of triangles, tree and shading, and of the vertices [bytes]."""

@final
class Material:
    """What a surface does to waves of one frequency."""

    @staticmethod
    def constant(reflection: tuple[float, float], albedo: float) -> Material:
        """The same at every angle; the field reflection coefficient as (real, imaginary)."""
    @staticmethod
    def dielectric(
        permittivity: tuple[float, float],
        *,
        roughness: float | None = None,
        scattering: float | None = None,
        thickness: float | None = None,
    ) -> Material:
        """What Fresnel says of a relative permittivity (real, imaginary), of a half-space or a slab of a thickness [m].

        `roughness`: rms height [m]; or `scattering`: the part of the field that is scattered. None: a smooth surface.
        """
    def response(
        self, cosine: NDArray[np.float64], *, wavelength: float, te: float, tm: float
    ) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Field reflection coefficients and albedos at cosines of incidence (n,).

        As antennas see them that get the parts `te` and `tm` of both polarisations; the wavelength is in metres.
        """

@final
class Pattern:
    """Power gain of an antenna over directions."""

    @staticmethod
    def gaussian(peak: float, azimuth: float, elevation: float) -> Pattern:
        """``peak exp(-azimuth az^2 - elevation el^2)``, the exponents [1/rad^2]; zero: isotropic."""
    @staticmethod
    def table(azimuth: NDArray[np.float64], elevation: NDArray[np.float64], gain_db: NDArray[np.float64]) -> Pattern:
        """Gains [dB] (azimuth, elevation) at increasing angles [rad], bilinear between them, nothing outside."""
    def gain(self, azimuth: NDArray[np.float64], elevation: NDArray[np.float64]) -> NDArray[np.float64]:
        """Power gains at angles (n,) [rad], azimuths within half a turn."""

@final
class Antennas:
    """Antennas of the sensor."""

    def __new__(
        cls,
        *,
        tx: NDArray[np.float64],
        rx: NDArray[np.float64],
        tx_patterns: Sequence[Pattern],
        rx_patterns: Sequence[Pattern],
        power: float,
        frequency: float,
        polarization: tuple[float, float, float] | None = None,
    ) -> Antennas:
        """At (n, 3) [m] in the sensor frame, with a pattern each; `polarization`: unit vector along their field."""

@final
class Scene:
    """Surfaces."""

    def __new__(cls, surfaces: Sequence[Surface]) -> Scene: ...
    def hide(
        self,
        poses: NDArray[np.float64],
        points: NDArray[np.float64],
        *,
        ends_early: bool = True,
        threads: int | None = None,
    ) -> tuple[NDArray[np.bool_], int]:
        """Which of `points` (n, 3) in the sensor frame hide behind bodies at `poses` (body, 3, 4), and a count.

        The count is that of searches that ended at a triangle in the way while there were boxes in front of it: 0
        unless `ends_early`.
        """
    def cast(
        self,
        poses: NDArray[np.float64],
        *,
        rows: int,
        columns: int,
        half_width: float,
        half_height: float,
        previous: Hits | None = None,
        beam: tuple[Antennas, float] | None = None,
        skip_empty: bool = True,
        with_cosines: bool = False,
        threads: int | None = None,
    ) -> Hits:
        """Cast the rays of an image with the bodies at `poses` (body, 3, 4), body to sensor.

        `previous` hits of the same scene are taken over where no body has moved. `beam`, antennas and the least
        gain of interest of a pair there and back relative to their peaks, and `skip_empty` say which tiles of the image
        are left out. `with_cosines`: `cos_incidence` will be wanted.
        """
    def sample(
        self,
        poses: NDArray[np.float64],
        materials: Sequence[Material],
        *,
        rows: int,
        columns: int,
        half_width: float,
        half_height: float,
        antennas: Antennas,
        rcs_floor: float,
        budget: int | None = None,
        end_points: bool,
        seed: int,
        previous: Samples | None = None,
        beam: tuple[Antennas, float] | None = None,
        skip_empty: bool = True,
        threads: int | None = None,
    ) -> Samples:
        """Cast rays where they are needed, with the bodies at `poses` (body, 3, 4), body to sensor.

        Through a base grid of cells, which are split until they leave open less than `rcs_floor` asks for, or `budget`
        rays are cast. `end_points`: cells whose phase turns fast stand for their ends. What was sampled of the same
        scene before is taken over where no body has moved; `beam` and `skip_empty` as in `cast`.
        """

@final
class Hits:
    """What the rays of an image hit."""

    @property
    def counts(self) -> tuple[int, int, int]:
        """Rays that were cast, and tiles that were skipped and taken over."""
    def distance(self) -> NDArray[np.float64]:
        """Distance along the ray [m], (rows, columns); inf where nothing was hit."""
    def cos_incidence(self, *, threads: int | None = None) -> NDArray[np.float64]:
        """Cosine of the angle of incidence, (rows, columns); 0 where nothing was hit."""
    def shaded(self, *, threads: int | None = None) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distance along the ray to the surface that the facets stand for [m], and its unit normal towards the sensor.

        (rows, columns), inf where nothing was hit, and (rows, columns, 3), 0 where nothing was hit.
        """
    def reflectance(
        self,
        materials: Sequence[Material],
        *,
        frequency: float,
        polarization: tuple[float, float, float] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Power reflectance of the materials, one per body, at the angles of the pixels, (rows, columns).

        0 where nothing was hit.
        """
    def body(self) -> NDArray[np.int32]:
        """Number of the body, (rows, columns); -1 where nothing was hit."""
    def place_on_mesh(self, pixel: int) -> tuple[list[int], list[float]]:
        """The three vertices of the triangle that a pixel (row by row) hit, and their weights there."""
    def direction(self, pixel: int) -> list[float]:
        """Unit direction of the ray of a pixel (row by row) in the sensor frame."""
    def directions(self) -> NDArray[np.float64]:
        """Unit directions of the rays in the sensor frame, (rows, columns, 3)."""
    def scatterers(
        self,
        materials: Sequence[Material],
        *,
        antennas: Antennas,
        is_footprint: bool,
        seed: int,
        threads: int | None = None,
    ) -> Scatterers:
        """Material points of all hits that send anything back; `materials` has one per body."""
    def bounces(
        self,
        materials: Sequence[Material],
        *,
        antennas: Antennas,
        is_footprint: bool,
        max_bounces: int,
        floor: float,
        threads: int | None = None,
    ) -> Bounces:
        """Routes of two to `max_bounces` reflections of all hits; `materials` has one per body.

        Ray tubes end where their power is less than `floor` of what was launched.
        """

@final
class Samples:
    """Cells of the image plane, fine where they need to be, what their rays hit, and points of rough surfaces."""

    def __len__(self) -> int: ...
    @property
    def counts(self) -> tuple[int, int, int, int]:
        """Rays that were cast, bundles of them that were skipped and taken over, cells that could have been split."""
    def cells(self) -> NDArray[np.float64]:
        """Centre (u, v) and widths of the cells that hit something, (cell, 4)."""
    def body(self) -> NDArray[np.int32]:
        """Number of the body that every cell hit, (cell,)."""
    def distance(self) -> NDArray[np.float64]:
        """Distance along the ray [m], (cell,)."""
    def direction(self, cell: int) -> list[float]:
        """Unit direction of the ray of a cell in the sensor frame."""
    def place_on_mesh(self, cell: int) -> tuple[list[int], list[float]]:
        """The three vertices of the triangle that a cell hit, and their weights there."""
    def scatterers(
        self,
        materials: Sequence[Material],
        *,
        antennas: Antennas,
        threads: int | None = None,
    ) -> Scatterers:
        """Material points of cells and surfaces that send anything back; `materials` has one per body."""

@final
class Scatterers:
    """Material points; delays and amplitudes follow from where their bodies, or their vertices, are."""

    def __len__(self) -> int: ...
    def body(self) -> NDArray[np.uint32]:
        """Number of the body of every material point, (scatterer,)."""
    def cell(self) -> NDArray[np.uint32]:
        """Number of the cell of every material point, of the pixel or of the cell of samples, (scatterer,).

        Diffuse points of samples belong to 2**32 - 1.
        """
    def deforming(self) -> NDArray[np.uint32]:
        """Numbers of the bodies that deform and have material points here, increasing."""
    def order(self) -> NDArray[np.uint8]:
        """By which power of the frequency the field of every material point falls, (scatterer,)."""
    def select(self, wanted: NDArray[np.bool_], order: int) -> Scatterers:
        """The material points of an order of the bodies for which `wanted` (body,) is true, in the same order."""
    def paths(
        self,
        poses: NDArray[np.float64],
        points: NDArray[np.float64],
        rcs: NDArray[np.float64],
        *,
        vertices: Sequence[NDArray[np.float64]] | None = None,
        amplitudes_at: tuple[NDArray[np.float64], NDArray[np.float64], Sequence[NDArray[np.float64]]] | None = None,
        first: int = 0,
        last: int | None = None,
        step: int = 1,
        threads: int | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Delay [s] and amplitude [sqrt(W)], (node, channel, path), of every `step`-th path from `first` to `last`.

        First the material points with their bodies at `poses` (node, body, 3, 4), then the point targets at `points`
        (node, point, 3). `vertices` has one array (node, vertex, 3) for each of the bodies of `deforming`. Amplitudes
        are those at `amplitudes_at`, which are such poses, points and vertices at other nodes.
        """
    def delay_rates(
        self,
        poses: NDArray[np.float64],
        pose_rates: NDArray[np.float64],
        points: NDArray[np.float64],
        point_rates: NDArray[np.float64],
        *,
        vertices: Sequence[NDArray[np.float64]] | None = None,
        vertex_rates: Sequence[NDArray[np.float64]] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Rate of every delay [s/s], (channel, path); vertices (vertex, 3) are those of the bodies of `deforming`."""

@final
class Bounces:
    """Routes over two and more surfaces; delays and amplitudes follow from where bodies, or their vertices, are."""

    def __len__(self) -> int: ...
    @property
    def counts(self) -> tuple[int, int]:
        """Rays from surfaces to the next, and ray tubes that ended at the floor."""
    def body(self) -> NDArray[np.uint32]:
        """Number of the last body of every route, (route,)."""
    def order(self) -> NDArray[np.uint32]:
        """Number of reflections of every route, (route,)."""
    def deforming(self) -> NDArray[np.uint32]:
        """Numbers of the bodies that deform and are met here, increasing."""
    def split(self, wanted: NDArray[np.bool_]) -> tuple[Bounces, Bounces]:
        """The routes over bodies for which `wanted` (body,) is true and no others, and all others; the order stays."""
    def paths(
        self,
        poses: NDArray[np.float64],
        *,
        vertices: Sequence[NDArray[np.float64]] | None = None,
        amplitudes_at: tuple[NDArray[np.float64], Sequence[NDArray[np.float64]]] | None = None,
        first: int = 0,
        last: int | None = None,
        step: int = 1,
        threads: int | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
        """Delay [s] and amplitude [sqrt(W)], (node, channel, route), of every `step`-th route from `first` to `last`.

        The bodies are at `poses` (node, body, 3, 4). `vertices` has one array (node, vertex, 3) for each of the bodies
        of `deforming`. Amplitudes are those at `amplitudes_at`, which are such poses and vertices at other nodes.
        """
    def delay_rates(
        self,
        poses: NDArray[np.float64],
        pose_rates: NDArray[np.float64],
        *,
        vertices: Sequence[NDArray[np.float64]] | None = None,
        vertex_rates: Sequence[NDArray[np.float64]] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Rate of every delay [s/s], (channel, route); vertices (vertex, 3) are those of the bodies of `deforming`."""
