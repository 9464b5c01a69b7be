from radarcore.models import robots as robots
from radarcore.models.people.human import Human as Human
from radarcore.models.robots.arm import RADAR_AT_TOOL0 as RADAR_AT_TOOL0
from radarcore.models.robots.arm import MovingArm as MovingArm
from radarcore.models.robots.arm import RobotArm as RobotArm
from radarcore.models.robots.joint import JointTrajectory as JointTrajectory
from radarcore.models.robots.line import cartesian_line as cartesian_line
