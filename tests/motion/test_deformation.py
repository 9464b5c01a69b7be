"""Bodies that change their shape: rigid motion written as vertices, a chest that breathes, speckle and history."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import radarcore as rc

C = 299_792_458.0

TX = [[0.0, -0.005, 0.0]]
RX = [[0.0, 0.004, 0.001], [0.0, 0.0, -0.003]]
HALF_MATT = rc.Material(-0.5, 0.5)

SYNTHESIS = 1e-8
"""Two frames of a tolerance of 1e-9, which is an rms error relative to l2(amplitudes): peaks are a few times that."""

Vertices = NDArray[np.float64]
Shape = Callable[[float], Vertices]


WAVEFORM = rc.Waveform(
    start_frequency=60e9, slope=2e13, sample_rate=2e6, num_samples=32, num_chirps=8, chirp_interval=300e-6
)


def waveform(**changes: Any) -> rc.Waveform:
    return WAVEFORM.replace(**changes)


def simulator(bodies: list[Any], radar: rc.Radar | None = None, **options: Any) -> rc.Simulator:
    settings: dict[str, Any] = {"resolution": 48, "field_of_view_deg": (40.0, 40.0), "tolerance": 1e-9} | options
    return rc.Simulator(
        rc.Scene(bodies), radar or rc.Radar(waveform(), tx=TX, rx=RX), **{"sampling": "footprint", **settings}
    )


def instant() -> rc.Radar:
    """A radar whose frame is over at once: its rays are cast at the time of `paths`, one antenna at the origin."""
    return rc.Radar(waveform(num_samples=1, num_chirps=1))


def relative_error(got: NDArray[Any], expected: NDArray[Any]) -> float:
    """Largest error over the largest value."""
    return float(np.abs(got - expected).max() / np.abs(expected).max())


def grid(cells: int = 6, size: float = 0.5) -> rc.Mesh:
    """A square of many triangles in the y-z plane that faces -x."""
    steps = np.linspace(-0.5 * size, 0.5 * size, cells + 1)
    y, z = np.meshgrid(steps, steps, indexing="ij")
    vertices = np.stack([np.zeros_like(y), y, z], axis=-1).reshape(-1, 3)
    a = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    b, c, d = a + 1, a + cells + 2, a + cells + 1
    return rc.Mesh(vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def wave(mesh: rc.Mesh, frequency: float = 3.0) -> Shape:
    """The mesh with a standing wave of 1 cm."""
    y, z = mesh.vertices[:, 1], mesh.vertices[:, 2]

    def vertices(time: float) -> Vertices:
        height = 0.01 * np.sin(2.0 * np.pi * frequency * time) * np.cos(9.0 * y) * np.cos(7.0 * z + 0.3)
        return mesh.vertices + height[:, None] * [1.0, 0.2, 0.0]

    return vertices


BREATH, RATE, RADIUS, DISTANCE = 0.004, 0.3, 0.15, 1.0
"""A chest: amplitude [m], breaths per second, radius and distance [m]."""


def radius_at(time: float) -> float:
    return RADIUS + BREATH * float(np.sin(2.0 * np.pi * RATE * time))


def chest() -> rc.Body:
    """A sphere that breathes, one of its vertices towards the sensor."""
    mesh = rc.shapes.sphere(RADIUS)
    unit = mesh.vertices / RADIUS
    towards = rc.Pose.look_at([0.0, 0.0, 0.0], -unit[0]).rotation.T
    return rc.Body(mesh, motion=rc.Pose([DISTANCE, 0.0, 0.0], towards), deformation=lambda t: radius_at(t) * unit)


# --- rigid motion, written as vertices -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mesh", "phase", "radar_motion"),
    [
        (rc.shapes.box((0.3, 0.5, 0.4)), SYNTHESIS, rc.Pose()),
        # Normals at corners are stored in f32, 6e-8: surfaces over facets of 2 cm are known to 1e-9 m, 2e-6 rad.
        (rc.shapes.sphere(0.2, subdivisions=3), 1e-5, rc.Linear(rc.Pose(), velocity=[0.4, 0.7, -0.2])),
    ],
    ids=["flat, fixed sensor", "curved, moving sensor"],
)
def test_vertices_that_turn_make_the_frame_of_the_turning_body(mesh: rc.Mesh, phase: float, radar_motion: Any) -> None:
    start = rc.Pose.from_rpy([0.0, 0.0, 0.0], [0.3, 0.2, 0.4])
    turning = rc.Linear(start, angular_velocity=[2.0, -1.0, 3.0])
    place = rc.Pose([1.5, 0.1, -0.05])
    deformed = rc.Body(
        mesh, material=HALF_MATT, motion=place, deformation=lambda t: turning.at(t).apply(mesh.vertices), name="ball"
    )
    rigid = rc.Body(mesh, material=HALF_MATT, motion=rc.Attached(place, turning), name="ball")
    radar = rc.Radar(waveform(num_chirps=32), tx=TX, rx=RX)  # 10 ms: 2 degrees
    # Random points at the limb would turn out of sight within the frame.
    options: dict[str, Any] = {"radar_motion": radar_motion, "sampling": "point"}
    here, there = (simulator([body], radar, **options) for body in (deformed, rigid))
    time = 0.05
    assert relative_error(here.frame(time).cube, there.frame(time).cube) <= phase
    got, expected = here.paths(time), there.paths(time)
    np.testing.assert_allclose(C * got.delay, C * expected.delay, rtol=0, atol=8e-9)  # as above, and more at the limb
    # A surface 1e-9 m off turns with it; differences of a function of time are good to 1e-12 m/s.
    np.testing.assert_allclose(0.5 * C * got.delay_rate, 0.5 * C * expected.delay_rate, rtol=0, atol=2e-8)


def test_a_deformation_that_never_changes_is_the_body_as_it_is() -> None:
    mesh = rc.shapes.sphere(0.2, subdivisions=3)
    # Matt, so that every phase belongs to its place on the surface.
    bodies = [
        rc.Body(mesh, material=HALF_MATT, motion=rc.Pose([1.5, 0.1, 0.0]), deformation=deformation)
        for deformation in (None, lambda _: mesh.vertices, rc.Deformation([0.0, 1.0], [mesh.vertices] * 2))
    ]
    rigid, *others = (simulator([body]) for body in bodies)
    for same in others:
        image, expected = same.depth_image(0.3), rigid.depth_image(0.3)
        for name in ("distance", "body", "surface_distance", "normals"):
            np.testing.assert_array_equal(getattr(image, name), getattr(expected, name))
        # Points are taken to their facets and back: rounding.
        paths, as_it_is = same.paths(0.3), rigid.paths(0.3)
        np.testing.assert_allclose(paths.delay, as_it_is.delay, rtol=1e-15, atol=0)
        assert relative_error(paths.amplitude, as_it_is.amplitude) <= 1e-13
        assert not paths.delay_rate.any()
        assert relative_error(same.frame(0.3).cube, rigid.frame(0.3).cube) <= SYNTHESIS


def test_speckle_stays_on_a_surface_that_swells() -> None:
    # Matt facets of 3 mm on a plate that grows by a tenth: their phases go with them.
    mesh = grid(cells=40, size=0.12)
    grown = rc.Body(
        mesh,
        material=rc.Material.lambertian(1.0),
        motion=rc.Pose([1.1, 0.0, 0.0]),
        deformation=lambda _: 1.1 * mesh.vertices,
    )
    plain = rc.Body(mesh, material=rc.Material.lambertian(1.0), motion=rc.Pose([1.0, 0.0, 0.0]))
    # At 1.1 of the distance the same points are in view.
    here, there = (simulator([body], instant(), field_of_view_deg=(6.0, 6.0)).paths() for body in (plain, grown))
    assert here.amplitude.shape[1] > 700
    np.testing.assert_allclose(np.angle(there.amplitude / here.amplitude), 0.0, atol=1e-6)
    # A patch has 1.1^2 of the area, and its power falls with 1.1^4.
    np.testing.assert_allclose(np.abs(there.amplitude / here.amplitude), 1.0 / 1.1, rtol=1e-9)


# --- a chest that breathes -------------------------------------------------------------------------------------------


def test_nearest_point_of_a_breathing_chest_is_where_and_as_fast_as_on_paper() -> None:
    time = 0.4
    distance = DISTANCE - radius_at(time)
    velocity = -BREATH * 2.0 * np.pi * RATE * np.cos(2.0 * np.pi * RATE * time)
    sim = simulator([chest()], instant(), resolution=65, field_of_view_deg=(20.0, 20.0))  # odd: a ray along the axis
    paths = sim.paths(time)
    nearest = paths.delay[0].argmin()
    assert 0.5 * C * paths.delay[0, nearest] == pytest.approx(distance, abs=1e-14)
    assert paths.delay_rate[0, nearest] == pytest.approx(2.0 * velocity / C, abs=2e-12 / C)  # differences of a function
    truth = sim.frame(time).truth
    assert truth is not None
    assert truth.range == pytest.approx([distance], abs=1e-14)
    assert truth.velocity == pytest.approx([velocity], abs=1e-12)


# --- within a frame --------------------------------------------------------------------------------------------------


def test_delay_rate_is_the_derivative_of_delay() -> None:
    radar_motion = rc.Linear(rc.Pose(), velocity=[0.4, 0.7, -0.2], angular_velocity=[0.5, -0.3, 0.8])
    # Frames that start h earlier and last 2 h longer have the same middle, hence the same material points.
    h, start, mesh = 2e-5, 0.02, rc.shapes.sphere(0.25, subdivisions=3)
    motion = rc.Linear(rc.Pose([1.4, 0.1, 0.0]), velocity=[0.8, -0.5, 0.3], angular_velocity=[2.0, -1.0, 3.0])
    body = rc.Body(mesh, material=HALF_MATT, motion=motion, deformation=wave(mesh))

    def paths(shift: float) -> rc.Paths:
        wf = waveform(num_chirps=2, chirp_interval=None, chirp_times=[0.0, 1e-3 - 2.0 * shift])
        return simulator([body], rc.Radar(wf, tx=TX, rx=RX), radar_motion=radar_motion).paths(start + shift)

    before, now, after = paths(-h), paths(0.0), paths(h)
    assert now.delay.shape[1] > 100
    difference = (after.delay - before.delay) / (2.0 * h)
    # In m/s: delays of 10 ns are known to 1e-24 s (1e-11 m/s); h^2 / 6 times a third derivative of at most 300 m/s^3.
    np.testing.assert_allclose(0.5 * C * now.delay_rate, 0.5 * C * difference, rtol=0, atol=5e-8)


@pytest.mark.filterwarnings("ignore:field_of_view_deg. expected degrees")
def test_frame_follows_vertices_through_its_chirps() -> None:
    # A flat facet on the axis swings by 1 cm at 30 Hz, a quarter of a turn in the frame: every chirp has its own delay.
    mesh = rc.shapes.plate(0.2, 0.2)
    wf = waveform(num_chirps=32, chirp_interval=260e-6, num_samples=1)

    def swing(time: float) -> Vertices:
        return mesh.vertices + np.array([0.01 * np.sin(60.0 * np.pi * time), 0.0, 0.0])

    body = rc.Body(mesh, material=HALF_MATT, motion=rc.Pose([1.0, 0.0, 0.0]), deformation=swing)
    # One ray straight ahead, one antenna where it begins: one path.
    sim = simulator([body], rc.Radar(wf), resolution=1, field_of_view_deg=(1.0, 1.0), sampling="point")
    (samples,) = sim.frame().cube[..., 0]
    distance = 1.0 + 0.01 * np.sin(60.0 * np.pi * wf.chirp_times)
    delay = 2.0 * distance / C
    turns = 60e9 * delay - 0.5 * 2e13 * delay**2
    expected = np.exp(2j * np.pi * turns) / distance**2
    assert relative_error(samples / samples[0], expected / expected[0]) <= SYNTHESIS


@pytest.mark.filterwarnings("ignore:.* beyond max_velocity")
def test_quick_vertices_are_placed_at_as_many_times_as_they_need() -> None:
    # Three cycles of 10 rad of phase in a frame, as vertices and as a motion of the whole body.
    mesh, frame = grid(), waveform().duration

    def shift(time: float) -> float:
        return 4e-3 * float(np.sin(6.0 * np.pi * time / frame))

    as_vertices = rc.Body(
        mesh,
        motion=rc.Pose([1.0, 0.0, 0.0]),
        deformation=lambda time: mesh.vertices + np.array([shift(time), 0.0, 0.0]),
    )
    as_motion = rc.Body(mesh, motion=lambda time: rc.Pose([1.0 + shift(time), 0.0, 0.0]))
    got, expected = (simulator([body]).frame() for body in (as_vertices, as_motion))
    assert got.stats["delay_nodes"] == expected.stats["delay_nodes"] >= 16
    assert relative_error(got.cube, expected.cube) < SYNTHESIS


# --- history ---------------------------------------------------------------------------------------------------------


def test_hits_after_many_deformations_are_those_of_a_mesh_made_of_the_vertices() -> None:
    mesh = rc.shapes.sphere(0.25, subdivisions=4)
    shape = wave(mesh)
    place = rc.Pose([1.4, 0.1, 0.0])
    # Two that stand still beside it: tiles that show only these are taken over from the image before.
    still = [
        rc.Body(rc.shapes.box(0.2), material=HALF_MATT, motion=rc.Pose([1.5, y, 0.3]), name=name)
        for y, name in [(-0.35, "right"), (0.45, "left")]
    ]
    deforming = rc.Body(mesh, material=HALF_MATT, motion=place, deformation=shape)
    old, new = (simulator([deforming, *still], resolution=96) for _ in range(2))
    for time in np.linspace(-1.0, 2.0, 12):
        old.depth_image(time)
    time = 2.08
    remade = rc.Body(rc.Mesh(shape(time), mesh.triangles), material=HALF_MATT, motion=place)
    fresh = simulator([remade, *still], resolution=96)
    images = [sim.depth_image(time) for sim in (old, new, fresh)]
    assert min((images[0].body == number).sum() for number in range(3)) > 100
    for name in ("distance", "body", "cos_incidence", "surface_distance", "normals"):
        for image in images[:2]:
            np.testing.assert_array_equal(getattr(image, name), getattr(images[2], name))
    for later in (time, time + 0.01):
        ahead, behind = old.frame(later), simulator([deforming, *still], resolution=96).frame(later)
        np.testing.assert_array_equal(ahead.cube, behind.cube)
    assert ahead.stats["tiles_reused"] > 0
    assert behind.stats["tiles_reused"] == 0


def test_bodies_of_one_mesh_deform_each_by_itself() -> None:
    mesh = grid(size=0.2)
    sheets = [
        rc.Body(mesh, motion=rc.Pose([1.0, y, 0.0]), deformation=deformation)
        for y, deformation in [(-0.3, None), (0.0, wave(mesh)), (0.3, lambda t: wave(mesh)(2.0 * t))]
    ]
    together = simulator(sheets).depth_image(0.03)
    for number, sheet in enumerate(sheets):
        alone = simulator([sheet]).depth_image(0.03)
        np.testing.assert_array_equal(
            alone.distance[together.body == number], together.distance[together.body == number]
        )
        assert (together.body == number).sum() > 50


def test_shape_at_rest_is_cast_once() -> None:
    mesh = grid()
    later = mesh.vertices + np.array([0.1, 0.0, 0.0])
    deformation = rc.Deformation([0.0, 1.0], [mesh.vertices, later])
    sim = simulator([rc.Body(mesh, motion=rc.Pose([1.0, 0.0, 0.0]), deformation=deformation)])
    # Beyond the end nothing moves.
    cast = [sim.frame(time).stats["rays_cast"] for time in (0.5, 0.6, 2.0, 3.0)]
    assert min(cast[:3]) > 0
    assert cast[3] == 0


# --- splines ---------------------------------------------------------------------------------------------------------


def test_deformation_passes_through_its_vertices_and_stays_at_the_last() -> None:
    times = np.array([0.0, 0.1, 0.25, 0.4])
    vertices = np.random.default_rng(0).uniform(-1.0, 1.0, (4, 7, 3))
    deformation = rc.Deformation(times, vertices)
    for time, there in zip(times, vertices, strict=True):
        np.testing.assert_allclose(deformation.at(time), there, rtol=0, atol=1e-15)
    for time, k in [(-5.0, 0), (7.0, -1)]:
        np.testing.assert_array_equal(deformation.at(time), vertices[k])
        np.testing.assert_array_equal(deformation.rate_at(time), np.zeros((7, 3)))
    step = 1e-5
    difference = (deformation.at(0.2 + step) - deformation.at(0.2 - step)) / (2.0 * step)
    np.testing.assert_allclose(deformation.rate_at(0.2), difference, rtol=0, atol=1e-6)  # step^2 / 6 of 6000 m/s^3
    assert repr(deformation) == "<Deformation: 7 vertices at 4 times, 0 to 0.4 s>"


# --- silly input -----------------------------------------------------------------------------------------------------

PLATE = rc.shapes.plate(0.2, 0.2)


@pytest.mark.filterwarnings("ignore:no body is seen")
def test_a_body_that_shrinks_to_nothing_and_turns_inside_out_is_silent_or_seen() -> None:
    body = rc.Body(PLATE, material=HALF_MATT, motion=rc.Pose([1.0, 0.0, 0.0]), deformation=lambda t: t * PLATE.vertices)
    sim = simulator([body])
    middle = 0.5 * sim.radar.waveform.duration
    assert not sim.frame(-middle).cube.any()  # no rays meet it in the middle of the frame
    for time in (-middle + 1e-6, -1.0, 1.0):
        assert np.isfinite(sim.frame(time).cube).all()
