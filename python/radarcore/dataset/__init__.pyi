from radarcore.dataset.making import make as make
from radarcore.dataset.opened import Dataset as Dataset
from radarcore.dataset.opened import open_dataset as open_dataset
from radarcore.dataset.verification import Verified as Verified
from radarcore.dataset.verification import verify as verify
