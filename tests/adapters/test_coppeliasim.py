"""CoppeliaSim: the real client against a server that speaks the protocol, with a scene known on paper."""

from __future__ import annotations

import os
import re
import runpy
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from doubles.coppelia_stub import ANGLE, BALL, FAR, GREYS, HEIGHT, PLATE_AT, PLATE_VELOCITY, RADIUS, TIME_STEP, Stub
from radarcore.adapters import coppeliasim

RADAR = rc.bgt60tr13c(start_frequency=60e9, stop_frequency=61e9, num_samples=128, num_chirps=64, chirp_interval=300e-6)
SINGLE = 1e-6  # float32 of 10 m


@pytest.fixture
def stub() -> Iterator[Stub]:
    with Stub() as stub:
        yield stub


@pytest.fixture
def simulator(stub: Stub) -> Iterator[coppeliasim.CoppeliaSim]:
    with connected(stub) as simulator:
        yield simulator


def connected(stub: Stub, timeout: float = 10.0) -> coppeliasim.CoppeliaSim:
    return coppeliasim.CoppeliaSim("127.0.0.1", stub.port, timeout=timeout)


# Images


def test_both_options_of_depth_give_the_same_metres(simulator: coppeliasim.CoppeliaSim, stub: Stub) -> None:
    sensor = simulator.vision_sensor("/radar")
    metres, fractions = sensor.image(metres=True).depth, sensor.image(metres=False).depth
    truth = stub.seen(0.0)[0]
    expected = np.where(truth < FAR, truth, np.inf)
    np.testing.assert_allclose(metres, expected, rtol=0, atol=SINGLE)
    np.testing.assert_allclose(fractions, expected, rtol=0, atol=2 * SINGLE)


@pytest.mark.parametrize(("columns", "rows"), [(40, 24), (24, 40), (31, 31)])
def test_points_are_those_of_the_scene_in_images_of_any_sides(columns: int, rows: int) -> None:
    with Stub(columns, rows) as stub, connected(stub) as simulator:
        image = simulator.vision_sensor("/radar").image()
    assert image.depth.shape == image.grey.shape == (rows, columns)
    # The angle belongs to the larger side.
    assert image.camera.fx == image.camera.fy == pytest.approx(0.5 * max(rows, columns) / np.tan(0.5 * ANGLE))
    world = image.pose.apply(image.planar.points)
    is_ball = image.grey[image.planar.valid] == GREYS["ball"]
    assert is_ball.sum() > 10
    np.testing.assert_allclose(np.linalg.norm(world[is_ball] - BALL, axis=1), RADIUS, atol=2 * SINGLE)
    np.testing.assert_allclose(world[~is_ball, 0], PLATE_AT, atol=SINGLE)
    assert (np.abs(world[~is_ball, 1:] - [0.0, HEIGHT]) < 0.5).all()


def test_ball_is_up_on_the_left_and_nothing_is_behind_the_plate(simulator: coppeliasim.CoppeliaSim) -> None:
    image = simulator.vision_sensor("/radar").image()
    rows, columns = np.nonzero(image.grey == GREYS["ball"])
    assert rows.max() < image.grey.shape[0] / 2
    assert columns.max() < image.grey.shape[1] / 2
    np.testing.assert_array_equal(np.isinf(image.depth), image.grey == GREYS["nothing"])
    points = image.planar.points[image.grey[image.planar.valid] == GREYS["ball"]]
    assert (points[:, 1:] > 0.0).all()


def test_radar_at_the_sensor_looks_where_it_looks(simulator: coppeliasim.CoppeliaSim) -> None:
    sensor = simulator.vision_sensor("/radar")
    for pose in (sensor.image().pose, sensor.motion.at(0.0)):
        np.testing.assert_allclose(pose.rotation, np.eye(3), atol=1e-12)  # along x, upright
        np.testing.assert_allclose(pose.position, [0.0, 0.0, HEIGHT])


def test_sensor_that_is_handled_explicitly_is_made_to_look(simulator: coppeliasim.CoppeliaSim, stub: Stub) -> None:
    sensor = simulator.vision_sensor("/radar")
    sensor.image()
    assert stub.looks == 0
    sensor.image(handle=True)
    assert stub.looks == 1
    assert stub.calls.index("sim.handleVisionSensor") < len(stub.calls) - stub.calls[::-1].index(
        "sim.getVisionSensorDepth"
    )


def test_orthographic_sensor_is_refused(simulator: coppeliasim.CoppeliaSim) -> None:
    with pytest.raises(ValueError, match="/orthographic: expected a vision sensor of perspective type"):
        simulator.vision_sensor("/orthographic")


def test_near_plane_that_costs_phase_is_warned_of() -> None:
    # 9 x 9.99/(10 x 0.01 x 2^24)/sqrt(12) is 15.5 um, times 720 / 5 mm is 2.2 degrees.
    message = r"got 0\.01 m: .* 15 um rms, 2\.2 degrees of phase at 60 GHz"
    with Stub(near=0.01) as stub, connected(stub) as simulator, pytest.warns(UserWarning, match=message):
        simulator.vision_sensor("/radar")


# Steps


def test_a_step_advances_the_time_by_the_time_step(simulator: coppeliasim.CoppeliaSim) -> None:
    with simulator.running():
        assert simulator.time == 0.0
        assert [simulator.step() for _ in range(3)] == pytest.approx([TIME_STEP, 2 * TIME_STEP, 3 * TIME_STEP])
        assert simulator.time == pytest.approx(3 * TIME_STEP)
        assert simulator.time_step == TIME_STEP


def test_stepping_is_set_before_the_start_and_the_simulation_stopped_at_the_end(
    simulator: coppeliasim.CoppeliaSim, stub: Stub
) -> None:
    with simulator.running():
        assert stub.is_stepping
        assert stub.is_running
        simulator.step()
    assert not stub.is_running
    assert not stub.is_stepping
    order = [call for call in stub.calls if call in ("sim.setStepping", "sim.startSimulation", "sim.stopSimulation")]
    assert order == ["sim.setStepping", "sim.startSimulation", "sim.stopSimulation", "sim.setStepping"]


@pytest.mark.usefixtures("hears_interrupts")
def test_simulation_is_stopped_after_an_interrupt_in_the_midst_of_a_step(
    simulator: coppeliasim.CoppeliaSim, stub: Stub, monkeypatch: pytest.MonkeyPatch
) -> None:
    advance = stub._advance

    def slow() -> dict[str, Any]:
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.1)
        return advance()

    monkeypatch.setattr(stub, "_advance", slow)
    with pytest.raises(KeyboardInterrupt), simulator.running():
        simulator.step()
    assert not stub.is_running


def test_simulation_can_run_again(simulator: coppeliasim.CoppeliaSim) -> None:
    (plate,) = simulator.bodies("/plate")
    for _ in range(2):
        with simulator.running():
            assert plate.motion.at(0.0).position[0] == PLATE_AT
            simulator.step()
            assert plate.motion.at(TIME_STEP).position[0] == pytest.approx(PLATE_AT + TIME_STEP * PLATE_VELOCITY)


# Bodies and motions


def test_shapes_are_bodies_with_all_their_items(simulator: coppeliasim.CoppeliaSim) -> None:
    plate, ball = simulator.bodies()
    assert (plate.name, ball.name) == ("plate", "ball")
    np.testing.assert_allclose(plate.mesh.bounds, [[0, -0.5, -0.5], [0, 0.5, 0.5]])
    assert plate.mesh.area == pytest.approx(1.0)
    assert ball.mesh.volume == pytest.approx(1e-3)  # a cube of 10 cm, its normals outwards


def test_hidden_shapes_are_left_out_unless_they_are_wanted(simulator: coppeliasim.CoppeliaSim) -> None:
    assert [body.name for body in simulator.bodies("/ball")] == ["ball"]
    assert [body.name for body in simulator.bodies("/ball", hidden=True)] == ["ball", "ball/proxy"]


def test_still_bodies_are_at_rest_and_take_no_calls(simulator: coppeliasim.CoppeliaSim, stub: Stub) -> None:
    wood = rc.materials["wood"]
    (ball,) = simulator.bodies("/ball", still=True, material=wood)
    assert rc.Scene([ball]).is_static
    assert ball.material is wood
    with simulator.running():
        before = stub.calls.count("sim.getObjectMatrix")
        simulator.step()
        assert stub.calls.count("sim.getObjectMatrix") == before


def test_bodies_move_as_in_the_simulation(simulator: coppeliasim.CoppeliaSim) -> None:
    plate, ball = simulator.bodies()
    arm = simulator.motion("/arm", rc.Pose([1.0, 0.0, 0.0]))
    with simulator.running():
        for _ in range(2):
            now = simulator.step()
        assert plate.motion.at(now).position == pytest.approx([PLATE_AT + PLATE_VELOCITY * now, 0.0, HEIGHT])
        assert plate.motion.rate_at(now)[:, 3] == pytest.approx([PLATE_VELOCITY, 0.0, 0.0])
        assert ball.motion.rate_at(now) == pytest.approx(np.zeros((3, 4)))
        # It turns about z with 1 rad/s.
        assert arm.at(now).position == pytest.approx([np.cos(now), np.sin(now), 0.0])
        assert arm.rate_at(now)[:, 3] == pytest.approx([-np.sin(now), np.cos(now), 0.0], abs=1e-9)


def test_everything_else_is_the_api_of_the_client(simulator: coppeliasim.CoppeliaSim, stub: Stub) -> None:
    assert simulator.sim.getJointPosition(4) == 1.0
    assert stub.calls.count("sim.getJointPosition") == 2  # the server asked for it again
    assert stub.first["ver"] == 2
    assert stub.first["lang"] == "python"


EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "coppeliasim_scene.py"


def example(*arguments: str) -> subprocess.CompletedProcess[str]:
    """The example's run, in a fresh interpreter."""
    path = os.pathsep.join([str(Path(rc.__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, "-W", "error", str(EXAMPLE), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | {"PYTHONPATH": path})


def test_example_finds_the_plate_on_both_routes(
    stub: Stub, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.argv", [str(EXAMPLE), f"127.0.0.1:{stub.port}"])
    runpy.run_path(str(EXAMPLE), run_name="__main__")
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 20
    assert not stub.is_running
    for number, line in enumerate(lines, 1):
        found = re.fullmatch(r"(.*) s: meshes (.*) m (.*) m/s, depth image (.*) m (.*) m/s", line)
        assert found, line
        time, *values = map(float, found.groups())
        assert time == pytest.approx(number * TIME_STEP)
        if number > 1:  # velocities are differences
            assert values[1::2] == pytest.approx([PLATE_VELOCITY] * 2, abs=RADAR.waveform.velocity_resolution)
        assert values[::2] == pytest.approx([stub.plate_at(time)] * 2, abs=RADAR.waveform.range_resolution)


# Errors


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def test_no_server_is_one_error_with_address_and_hint_within_the_timeout() -> None:
    port = free_port()
    began = time.monotonic()
    with pytest.raises(coppeliasim.CoppeliaSimError) as caught:
        coppeliasim.CoppeliaSim("127.0.0.1", port, timeout=0.3)
    assert time.monotonic() - began < 1.0
    assert isinstance(caught.value, OSError)
    message = str(caught.value)
    assert message.startswith(f"tcp://127.0.0.1:{port}: expected an answer to zmqRemoteApi.require within 0.3 s")
    assert "is CoppeliaSim running, with its ZMQ remote API server on this port?" in message
    assert "\n" not in message


def test_example_without_a_server_prints_the_hint() -> None:
    done = example(f"127.0.0.1:{free_port()}", "/radar", "0.3")
    assert done.returncode == 1
    assert "is CoppeliaSim running" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("fault", [{"deaf_to": "sim.step"}, {"waits": 10**9}])
def test_server_that_falls_silent_is_one_error_and_the_connection_closed(fault: Any) -> None:
    with Stub(**fault) as stub, connected(stub, timeout=0.3) as simulator:
        began = time.monotonic()
        message = r"an answer to sim\.step within 0\.3 s"
        with pytest.raises(coppeliasim.CoppeliaSimError, match=message), simulator.running():
            simulator.step()
        assert time.monotonic() - began < 2.0
        with pytest.raises(coppeliasim.CoppeliaSimError, match=r"open connection for sim\.getSimulationTime"):
            simulator.time  # noqa: B018


def test_unknown_object_is_an_error_that_suggests_near_names(simulator: coppeliasim.CoppeliaSim) -> None:
    with pytest.raises(coppeliasim.CoppeliaSimError, match=r"^no object '/rader' in the scene; did you mean '/radar'"):
        simulator.vision_sensor("/rader")
    with pytest.raises(coppeliasim.CoppeliaSimError, match="no object '/pot'"):
        simulator.bodies("/pot")
    assert simulator.time == 0.0  # the connection stays open


def test_errors_of_the_server_name_the_function(simulator: coppeliasim.CoppeliaSim) -> None:
    with pytest.raises(coppeliasim.CoppeliaSimError, match=r"^sim\.getObjectFloatParam: 5 \(in function"):
        simulator.sim.getObjectFloatParam(17, 5)


def test_threads_end_with_the_connection(stub: Stub) -> None:
    before = threading.active_count()
    connected(stub).close()
    assert threading.active_count() == before
