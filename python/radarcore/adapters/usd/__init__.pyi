from radarcore.adapters.usd.stage import StageScene as StageScene
from radarcore.adapters.usd.stage import is_available as is_available
