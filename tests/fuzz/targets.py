"""Targets by name."""

from importlib.util import find_spec

from fuzz import bags, files, stored, streams
from fuzz.cases import Target

TARGETS = {
    "obj": Target(files.obj_seeds, files.make_obj, files.read_obj),
    "scene": Target(files.scene_seeds, files.make_scene, files.read_scene),
    "pattern": Target(files.pattern_seeds, files.make_pattern, files.read_pattern),
    "robot": Target(files.robot_seeds, files.make_robot, files.read_robot),
    "directory": Target(stored.directory_seeds, stored.make_directory, stored.read_directory),
    "npz": Target(stored.npz_seeds, stored.make_npz, stored.read_npz),
    "infineon": Target(stored.infineon_seeds, stored.make_infineon, stored.read_directory),
    "stream": Target(streams.stream_seeds, streams.make_stream, streams.read_stream),
    "capture": Target(streams.capture_seeds, streams.make_capture, streams.read_capture),
}
if find_spec("rosbags") is not None:  # the extra `ros`
    TARGETS["bag"] = Target(bags.bag_seeds, bags.make_bag, bags.read_bag)
