from radarcore.models.robots.catalogue import arm_names as arm_names
from radarcore.models.robots.data import is_available as is_available
from radarcore.models.robots.data import through_obj as through_obj
from radarcore.models.robots.links import Link as Link
from radarcore.models.robots.links import human_joints as human_joints
from radarcore.models.robots.links import human_links as human_links
from radarcore.models.robots.links import ur10_links as ur10_links
