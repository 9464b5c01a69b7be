"""Captures of a DCA1000 as TI's documents have them, number by number, and configurations of a target's radar."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

C = 299792458.0

START, SLOPE, RATE = 77.0, 60.0, 6000.0
"""Profile: GHz, MHz/us, kHz."""
IDLE, ADC_START, RAMP_END, PERIOD = 7.0, 6.0, 40.0, 50.0
"""Times: us, us, us, ms."""
NUM_SAMPLES = 64


def half_wavelength() -> float:
    """Half a wavelength in the middle of the samples [m]."""
    return 0.5 * C / (START * 1e9 + SLOPE * 1e12 * (ADC_START * 1e-6 + 0.5 * NUM_SAMPLES / (RATE * 1e3)))


@dataclass
class Scene:
    """A point in front of a radar with TI's antennas, and what its chip sends."""

    range: float = 3.0
    velocity: float = 2.0
    azimuth: float = np.deg2rad(20.0)
    elevation: float = 0.0
    masks: tuple[int, ...] = (1, 4)
    num_loops: int = 16
    num_frames: int = 2
    places: dict[int, tuple[float, float]] = field(default_factory=lambda: {1: (0, 0), 2: (2, 1), 4: (4, 0)})
    """Half wavelengths to the left and up of every transmitter, by its mask: xWR1843BOOST."""
    feeds: dict[int, list[complex]] = field(default_factory=dict)
    """Factors of the four receivers that the lines of a board make, by the mask of the transmitter."""
    rx: tuple[tuple[float, float], ...] = ((0, 0), (1, 0), (2, 0), (3, 0))
    """Half wavelengths to the left and up of every receiver."""

    def numbers(self, order: str, *, real: bool = False, q_first: bool = False) -> np.ndarray[Any, Any]:
        """The 16-bit numbers of all frames, in the order of ``lanes2`` or ``lanes4`` (SWRA581), or of ``rdif``."""
        words: list[float] = []
        for frame in range(self.num_frames):
            for loop in range(self.num_loops):
                for turn, mask in enumerate(self.masks):
                    time = frame * PERIOD * 1e-3 + (loop * len(self.masks) + turn) * (IDLE + RAMP_END) * 1e-6
                    chirp = self.chirp(time, mask)
                    if order == "rdif":
                        words += _rdif(chirp)
                    else:
                        words += _lanes2(chirp, real, q_first) if order == "lanes2" else _lanes4(chirp, real, q_first)
        return np.array(words, "<i2")

    def chirp(self, time: float, mask: int) -> np.ndarray[Any, Any]:
        """I + jQ of a chip (rx, sample): the phase of the transmitted wave minus the phase of the echo."""
        t = ADC_START * 1e-6 + np.arange(NUM_SAMPLES) / (RATE * 1e3)
        half = half_wavelength()
        # Paths from transmitter to target to receivers: so near, the wave is curved. Range and angles are from the
        # middle of the antennas.
        across, up = np.cos(self.elevation), np.sin(self.elevation)
        axis = np.array([np.cos(self.azimuth) * across, np.sin(self.azimuth) * across, up])
        target = (self.range + self.velocity * (time + t))[:, None] * axis
        receivers = np.array([[0.0, *place] for place in self.rx])
        senders = {mask: np.array([0.0, *self.places[mask]]) for mask in sorted(set(self.masks))}
        target += 0.5 * half * (np.mean([*senders.values()], axis=0) + receivers.mean(axis=0))
        way = np.linalg.norm(target - half * senders[mask], axis=-1)
        tau = (way + np.linalg.norm(target - half * receivers[:, None], axis=-1)) / C
        phase = START * 1e9 * tau + SLOPE * 1e12 * (tau * t - 0.5 * tau * tau)
        feeds = np.array(self.feeds.get(mask, [1.0] * len(self.rx)))[:, None]
        exact: np.ndarray[Any, Any] = 1000.0 * feeds * np.exp(2j * np.pi * (phase % 1.0))
        return np.rint(exact.real) + 1j * np.rint(exact.imag)


def _lanes2(chirp: np.ndarray[Any, Any], real: bool, q_first: bool) -> list[float]:
    """Receiver after receiver: I I Q Q of every two samples."""
    words: list[float] = []
    for samples in chirp:
        if real:
            words += samples.real.tolist()
            continue
        for a, b in samples.reshape(-1, 2):
            i, q = [a.real, b.real], [a.imag, b.imag]
            words += q + i if q_first else i + q
    return words


def _lanes4(chirp: np.ndarray[Any, Any], real: bool, q_first: bool) -> list[float]:
    """Sample after sample: I of all receivers, Q of all."""
    words: list[float] = []
    for values in chirp.T:
        i, q = values.real.tolist(), values.imag.tolist()
        words += i if real else q + i if q_first else i + q
    return words


def _rdif(chirp: np.ndarray[Any, Any]) -> list[float]:
    """Real samples of all receivers in turn: bits of four, from the lowest on, go to four lanes in turn.

    TI's ``ar_convertAdcData_xWRLx432.m`` reads bits 10 to 12 of all lanes first, then 7 to 9, 4 to 6 and 1 to 3.
    """
    words: list[float] = []
    for samples in chirp.T.real.astype(int).reshape(-1, 4).tolist():
        bits = [(sample & 0xFFF) >> place & 1 for sample in samples for place in range(12)]
        lanes = [0] * 4
        for turn, place in enumerate((9, 10, 11, 6, 7, 8, 3, 4, 5, 0, 1, 2)):
            for lane in range(4):
                lanes[lane] |= bits[4 * turn + lane] << place
        words += lanes
    return words


def commands(
    scene: Scene, *, output: int = 1, swap: int = 1, apart: int = 1, platform: str = "xWR18xx", **changes: str
) -> str:
    """Commands of the SDK's demo; `changes` are lines in place of others, by the names of their commands."""
    lines = {
        "platform": f"% Platform:{platform}" if platform else "% nothing",
        "sensorStop": "sensorStop",
        "flushCfg": "flushCfg",
        "dfeDataOutputMode": "dfeDataOutputMode 1",
        "channelCfg": f"channelCfg 15 {sum(set(scene.masks))} 0",
        "adcCfg": f"adcCfg 2 {output}",
        "adcbufCfg": f"adcbufCfg -1 {int(output == 0)} {swap} {apart} 1",
        "profileCfg": f"profileCfg 0 {START} {IDLE} {ADC_START} {RAMP_END} 0 0 {SLOPE} 1 {NUM_SAMPLES} {RATE} 0 0 30",
        **{f"chirp{k}": f"chirpCfg {k} {k} 0 0 0 0 0 {mask}" for k, mask in enumerate(scene.masks)},
        "frameCfg": f"frameCfg 0 {len(scene.masks) - 1} {scene.num_loops} 0 {PERIOD} 1 0",
        "lowPower": "lowPower 0 0",
        "guiMonitor": "guiMonitor -1 1 1 0 0 0 1",
        "bpmCfg": "bpmCfg -1 0 0 1",
        "compensation": "compRangeBiasAndRxChanPhase 0.0" + 12 * " 1 0",
        "lvdsStreamCfg": "lvdsStreamCfg -1 0 1 0",
        "sensorStart": "sensorStart",
    } | changes
    return "\n".join(line for line in lines.values() if line) + "\n"


def studio(
    scene: Scene, *, output: int = 1, swap: int = 0, lanes: str = "0x3", interleave: int = 1, bits: int = 2
) -> dict[str, Any]:
    """Content of a .mmwave.json."""
    profile = {
        "profileId": 0,
        "startFreqConst_GHz": START,
        "idleTimeConst_usec": IDLE,
        "adcStartTimeConst_usec": ADC_START,
        "rampEndTime_usec": RAMP_END,
        "freqSlopeConst_MHz_usec": SLOPE,
        "txStartTime_usec": 0.0,
        "numAdcSamples": NUM_SAMPLES,
        "digOutSampleRate": RATE,
        "rxGain_dB": "0x1E",
    }
    changes = dict.fromkeys(
        ("startFreqVar_MHz", "freqSlopeVar_KHz_usec", "idleTimeVar_usec", "adcStartTimeVar_usec"), 0.0
    )
    chirps = [
        {"rlChirpCfg_t": {"chirpStartIdx": k, "chirpEndIdx": k, "profileId": 0, **changes, "txEnable": f"0x{mask:X}"}}
        for k, mask in enumerate(scene.masks)
    ]
    rf = {
        "waveformType": "legacyFrameChirp",
        "MIMOScheme": "TDM",
        "rlChanCfg_t": {"rxChannelEn": "0xF", "txChannelEn": f"0x{sum(set(scene.masks)):X}", "cascading": 0},
        "rlAdcOutCfg_t": {"fmt": {"b2AdcBits": bits, "b8FullScaleReducFctr": 0, "b2AdcOutFmt": output}},
        "rlProfiles": [{"rlProfileCfg_t": profile}],
        "rlChirps": chirps,
        "rlBpmChirps": [{"rlBpmChirpCfg_t": {"chirpStartIdx": 0, "chirpEndIdx": 1, "constBpmVal": "0x0"}}],
        "rlFrameCfg_t": {
            "chirpStartIdx": 0,
            "chirpEndIdx": len(scene.masks) - 1,
            "numLoops": scene.num_loops,
            "numFrames": scene.num_frames,
            "framePeriodicity_msec": PERIOD,
        },
    }
    data = {
        "rlDevDataFmtCfg_t": {"iqSwapSel": swap, "chInterleave": interleave},
        "rlDevDataPathCfg_t": {"intfSel": 1, "transferFmtPkt0": "0x1"},
        "rlDevLaneEnable_t": {"laneEn": lanes},
    }
    return {"mmWaveDevices": [{"mmWaveDeviceId": 0, "rfConfig": rf, "rawDataCaptureConfig": data}]}


def setup(path: Path, values: dict[str, Any], files: list[str], device: str = "awr1843") -> Path:
    """The two files of mmWave Studio beside captured ones; the path of the setup."""
    (path / "18xx.mmwave.json").write_text(json.dumps(values))
    captured = [{"rawFileName": name, "processedFileName": name} for name in files]
    content = {
        "mmWaveDevice": device,
        "captureHardware": "DCA1000",
        "configUsed": "C:\\ti\\captures\\18xx.mmwave.json",
        "capturedFiles": {"numFilesCollected": len(files), "fileBasePath": "C:\\ti\\captures", "files": captured},
    }
    (path / "18xx.setup.json").write_text(json.dumps(content))
    return path / "18xx.setup.json"
