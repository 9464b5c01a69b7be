"""The compiled core. Arrays are C-contiguous and of the exact dtype; Python checks and casts before calling."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Antennas",
    "DepthScene",
    "IdealFrame",
    "Material",
    "Pattern",
    "Placement",
    "Scene",
    "Simulator",
    "Surface",
    "Waveform",
    "__version__",
    "above_sidelobes",
    "add_noise",
    "beat_signal",
    "between_cells",
    "cross_sections",
    "fit_spheres",
    "fit_tones",
    "levels",
    "load_obj",
    "local_maxima",
    "maxima_above",
    "reflectance",
    "training_medians",
]

__version__: str

_ImageArrays = tuple[
    NDArray[np.float64], NDArray[np.float64], NDArray[np.int32], NDArray[np.float64], NDArray[np.float64]
]

def load_obj(
    path: str,
) -> tuple[NDArray[np.float64], NDArray[np.uint32], list[tuple[NDArray[np.uint32], list[str]]]]:
    """Vertices (n, 3), triangles (m, 3) and, for objects, groups and materials, number per triangle and names."""

def beat_signal(
    delay: Sequence[NDArray[np.float64]],
    amplitude: Sequence[NDArray[np.complex128]],
    *,
    is_nodal: bool,
    waveform: Waveform,
    tolerance: float,
    method: str,
    threads: int | None = None,
    level: str | None = None,
    report: Callable[[int], object] | None = None,
) -> tuple[Any, str, dict[str, Any]]:
    """Samples (channel, chirp, sample) of paths in rows (channel, path), the report, and its numbers.

    Rows of delays and amplitudes at nodes with `is_nodal`; else of delays, rates and accelerations, and one of
    amplitudes. complex64, or complex128 for tolerances below 1e-6. Methods: "auto", "direct", "grid". `report` receives
    the number of chirps of all channels that a direct sum has done, from time to time.

    Numbers of the report: `engine` by name; `is_single`: samples in single precision; `width` of the spreading kernel
    [cells], 0 for none; `static_paths` of all channels; `error` relative to l2(amplitudes) that the sum holds; `memory`
    beside input and result [bytes].
    """

def levels() -> list[str]:
    """Names of the instruction sets of this processor, slowest first, up to ``RADARCORE_SIMD``."""

def reflectance(
    materials: Sequence[Material],
    body: NDArray[np.int32],
    cos_incidence: NDArray[np.float64],
    normals: NDArray[np.float64],
    directions: NDArray[np.float64],
    *,
    frequency: float,
    polarization: tuple[float, float, float] | None = None,
    threads: int | None = None,
) -> NDArray[np.float64]:
    """Power reflectance of materials, one per body, in the pixels of an image, (rows, columns); 0 for negative bodies.

    Pixels have a body, a cosine of incidence, and a normal and a direction of the ray, (rows, columns, 3).
    """

def add_noise(samples: NDArray[Any], seeds: Sequence[int], deviation: float, start: float) -> None:
    """Add white noise of a standard `deviation` to float32 or float64 samples of frames, one after the other.

    Each frame has a seed. The noise belongs to it and to the start of the frame [s].
    """

def local_maxima(power: NDArray[np.float64], cells: NDArray[np.int64], is_cyclic: bool) -> NDArray[np.bool_]:
    """True for cells (cell, 2) of a map (row, column) with power that none of their eight neighbours exceeds.

    Rows are cyclic, columns too with `is_cyclic`; without, the map is even about both its ends, as the spectrum of real
    samples is.
    """

def between_cells(
    power: NDArray[np.float64], cells: NDArray[np.int64], is_cyclic: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Offsets of local maxima from the middle of their cells (cell, 2), and their heights (cell,).

    By parabolas through the log power of each and its neighbours, along rows and along columns. As in `local_maxima`.
    """

def maxima_above(
    power: NDArray[np.float64],
    trained: NDArray[np.float64],
    scale: NDArray[np.float64],
    first: int,
    guards: tuple[int, int],
    trainings: tuple[int, int],
    is_cyclic: bool,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Local maxima (peak, 2) of a map above their thresholds, and these (peak,); see `local_maxima`.

    `trained` and `scale` (row, column) begin at the column `first` of the map. A threshold is `scale` times the sum of
    the training cells of `trained`, see `training_medians`, clipped at five times the level of their column: the median
    over the rows, then over the columns near it. Cells with a scale of 0 are not tested.
    """

def above_sidelobes(
    power: NDArray[np.float64],
    peaks: NDArray[np.int64],
    least: NDArray[np.float64],
    envelopes: tuple[NDArray[np.float64], NDArray[np.float64]],
    mean_envelope: NDArray[np.float64],
    mean_gain: NDArray[np.float64],
    searched: tuple[int, int],
    smallest: float,
    smear: float,
    num_samples: int,
    is_cyclic: bool,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Peaks (peak, 2) above `least` (peak,) after subtraction of the sidelobes of all stronger ones, strongest first.

    Also returns their offsets from the middle of their cells (peak, 2), as `between_cells`. The largest local maximum
    of every column outside of `searched` (first, last) has sidelobes too. `envelopes`: of the lobes along rows and
    columns, as `radarcore.processing.detection.map.envelope` gives them; `mean_envelope` times `mean_gain` (row,): of
    echoes in a subtracted mean. `smallest`: power of the weakest peak over the strongest's. `smear`: cells crossed in a
    frame per row of velocity.
    """

def training_medians(
    power: NDArray[np.float64], cells: NDArray[np.int64], guards: tuple[int, int], trainings: tuple[int, int]
) -> NDArray[np.float64]:
    """Medians (cell,) of the cells at most `guards + trainings` rows and columns away, but those within `guards`.

    Of a map (row, column) whose edges are edges, float32 or float64; NaN where there are none.
    """

def fit_tones(
    cells: NDArray[Any],
    peaks: NDArray[np.int64],
    start: NDArray[np.float64],
    series: NDArray[np.float64],
    lobes: NDArray[np.complex128],
    num_cells: tuple[int, int],
    is_cyclic: bool,
    has_images: bool,
) -> tuple[NDArray[np.float64], NDArray[np.complex128], NDArray[np.float64], NDArray[np.float64]]:
    """Offsets (tone, 2), amplitudes (tone, look), energy gains (tone,) and information (tone, 2) of tones about peaks.

    `cells` (look, row, column), complex64 or complex128; `peaks` (tone, 2) their rows and columns; `start` (tone, 2)
    offsets near the tones; `series` and `lobes` as `radarcore.processing.detection.tone.Axes` describes them, for
    patches of `num_cells` rows and columns. `is_cyclic`: columns go on at the other edge. Tones beside stronger ones
    are fitted again after subtraction of these; with `has_images`, those near column 0 after subtraction of conjugates.
    """

def fit_spheres(
    waves: NDArray[np.complex128],
    sines: NDArray[np.float64],
    distance: NDArray[np.float64],
    antennas: NDArray[np.float64],
    channels: NDArray[np.float64],
    num_receivers: int,
    wavenumber: float,
    observable: tuple[bool, bool],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sines (target, 2) of targets at a `distance` (target,) [m], and their share of unexplained power (target,).

    `waves` (target, channel) of the channels; `sines` (target, 2) of the plane waves that fit them best; `antennas`
    (antenna, 3) transmitters, if they have channels of their own, and receivers, from the centre of the array [m];
    `channels` (channel, 3) phases per direction component along x, y and z [rad], about their means. `wavenumber`
    [rad/m]; `observable`: sines along y and z that the channels determine. Waves are plane if a distance is not finite.
    """

def cross_sections(
    surfaces: Sequence[Surface],
    body_poses: NDArray[np.float64],
    body_materials: Sequence[Material],
    transmitter: NDArray[np.float64],
    receiver: NDArray[np.float64],
    *,
    frequency: float,
    polarization: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None,
    max_bounces: int,
    threads: int | None = None,
    report: Callable[[int], object] | None = None,
) -> NDArray[np.float64]:
    """Radar cross-sections [m^2] of bodies at poses (body, 3, 4), (direction,), by up to `max_bounces` reflections.

    Unit vectors (direction, 3) lead from the bodies to both antennas; `polarization` has those along their fields.
    `report` receives the number of directions that are done, from time to time.
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
class Surface:
    """Triangles, tree and shading of one body."""

    def __new__(
        cls,
        vertices: NDArray[np.float64],
        triangles: NDArray[np.uint32],
        *,
        crease_angle: float | None = None,
        report: Callable[[int], object] | None = None,
    ) -> Surface:
        """`report` receives the thousandths of the build that are done, from time to time."""

    def kept(self) -> NDArray[np.uint32] | None:
        """Rows of the triangles that were kept, (m,); None where all were."""

    def deform(self, vertices: NDArray[np.float64], *, threads: int | None = None) -> Surface:
        """Surface of the same triangles between other vertices (n, 3), with the normals and the speckle of this one.

        The tree is refitted, or built anew where it has become much worse; hits do not depend on it. Material points on
        such a surface stay with their facets, see `Scatterers.deforming`.
        """

    def topology(self) -> list[int]:
        """Numbers of parts, and of open, non-manifold and inconsistently wound edges."""

    @property
    def memory(self) -> tuple[int, int]:
        """Memory of triangles, tree and shading, and of the vertices [bytes]."""

@final
class Material:
    """Reflection and scattering of a surface at one frequency."""

    @staticmethod
    def constant(reflection: tuple[float, float], albedo: float) -> Material:
        """Equal reflection at every angle; the field reflection coefficient as (real, imaginary)."""
    @staticmethod
    def dielectric(
        permittivity: tuple[float, float],
        *,
        roughness: float | None = None,
        scattering: float | None = None,
        thickness: float | None = None,
    ) -> Material:
        """Fresnel reflection by a relative permittivity (real, imaginary): half-space or slab of a thickness [m].

        `roughness`: rms height [m]; or `scattering`: the part of the field that is scattered. None: a smooth surface.
        """
    def response(
        self, cosine: NDArray[np.float64], *, wavelength: float, seen: tuple[float, float] | None
    ) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Field reflection coefficients and albedos at cosines of incidence (n,).

        As antennas see them that get the parts `seen` of both polarisations, across the plane of incidence and in it;
        None: without a polarisation. The wavelength is in metres.
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
        responses: NDArray[np.complex128] | None = None,
        longest_path: float = 0.0,
    ) -> Antennas:
        """At (n, 3) [m] in the sensor frame, with a pattern each; `polarization`: unit vector along their field.

        `responses`: gain of the receiver for the echoes of every transmit antenna (tx, step), over lengths of paths
        from 0 to `longest_path` [m] in equal steps.
        """

@final
class Scene:
    """Bodies and point targets."""

    def __new__(cls, targets: Sequence[tuple[Surface, bool] | float]) -> Scene:
        """Of bodies with surfaces, and whether their vertices move, and of cross-sections of points [m^2]."""

@final
class DepthScene:
    """Surface elements of a depth image, one per pixel."""

    def __new__(
        cls,
        plane: tuple[int, int, float, float, float, float],
        distance: NDArray[np.float64],
        normals: NDArray[np.float64],
        reflection: NDArray[np.complex128],
        albedo: NDArray[np.float64],
        body: NDArray[np.int32],
        *,
        num_bodies: int,
        range_rate: NDArray[np.float64] | None = None,
        age: float = 0.0,
    ) -> DepthScene:
        """Of arrays (rows, columns), normals (rows, columns, 3).

        `plane`: rows, columns, width and height of a pixel at distance 1, column and row of the axis [pixels].
        Distances along the ray [m], unit normals towards the sensor, field reflection coefficients, albedos, numbers of
        bodies, and range rates [m/s] beside the motion of the bodies. The frame starts `age` [s] after the image.
        """

@final
class Placement:
    """Places in the world at the Chebyshev times of a frame, or their time derivatives at one time."""

    def __new__(
        cls,
        sensor: NDArray[np.float64],
        poses: NDArray[np.float64],
        points: NDArray[np.float64],
        vertices: Sequence[NDArray[np.float64]] = ...,
    ) -> Placement:
        """Of an odd number of times.

        ``[rotation | position]`` of the sensor (time, 3, 4) and of bodies (time, body, 3, 4), positions of point
        targets (time, point, 3) [m], and per body that deforms its vertices (time, vertex, 3) in body coordinates [m],
        at Chebyshev times of their own number.
        """

@final
class IdealFrame:
    """The ideal beat signal of a frame, its truth, and counts."""

    @property
    def cube(self) -> NDArray[np.complex64] | NDArray[np.complex128]:
        """Beat samples (channel, chirp, sample) [sqrt(W)]; complex128 for tolerances below 1e-6."""
    @property
    def truth(self) -> NDArray[np.float64] | None:
        """Range [m], range rate [m/s], azimuth and elevation [rad] of every body of the scene, (4, body).

        NaN where no ray hit; None for images.
        """
    @property
    def farthest(self) -> float:
        """Distance of the farthest echo [m]."""
    @property
    def series_errors(self) -> tuple[float, float]:
        """Errors of phases [rad] and of amplitudes by the series over the frame, relative to l2(amplitudes)."""
    @property
    def bounce_error(self) -> float:
        """Error of the paths of several reflections where ray tubes ran out, relative to their field (rms)."""
    @property
    def rcs_floor(self) -> float | None:
        """Cross-section that the cells were refined for [m^2]; None without adaptive sampling."""
    @property
    def fast_varying(self) -> list[int]:
        """Numbers, in the scene, of the bodies and points whose motion varies too fast for few times of the frame."""
    @property
    def plan(self) -> str:
        """A line per sum over a group of paths."""
    @property
    def counts(self) -> dict[str, int]:
        """Numbers of rays, hits, tiles, paths, node times and so on, by name."""
    @property
    def stage_times(self) -> list[tuple[str, float]]:
        """Run time of every stage [s], by name."""

@final
class Simulator:
    """Simulates frames, paths and images; keeps what did not move from one to the next."""

    def __new__(
        cls,
        source: Scene | DepthScene,
        materials: Sequence[Material],
        *,
        antennas: Antennas,
        waveform: Waveform,
        center: Sequence[float],
        settings: Mapping[str, Any],
        threads: int | None = None,
        own_threads: bool = False,
    ) -> Simulator:
        """Of a scene with one material per surface, or of a depth image.

        `center`: middle of the array in sensor axes (x, y, z) [m]; `settings`: the dict of `core_settings`;
        `own_threads`: the number of threads is given, and other simulators have none of them.
        """
    def frame(self, motion: Placement, rates: Placement | None = None) -> IdealFrame | None:
        """The frame of a motion at Chebyshev times of the frame; `rates`: its derivatives if all times are the same.

        None where the motion needs more times.
        """
    def worlds(self, own: Placement, moved: NDArray[np.float64], rows: list[int]) -> list[IdealFrame] | None:
        """Frames of worlds that differ in their motion alone; None where a motion needs more times.

        `moved`: poses (time, world, n, 3, 4) that take the place of the `own` ones, of the bodies `rows`: bodies, the
        sensor and points are counted in this order.
        """
    def paths(
        self, motion: Placement, at: Placement, rates_at: Placement
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.complex128], NDArray[np.uint32], NDArray[np.uint8]]:
        """Delays [s], delay rates [s/s] and amplitudes [sqrt(W)] (channel, path), bodies and orders (path,).

        Of what rays see in the first part of a frame, at a time at which everything is `at` and changes by `rates_at`.
        """
    def stop(self) -> None:
        """Stop the run in progress in another thread, if there is one: it ends between two stages, with an error."""
    def image(self, at: Placement) -> _ImageArrays:
        """Hits of the rays of an image at one time.

        Distances along the rays [m], inf where nothing was hit, cosines of incidence, 0 there, and numbers of the
        bodies, -1 there, (rows, columns); distances to the surface that the facets stand for [m], and its unit normals
        towards the sensor, (rows, columns, 3).
        """
    def occluded(self, at: Placement, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Points (n, 3) in sensor axes about the middle of the array that a body occludes, (n,)."""
