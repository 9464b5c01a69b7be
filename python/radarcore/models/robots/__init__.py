"""Models of robot arms, and real meshes of an arm and of a human (extra `robots`)."""

from radarcore.models.robots.data import is_available, through_obj
from radarcore.models.robots.links import Link, human_joints, human_links, ur10_links

__all__ = ["Link", "human_joints", "human_links", "is_available", "through_obj", "ur10_links"]
