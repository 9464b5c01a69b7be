from radarcore.adapters.mujoco.model import LiveModel as LiveModel
from radarcore.adapters.mujoco.model import frames as frames
from radarcore.adapters.mujoco.model import is_available as is_available
from radarcore.adapters.mujoco.rendering import DepthView as DepthView
from radarcore.adapters.mujoco.rendering import View as View
from radarcore.adapters.mujoco.tessellation import geom_mesh as geom_mesh
from radarcore.adapters.mujoco.urdf import spec_from_urdf as spec_from_urdf
