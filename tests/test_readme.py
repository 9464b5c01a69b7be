"""The README's examples run as they stand."""

import re
from pathlib import Path

import pytest

import radarcore as rc
from radarcore.cli.main import main

README = Path(__file__).resolve().parents[1] / "README.md"


def test_readme_examples_run_and_print_what_they_should(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", README.read_text(encoding="utf-8"), flags=re.DOTALL)
    assert len(blocks) >= 2
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, str(README), "exec"), names)
    printed = capsys.readouterr().out
    # The sphere's nearest point: 2 m away and 0.1 m aside, less the radius, 1.5 m/s nearer after half a frame.
    middle = 0.5 * names["waveform"].duration  # type: ignore[attr-defined]  # the example's own name
    assert f"sphere at {((2.0 - 1.5 * middle) ** 2 + 0.01) ** 0.5 - 0.1:.2f} m" in printed
    assert "4 (4, 2, 64, 128)" in printed
    (plan,) = re.findall(r"^prints `(.*?)`\.$", README.read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert plan in printed


def test_readme_names_both_commands() -> None:
    text = README.read_text(encoding="utf-8")
    assert "make demo" in text
    assert "make test" in text


def test_readme_scene_file_and_its_commands_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    monkeypatch.chdir(tmp_path)
    text = README.read_text(encoding="utf-8")
    (scene,) = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    Path("scene.toml").write_text(scene.replace("stop = 0.5", "stop = 0.05\nray_budget = 10_000"), encoding="utf-8")
    Path("part.obj").write_text((README.parent / "examples" / "wedge.obj").read_text())
    (commands,) = re.findall(r"```sh\n(radarcore .*?)```", text, flags=re.DOTALL)
    for line in commands.splitlines():
        _, *arguments = line.partition("#")[0].split()
        assert main(arguments) == 0
    assert rc.Recording.load("recording").cube.shape == (2, 3, 64, 64)
    assert Path("depth.png").is_file()
    assert Path("spectrogram.png").is_file()
