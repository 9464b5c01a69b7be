from radarcore.adapters import images as images
from radarcore.adapters import mujoco as mujoco
from radarcore.adapters import optitrack as optitrack
