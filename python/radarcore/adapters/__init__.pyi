from radarcore.adapters import coppeliasim as coppeliasim
from radarcore.adapters import gazebo as gazebo
from radarcore.adapters import images as images
from radarcore.adapters import mujoco as mujoco
from radarcore.adapters import optitrack as optitrack
from radarcore.adapters import rerun as rerun
from radarcore.adapters import ros as ros
from radarcore.adapters import usd as usd
