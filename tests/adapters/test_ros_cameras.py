"""CameraInfo of ROS to cameras, and poses of Gazebo."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import radarcore as rc
from radarcore.adapters import gazebo, ros


def info(**fields: Any) -> SimpleNamespace:
    """A camera of 640 x 480 pixels whose axis goes through their middle, as OpenCV counts."""
    k = [500.0, 0.0, 319.5, 0.0, 510.0, 239.5, 0.0, 0.0, 1.0]
    given = {"width": 640, "height": 480, "k": k, "d": [], "p": [0.0] * 12}
    return SimpleNamespace(**(given | fields))


def test_camera_counts_pixel_centres_at_halves() -> None:
    assert ros.from_camera_info(info()) == rc.Camera(500.0, 510.0, 320.0, 240.0)


def test_large_letters_of_ros_1_are_the_same_camera() -> None:
    message = info()
    message.K = message.__dict__.pop("k")
    assert ros.from_camera_info(message) == rc.Camera(500.0, 510.0, 320.0, 240.0)


@pytest.mark.parametrize("cx", [319.5, 320.0, 320.5])
def test_centered_camera_has_its_axis_in_the_middle_whatever_the_publisher_counts(cx: float) -> None:
    k = [500.0, 0.0, cx, 0.0, 500.0, cx - 80.0, 0.0, 0.0, 1.0]
    assert ros.from_camera_info(info(k=k), centered=True) == rc.Camera(500.0, 500.0, 320.0, 240.0)


def test_window_and_binning_see_the_same_directions() -> None:
    window = SimpleNamespace(x_offset=100, y_offset=40, width=200, height=160)
    whole = ros.from_camera_info(info())
    part = ros.from_camera_info(info(roi=window, binning_x=2, binning_y=4))
    # A large pixel looks at the middle of the small ones in it.
    u, v = whole.plane(480, 640)
    large_u, large_v = part.plane(40, 100)
    np.testing.assert_allclose(large_u, u[100:300].reshape(-1, 2).mean(axis=1), rtol=0, atol=1e-15)
    np.testing.assert_allclose(large_v, v[40:200].reshape(-1, 4).mean(axis=1), rtol=0, atol=1e-15)


def test_camera_of_images_of_another_size_is_refused() -> None:
    pixels = np.ones((40, 100), np.float32)
    image = SimpleNamespace(height=40, width=100, encoding="32FC1", is_bigendian=0, step=400, data=pixels.tobytes())
    window = SimpleNamespace(x_offset=100, y_offset=40, width=200, height=160)
    cut = info(roi=window, binning_x=2, binning_y=4)
    assert ros.from_ros_image(image, camera_info=cut).camera == ros.from_camera_info(cut)
    with pytest.raises(ValueError, match=r"camera_info: .* of 100 x 40 pixels, got one of 640 x 480"):
        ros.from_ros_image(image, camera_info=info())


def test_rectified_camera_is_that_of_the_projection() -> None:
    p = [400.0, 0.0, 300.5, 0.0, 0.0, 410.0, 220.5, 0.0, 0.0, 0.0, 1.0, 0.0]
    assert ros.from_camera_info(info(p=p, d=[0.1, 0.0]), rectified=True) == rc.Camera(400.0, 410.0, 301.0, 221.0)


def test_distortion_that_stays_is_warned_of() -> None:
    with pytest.warns(UserWarning, match="camera_info: its distortion is not undone"):
        ros.from_camera_info(info(d=[0.1, 0.0, 0.0, 0.0, 0.0]))


def test_poses_of_gazebo_are_rotations_by_named_parts_of_quaternions() -> None:
    half = np.sqrt(0.5)
    turned = SimpleNamespace(w=half, x=0.0, y=0.0, z=half)
    entry = SimpleNamespace(name="robot", position=SimpleNamespace(x=1.0, y=2.0, z=3.0), orientation=turned)
    poses = gazebo.from_gz_poses(SimpleNamespace(pose=[entry]))
    assert list(poses) == ["robot"]
    # A quarter turn to the left: forward becomes left.
    np.testing.assert_allclose(poses["robot"].apply([1.0, 0.0, 0.0]), [1.0, 3.0, 3.0], rtol=0, atol=1e-15)


def test_links_of_one_name_are_kept_apart_by_their_numbers() -> None:
    """On pose/info every model has its "link"; entities have numbers."""
    still = SimpleNamespace(w=1.0, x=0.0, y=0.0, z=0.0)
    names = [("cart", 8), ("link", 9), ("wall", 13), ("link", 14)]
    entries = [
        SimpleNamespace(name=name, id=number, position=SimpleNamespace(x=number, y=0.0, z=0.0), orientation=still)
        for name, number in names
    ]
    poses = gazebo.from_gz_poses(SimpleNamespace(pose=entries))
    places = {name: pose.position[0] for name, pose in poses.items()}
    assert places == {"cart": 8.0, "link [9]": 9.0, "wall": 13.0, "link [14]": 14.0}
    with pytest.raises(ValueError, match=r"different names or numbers \(id\), got 'link \[9\]' twice"):
        gazebo.from_gz_poses(SimpleNamespace(pose=2 * entries[1:2]))
