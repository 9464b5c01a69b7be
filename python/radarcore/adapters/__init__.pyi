from radarcore.adapters import images as images
from radarcore.adapters import mujoco as mujoco
