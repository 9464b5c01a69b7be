from radarcore.models.robots.named import arm_names as arm_names
from radarcore.models.robots.named import is_available as is_available
