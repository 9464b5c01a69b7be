from radarcore.adapters.ros.bag_writer import BagWriter as BagWriter
from radarcore.adapters.ros.bags import BagReader as BagReader
