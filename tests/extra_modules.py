"""Modules that come with the extras of the package."""

from __future__ import annotations

MODULES = {
    "coppelia": {"cbor2", "coppeliasim_zmqremoteapi_client", "zmq"},
    "mesh": {"collada", "trimesh"},
    "mujoco": {"mujoco"},
    "plot": {"matplotlib"},
    "rerun": {"rerun"},
    "robots": {"example_robot_data"},
    "ros": {"apsw", "rosbags"},
    "usd": {"pxr"},
    "usb": {"libusb_package", "serial", "usb"},
    "zarr": {"xarray", "zarr"},
}
"""Modules of the extras, which some tests import by themselves."""
