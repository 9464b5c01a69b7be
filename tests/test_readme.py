"""README and docs: Python examples run, commands of `radarcore` run, links lead somewhere."""

import ast
import re
import shlex
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

import radarcore as rc
from radarcore.cli.main import application, main

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "examples" / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
RESULTS = sorted((ROOT / "benches" / "results").glob("*.md"))
"""Tables that benches write; docs/performance.md and docs/accuracy.md sum them up."""
BLOCK = re.compile(r"^```(\w*)\n(.*?)^```$", flags=re.DOTALL | re.MULTILINE)
LINK = re.compile(r"\]\(([^()\s]+)\)")


def text_of(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    return [body for kind, body in BLOCK.findall(text_of(page)) if kind == language]


def prose(page: Path) -> str:
    return BLOCK.sub("", text_of(page))


def name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def pages_with(language: str) -> list[Path]:
    return [page for page in PAGES if blocks(page, language)]


def commands(page: Path) -> list[list[str]]:
    """Arguments of every line of a page that calls `radarcore`."""
    lines = [line for block in blocks(page, "sh") for line in block.splitlines()]
    return [shlex.split(line, comments=True)[1:] for line in lines if line.startswith("radarcore ")]


def is_run_elsewhere(arguments: list[str]) -> bool:
    """Commands that need a board or write into the home folder, and the demo: tests/sensor and tests/cli run them."""
    is_of_a_board = arguments == ["view"] or arguments[1:2] == ["/tmp/radar"] or "--bandwidth" in arguments
    return is_of_a_board or arguments[0] in ("sensor", "demo", "--install-completion")


def is_run_for_an_earlier_page(page: Path, arguments: list[str]) -> bool:
    """True if a page before has the same command, and it reads nothing but an example."""
    earlier = PAGES[: PAGES.index(page)]
    reads_an_example = arguments[1:2] != [] and arguments[1].startswith("examples/")
    return reads_an_example and any(arguments in commands(other) for other in earlier)


def run_python(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Run the Python blocks of a page in one namespace; a text block next to one is its output, a TOML block a file."""
    names: dict[str, object] = {}
    found = BLOCK.findall(text_of(page))
    for (kind, body), (next_kind, output) in zip(found, [*found[1:], ("", "")], strict=True):
        if kind == "toml":
            Path("scene.toml").write_text(body, encoding="utf-8")
        if kind == "python":
            capsys.readouterr()
            exec(compile(body, str(page), "exec"), names)
            if next_kind == "text":
                assert capsys.readouterr().out == output


WITH_ANOTHER_SIDE = ("sensor.md", "coppeliasim.md", "motion-capture.md")
"""Pages whose examples need a board or a program, which the tests play."""


@pytest.mark.parametrize("page", [p for p in pages_with("python") if p.name not in WITH_ANOTHER_SIDE], ids=name)
def test_python_examples_run_and_print_what_the_page_says(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    run_python(page, capsys)


@pytest.mark.filterwarnings("ignore::radarcore.sensor.FramesLostWarning")
def test_python_examples_of_sensors_run_with_an_emulated_board(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The board sends as fast as it can: frames that the example takes too late are lost, with a warning."""
    from radarcore.sensor.emulator.pty import PtyPort

    open_sensor = rc.open_sensor
    simulator = rc.Simulator(rc.Scene([rc.PointTarget([0.5, 0.0, 0.0])]), rc.bgt60tr13c())
    with rc.sensor.virtual_board(simulator, speed=None) as board, PtyPort(board) as port:
        monkeypatch.setattr(rc, "open_sensor", lambda path=None: open_sensor(path or port.path))
        run_python(ROOT / "docs" / "sensor.md", capsys)


def test_python_examples_of_motion_capture_run_with_a_server(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from doubles.motive import MotionCaptureServer
    from radarcore.adapters import optitrack

    client = optitrack.MotionCaptureClient
    monkeypatch.chdir(tmp_path)
    with MotionCaptureServer({"cart": rc.Pose([2.0, 0.0, 1.0])}) as server:
        server.start()
        monkeypatch.setattr(optitrack, "MotionCaptureClient", lambda _: client(command_port=server.command_port))
        run_python(ROOT / "docs" / "motion-capture.md", capsys)


def test_python_examples_of_coppeliasim_run_with_a_server(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from doubles.coppelia_stub import Stub
    from radarcore.adapters import coppeliasim

    connect = coppeliasim.CoppeliaSim
    with Stub() as stub:
        monkeypatch.setattr(
            coppeliasim, "CoppeliaSim", lambda _, __, **options: connect("127.0.0.1", stub.port, **options)
        )
        run_python(ROOT / "docs" / "coppeliasim.md", capsys)


@pytest.mark.filterwarnings("ignore:.*expected at least one track, got none in 2 frames")  # a track takes more
@pytest.mark.parametrize("page", [p for p in pages_with("sh") if commands(p)], ids=name)
def test_commands_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes are cut to two frames of few rays; commands of other tests are only parsed."""
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    monkeypatch.chdir(tmp_path)
    examples = Path(shutil.copytree(ROOT / "examples", "examples"))
    for number, scene in enumerate(blocks(page, "toml")):
        assert number == 0
        Path("scene.toml").write_text(scene, encoding="utf-8")
        shutil.copy(examples / "wedge.obj", "part.obj")
    for path in [*examples.glob("*.toml"), *Path().glob("scene.toml")]:
        scene = path.read_text(encoding="utf-8")
        rate = float(re.findall(r"^rate = (.*)$", scene, flags=re.MULTILINE)[0])
        short = f"stop = {2.0 / rate}\nresolution = 64"
        path.write_text(re.sub(r"^stop = .*$", short, scene, flags=re.MULTILINE), encoding="utf-8")
    if page.name == "sensor.md":  # a recording in place of the missing board's
        radar = rc.bgt60tr13c(receiver="measured", num_chirps=16)
        walker = rc.PointTarget([2.0, 0.0, 0.0], velocity=[1.0, 0.0, 0.0])
        simulated = rc.Simulator(rc.Scene([walker]), radar).record(0.0, 0.2, progress=False)
        replace(simulated, truth=None).save("out/rec")
    for arguments in commands(page):
        if is_run_elsewhere(arguments) or is_run_for_an_earlier_page(page, arguments):
            application().parse_args(arguments)  # raises a CycloptsError if there is no such command or option
            continue
        assert main(arguments) == 0, arguments
        if "-o" in arguments:
            output = Path(arguments[arguments.index("-o") + 1])
            if arguments[0] == "process":
                assert {file.name for file in output.iterdir()} == {"detections.csv", "tracks.csv"}
            elif arguments[0] == "dataset":
                assert not rc.dataset.open_dataset(output).failed
            else:
                assert len(rc.Recording.load(output)) == 2 if output.is_dir() else output.is_file()


@pytest.mark.parametrize("page", PAGES, ids=name)
def test_other_commands_and_files_exist(page: Path) -> None:
    targets = re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(encoding="utf-8"), flags=re.MULTILINE)
    for target in re.findall(r"(?:^|`)make (\w+)", text_of(page), flags=re.MULTILINE):
        assert target in targets
    for path in re.findall(r"(?:python|pytest) (\w+/\w+\.py)", text_of(page)):
        assert (ROOT / path).is_file(), path


def anchors(page: Path) -> set[str]:
    """Of the headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", prose(page), flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", [*PAGES, *RESULTS, ROOT / "CHANGELOG.md"], ids=name)
def test_links_lead_to_files_and_headings(page: Path) -> None:
    for link in LINK.findall(prose(page)):
        if link.startswith("https://"):
            continue
        path, _, anchor = link.partition("#")
        target = page if path == "" else (page.parent / path).resolve()
        assert target.exists(), link
        assert anchor == "" or anchor in anchors(target), link


START_PAGES = ("index", "install", "robotics", "radar-engineers", "machine-learning", "sensor", "coming-from")


def linked_from(page: Path) -> set[Path]:
    return {(page.parent / link.partition("#")[0]).resolve() for link in LINK.findall(prose(page))}


def test_readme_is_short_and_links_to_the_start_pages_and_these_to_every_page() -> None:
    readme, docs = ROOT / "README.md", ROOT / "docs"
    assert len(text_of(readme).split()) <= 550
    start = {docs / f"{page}.md" for page in START_PAGES}
    assert linked_from(readme) >= start
    linked = set().union(*(linked_from(page) for page in start))
    assert linked | start >= {page for page in PAGES if page.name != "README.md"}


def test_equations_are_numbered_once_and_those_cited_exist() -> None:
    numbers = [int(tag) for tag in re.findall(r"\\tag\{(\d+)\}", text_of(ROOT / "docs" / "theory.md"))]
    assert numbers == list(range(1, len(numbers) + 1))
    for page in PAGES:
        cited = {int(number) for number in re.findall(r"\beqs?\. \((\d+)\)", text_of(page))}
        assert cited <= set(numbers), page


def texts_of(bench: Path) -> list[str]:
    """Texts that a bench writes into a page, with the names of what is filled in."""
    assigned = [node for node in ast.parse(text_of(bench)).body if isinstance(node, ast.Assign)]
    return [ast.literal_eval(node.value) for node in assigned if ast.unparse(node.targets[0]).endswith("TEXT")]


@pytest.mark.parametrize("bench", sorted(b for b in (ROOT / "benches").glob("*.py") if texts_of(b)), ids=name)
def test_pages_hold_the_texts_of_the_benches(bench: Path) -> None:
    mark = "`python benches/accuracy.py --write`" if bench.name == "accuracy.py" else f"<!-- benches/{bench.name} -->"
    page = "\n".join(text for text in map(text_of, [*PAGES, *RESULTS]) if mark in text)
    for text in texts_of(bench):
        for piece in re.split(r"\{\w+(?::[^}]*)?\}", text):
            assert piece.strip() in page
