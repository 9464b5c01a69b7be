from radarcore.processing.peaks import Peak as Peak
from radarcore.processing.peaks import strongest_peak as strongest_peak
from radarcore.processing.spectra import range_doppler as range_doppler
from radarcore.processing.spectra import range_profile as range_profile
from radarcore.processing.time_frequency import RangeTime as RangeTime
from radarcore.processing.time_frequency import Spectrogram as Spectrogram
from radarcore.processing.time_frequency import range_time as range_time
from radarcore.processing.time_frequency import spectrogram as spectrogram
