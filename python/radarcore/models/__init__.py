"""Models of what a sensor meets: robot arms and people.

Only the names here are public; the modules load scipy when they are used.
"""

from radarcore.models.arm import RADAR_AT_TOOL0, JointTrajectory, MovingArm, RobotArm, cartesian_line
from radarcore.models.human import Human

__all__ = ["RADAR_AT_TOOL0", "Human", "JointTrajectory", "MovingArm", "RobotArm", "cartesian_line"]
