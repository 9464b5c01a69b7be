from radarcore.adapters.coppeliasim.client import CoppeliaSimError as CoppeliaSimError
from radarcore.adapters.coppeliasim.decoders import from_grey_buffer as from_grey_buffer
from radarcore.adapters.coppeliasim.decoders import from_matrix as from_matrix
from radarcore.adapters.coppeliasim.decoders import from_shape_viz as from_shape_viz
from radarcore.adapters.coppeliasim.simulator import CoppeliaSim as CoppeliaSim
from radarcore.adapters.coppeliasim.vision import VisionImage as VisionImage
from radarcore.adapters.coppeliasim.vision import VisionSensor as VisionSensor
