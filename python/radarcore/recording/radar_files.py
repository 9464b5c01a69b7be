"""Files with the settings of a radar, by their suffix and content."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from radarcore.radar.radar import Radar
from radarcore.recording import infineon
from radarcore.recording.native import parsed_json, radar_from_json
from radarcore.recording.ti import commands, studio
from radarcore.recording.ti.capture import Capture
from radarcore.recording.ti.configuration import radar_and_capture


@dataclass(frozen=True)
class Configuration:
    """Description of samples by a configuration file.

    Parameters
    ----------
    radar : Radar
    capture : Capture, optional
        Order of the numbers of a raw capture, of TI's files.
    has_codes : bool
        True where unsigned numbers are codes of the ADC of an Infineon chip.
    """

    radar: Radar
    capture: Capture | None = None
    has_codes: bool = False


def is_setup(path: Path) -> bool:
    """True for the file with which mmWave Studio describes a capture."""
    return path.name.lower().endswith(studio.SETUP_SUFFIX)


def configuration(path: Path) -> Configuration:
    """Content of a scene file, of the JSON of a radar or recording, of a chip's settings, by Infineon or TI.

    Raises
    ------
    FileNotFoundError
        When there is no such file.
    ValueError
        For another suffix, and one line per fault of the file.
    """
    suffix = path.suffix.lower()
    if suffix == ".toml":
        # Scene files lie above recordings, which need none of them but here.
        import radarcore

        return Configuration(radarcore.load_radar(path))
    if suffix == ".cfg":
        text = path.read_bytes().decode("utf-8-sig", "replace")  # comments may be in any encoding
        return Configuration(*radar_and_capture(commands.settings(text, str(path)), str(path)))
    if suffix != ".json":
        raise ValueError(
            f"{path}: expected a scene file (.toml) or the meta.json of a recording, or the settings of a chip "
            f"(config.json, .mmwave.json, .setup.json, .cfg), got {path.suffix!r}"
        )
    if is_setup(path):
        settings_file, files, device = studio.setup_files(path)
        radar, capture = radar_and_capture(studio.settings(settings_file, device), str(settings_file))
        return Configuration(radar, replace(capture, files=files))
    data = path.read_bytes()
    values = parsed_json(data, str(path))
    keys = values.keys() if isinstance(values, dict) else ()
    if "mmWaveDevices" in keys:
        return Configuration(*radar_and_capture(studio.settings(path, studio.device_beside(path)), str(path)))
    if infineon.is_config(values):
        return Configuration(infineon.radar_of(data.decode("utf-8-sig", "replace"), str(path)), has_codes=True)
    return Configuration(radar_from_json(data, str(path)))
