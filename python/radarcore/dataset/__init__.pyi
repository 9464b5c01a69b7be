from radarcore.dataset.sample import Sample as Sample
from radarcore.dataset.training import Stream as Stream
from radarcore.dataset.training import TorchDataset as TorchDataset
from radarcore.dataset.training import stream as stream
from radarcore.dataset.variation import Parameter as Parameter
from radarcore.dataset.variation import Variation as Variation
