from radarcore.adapters.optitrack.capture import CapturedBody as CapturedBody
from radarcore.adapters.optitrack.capture import MotionCapture as MotionCapture
from radarcore.adapters.optitrack.motive_csv import read_motive_csv as read_motive_csv
