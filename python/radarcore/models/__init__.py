"""Models of what a sensor meets: robot arms and people.

Only the names here are public; the modules load scipy when they are used.
"""

from radarcore.models.people.human import Human
from radarcore.models.robots.arm import RADAR_AT_TOOL0, MovingArm, RobotArm
from radarcore.models.robots.joint_trajectory import JointTrajectory
from radarcore.models.robots.line import cartesian_line

__all__ = ["RADAR_AT_TOOL0", "Human", "JointTrajectory", "MovingArm", "RobotArm", "cartesian_line"]
