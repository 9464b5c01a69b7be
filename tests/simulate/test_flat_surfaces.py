"""Plates and boxes at random places against physical optics over their faces, by quadrature."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from proof.bounds import flat_bounds
from proof.faces import Cuboid, placed, section
from proof.flat_surfaces import TARGETS, flat_results
from proof.measure import FULL, SPEED_OF_LIGHT, Phasors, frame, frequencies, sweep, tone

WAVENUMBERS = np.array([2.0 * np.pi * 60e9 / SPEED_OF_LIGHT])
SETTINGS: dict[float, dict[str, Any]] = {4e-4: {}, 3e-5: {"rcs_floor": 1e-4}}
"""Options by the floor of errors that they promise [m²]; an error is also below 1e-4 of the echo."""


def fields(body: rc.Body, radar: rc.Radar, **options: Any) -> Phasors:
    """H of every channel, (channel, 1)."""
    sim = rc.Simulator(rc.Scene([body]), radar, tolerance=1e-9, threads=1, **options)
    return frame(sim).cube[:, 0].conj()


def assert_exact(cuboid: Cuboid, expected: Phasors, radar: rc.Radar, **material: rc.Material) -> None:
    distance = float(np.linalg.norm(cuboid.pose.position))
    echoes = section(expected, distance, WAVENUMBERS)
    for floor, options in SETTINGS.items():
        got = fields(cuboid.body(**material), radar, **options)
        errors = section(got - expected, distance, WAVENUMBERS)
        assert (errors <= np.maximum(floor, 1e-4 * echoes)).all(), (options, cuboid, errors, echoes)


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("is_box", [False, True], ids=["plate", "box"])
def test_cuboid_anywhere_is_physical_optics_over_its_faces(seed: int, is_box: bool) -> None:
    # By default edges of less than 1e-4 m^2 are left out.
    rng, radar = np.random.default_rng(seed), rc.Radar(tone())
    for _ in range(25):
        cuboid = placed(rng, None, is_box=is_box)
        assert_exact(cuboid, cuboid.field(WAVENUMBERS), radar)


TX, RX = np.array([[0.0, 0.05, 0.0], [0.01, 0.0, -0.05]]), np.array([[0.0, -0.05, 0.0], [-0.02, 0.0, 0.05]])


@pytest.mark.parametrize("is_box", [False, True], ids=["plate", "box"])
def test_every_channel_of_a_wide_array_has_its_own_field(is_box: bool) -> None:
    rng, radar, number = np.random.default_rng(1), rc.Radar(tone(), tx=TX, rx=RX), 0
    while number < 8:
        cuboid = placed(rng, None, is_box=is_box)
        # Faces that some antennas see and others do not have no agreed field.
        seen = {len(list(Cuboid(cuboid.edges, rc.Pose(-at) @ cuboid.pose).faces())) for at in (*TX, *RX)}
        if len(seen) == 1:
            assert_exact(cuboid, cuboid.field(WAVENUMBERS, tx=TX, rx=RX), radar)
            number += 1


def test_dielectric_plate_reflects_by_the_angle_of_incidence() -> None:
    permittivity = 5.24 - 0.4j

    def fresnel(cosine: Any) -> Any:
        """Without polarisation: mean power of TE and TM, with the phase of TE."""
        root = np.sqrt(permittivity - 1.0 + cosine**2)
        te, tm = (cosine - root) / (cosine + root), (permittivity * cosine - root) / (permittivity * cosine + root)
        return te / np.abs(te) * np.sqrt(0.5 * (np.abs(te) ** 2 + np.abs(tm) ** 2))

    rng, radar, material = np.random.default_rng(1), rc.Radar(tone()), rc.Material.dielectric(permittivity)
    for tilt_deg in np.linspace(0.0, 70.0, 15):
        plate = placed(rng, tilt_deg, is_box=False)
        assert_exact(plate, plate.field(WAVENUMBERS, reflection=fresnel), radar, material=material)


@pytest.mark.parametrize("name", [name for name in TARGETS if name.startswith("partly hidden")])
def test_partly_hidden_plate_keeps_the_bound_of_the_page(name: str) -> None:
    results = list(flat_results(replace(FULL, placements=2), [name]))
    assert [bound.what for bound in flat_bounds(results) if not bound.is_held] == []


def plate_paths(mesh: rc.Mesh) -> rc.Paths:
    body = rc.Body(
        mesh, material=rc.materials["perfect_conductor"], motion=rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.2, 0.1, 0.3])
    )
    return rc.Simulator(rc.Scene([body]), rc.Radar(tone()), rcs_floor=1e-4).paths()


def field_of(paths: rc.Paths) -> complex:
    return complex((paths.amplitude[0] * np.exp(-1j * WAVENUMBERS[0] * SPEED_OF_LIGHT * paths.delay[0])).sum())


def test_a_sheet_with_both_sides_returns_as_much_as_one() -> None:
    plate = rc.shapes.plate(0.2, 0.15)
    both = rc.Mesh(plate.vertices, np.concatenate([plate.triangles, plate.triangles[:, ::-1]]))
    one, two = field_of(plate_paths(plate)), field_of(plate_paths(both))
    distance = 1.0
    assert float(section(np.array([one - two]), distance, WAVENUMBERS)) <= 1e-3
    assert abs(20.0 * np.log10(abs(two / one))) < 3.0


@pytest.mark.parametrize(
    "place", [[1.0, 0.05, 0.0], [1.0, 0.05, 0.05], [1.0, -0.05, 0.02]], ids=["edge", "corner", "edge aside"]
)
def test_the_foot_on_an_edge_or_a_corner_leaves_its_part_of_the_mirror(place: list[float]) -> None:
    # Rounding decides on which side of the edge the foot is, in any other axes in another way.
    rng, radar = np.random.default_rng(2), rc.Radar(tone())
    for scale in (0.0, 0.1, 0.3, 0.3, 0.3, 0.3):
        turn = rc.Pose.from_rpy([0.0, 0.0, 0.0], list(scale * rng.uniform(-1.0, 1.0, 3)))
        cuboid = Cuboid(np.array([0.0, 0.1, 0.1]), turn @ rc.Pose(place))
        assert_exact(cuboid, cuboid.field(WAVENUMBERS), radar)


def test_what_is_behind_the_sensor_hides_nothing() -> None:
    cuboid, radar = (
        Cuboid(np.array([0.0, 0.3, 0.2]), rc.Pose.from_rpy([1.0, 0.0, 0.0], [0.0, 0.2, 0.3])),
        rc.Radar(tone()),
    )
    behind = rc.Body(rc.shapes.plate(4.0, 4.0), motion=rc.Pose([-0.5, 0.0, 0.0]))
    scenes = [rc.Scene(bodies) for bodies in ([cuboid.body()], [cuboid.body(), behind])]
    alone, both = (rc.Simulator(scene, radar).paths() for scene in scenes)
    np.testing.assert_array_equal(both.amplitude, alone.amplitude)


@pytest.mark.parametrize("time", [0.0, 0.1, 0.2])
def test_ten_turning_boxes_are_physical_optics_over_their_faces(time: float) -> None:
    """The boxes of `benches/frame.py`. Each hides at most the outermost degree of its neighbour."""
    waveform = sweep(64)
    wavenumbers = 2.0 * np.pi * frequencies(waveform) / SPEED_OF_LIGHT
    cuboids = []
    for k in range(10):
        start = rc.Pose([2.0 + 0.1 * k, 0.3 * k - 1.35, 0.0])
        motion = rc.Linear(start, velocity=[0.1 * k - 0.5, 0.0, 0.0], angular_velocity=[0.0, 0.1, 0.3 * k])
        cuboids.append(Cuboid(np.full(3, 0.2), motion.at(time)))
    expected = np.sum([cuboid.field(wavenumbers)[0] for cuboid in cuboids], axis=0)
    for options in ({}, {"rcs_floor": 1e-4}):
        sim = rc.Simulator(
            rc.Scene(cuboid.body() for cuboid in cuboids),
            rc.Radar(waveform),
            field_of_view_deg=(120.0, 60.0),
            tolerance=1e-9,
            **options,
        )
        got = frame(sim).cube[0, 0].conj()
        profiles = [np.abs(np.fft.ifft(field * np.hanning(64), 256)) for field in (got, expected)]
        assert np.linalg.norm(profiles[0] - profiles[1]) <= 0.2 * np.linalg.norm(profiles[1])
        assert section(got - expected, 2.4, wavenumbers) <= 1e-3
