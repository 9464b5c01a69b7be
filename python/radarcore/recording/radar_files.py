"""Files with the settings of a radar, by their suffix and content."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from radarcore.radar.radar import Radar
from radarcore.recording import infineon
from radarcore.recording.native import parsed_json, radar_from_json
from radarcore.recording.ti import commands, studio
from radarcore.recording.ti.capture import Capture
from radarcore.recording.ti.configuration import Settings, radar_and_capture


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
        return _of_ti(commands.settings(text, str(path)), path)
    if suffix != ".json":
        raise ValueError(
            f"{path}: expected a scene file (.toml) or the meta.json of a recording, or the settings of a chip "
            f"(config.json, .mmwave.json, .setup.json, .cfg), got {path.suffix!r}"
        )
    if is_setup(path):
        settings_file, files, device = studio.setup_files(path)
        found = _of_ti(_studio_settings(settings_file, device), settings_file)
        assert found.capture is not None
        return replace(found, capture=replace(found.capture, files=files))
    data = path.read_bytes()
    values = parsed_json(data, str(path))
    keys = values.keys() if isinstance(values, dict) else ()
    if "mmWaveDevices" in keys:
        return _of_ti(_studio_settings(path, studio.device_beside(path)), path)
    if infineon.is_config(values):
        return Configuration(infineon.radar_of(_text(path), str(path)), has_codes=True)
    return Configuration(radar_from_json(data, str(path)))


def _of_ti(settings: Settings, path: Path) -> Configuration:
    radar, capture = radar_and_capture(settings, str(path))
    return Configuration(radar, capture)


def _studio_settings(path: Path, device: str) -> Settings:
    return studio.settings(parsed_json(path.read_bytes(), str(path)), str(path), device)


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: expected UTF-8 text ({error})") from error
