"""Wheels and the source distribution: contents, builders, and the import of the package."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tarfile
import tomllib
from itertools import chain
from pathlib import Path
from zipfile import ZipFile

import pytest

from wheel_contents import ABOUT, LARGEST, faults, package_files

ROOT = Path(__file__).resolve().parents[1]
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
WHEEL = "radarcore-1.2.3-cp311-abi3-manylinux_2_17_x86_64.whl"
PYTHON = {"radarcore/__init__.py", "radarcore/py.typed"}
CORE = "radarcore/_core.abi3.so"


def wheel(directory: Path, contents: dict[str, bytes]) -> Path:
    path = directory / WHEEL
    with ZipFile(path, "w") as archive:
        for name, data in (contents | {f"radarcore-1.2.3.dist-info/{about}": b"" for about in ABOUT}).items():
            archive.writestr(name, data)
    return path


@pytest.mark.parametrize(
    ("names", "core", "fault"),
    [
        (PYTHON, b"", None),
        (PYTHON | {"radarcore/_core.pyd"}, b"", "expected one compiled core, got .*pyd"),
        (PYTHON | {"radarcore/tests/test_radar.py"}, b"", "radarcore/tests/test_radar.py should not be in it"),
        (PYTHON | {"tests/test_radar.py"}, b"", "tests/test_radar.py should not be in it"),
        ({"radarcore/__init__.py"}, b"", "radarcore/py.typed is missing"),
        (PYTHON, bytes(LARGEST), f"expected less than {LARGEST} bytes"),
        (PYTHON, b"\0GLIBC_2.2.5\0GLIBC_2.9\0GLIBC_2.17\0", None),
        (PYTHON, b"\0GLIBC_2.2.5\0GLIBC_2.18\0GLIBC_2.9\0", "expected symbols of that C library, got those of 2.18"),
    ],
)
def test_wheel_has_the_package_and_its_core_for_that_c_library(tmp_path, names, core, fault):
    found = faults(wheel(tmp_path, {**dict.fromkeys(names, b"text"), CORE: core}), PYTHON)
    assert len(found) == (fault is not None)
    assert fault is None or re.match(f"{re.escape(WHEEL)}: {fault}", found[0])


def test_wheel_without_a_core_is_refused(tmp_path):
    (found,) = faults(wheel(tmp_path, dict.fromkeys(PYTHON, b"")), PYTHON)
    assert "expected one compiled core, got []" in found


def test_source_distribution_has_the_lock_and_all_that_it_builds(tmp_path):
    if shutil.which("cargo") is None or subprocess.run(["cargo", "--version"], capture_output=True).returncode != 0:
        pytest.skip("needs cargo that runs, from a home folder where rustup finds its toolchain: https://rustup.rs")
    command = [sys.executable, "-m", "maturin", "sdist", "--out", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (packed,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(packed) as archive:
        archive.extractall(tmp_path, filter="data")
    source = tmp_path / packed.name.removesuffix(".tar.gz")
    for kept in ("Cargo.lock", "README.md", "LICENSE", "pyproject.toml"):
        assert (source / kept).read_bytes() == (ROOT / kept).read_bytes()
    for folder in ("rust", "python"):
        wanted = {
            path.relative_to(ROOT) for path in (ROOT / folder).rglob("*") if path.suffix in (".rs", ".py", ".pyi")
        }
        assert wanted <= {path.relative_to(source) for path in (source / folder).rglob("*")}
    # Without a network, and with the lock as it is: cargo finds all that the build takes.
    metadata = ["cargo", "metadata", "--locked", "--offline", "--format-version=1"]
    done = subprocess.run(metadata, cwd=source, capture_output=True, text=True, check=False)
    if "--offline" in done.stderr:
        pytest.skip("needs the Rust packages: cargo fetch")
    assert done.returncode == 0, done.stderr
    assert PROJECT["tool"]["maturin"]["locked"]


WITHOUT_POSIX = """
import builtins, importlib, os, pkgutil, select, signal, socket, sys
import asyncio, multiprocessing, numpy, pydantic, scipy.linalg, subprocess, tempfile  # they know their systems

class NoPosix:
    def find_spec(self, name, path=None, target=None):
        if name in ("curses", "fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "termios", "tty"):
            raise ModuleNotFoundError(f"no module named {name!r} here", name=name)

for name in ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"):
    sys.modules.pop(name, None)
sys.meta_path.insert(0, NoPosix())
for module, names in {
    os: "chown fork geteuid getpgid getuid mkfifo openpty sched_getaffinity setsid sysconf ttyname uname "
        "O_CLOEXEC O_NOCTTY O_NONBLOCK",
    signal: "SIGALRM SIGHUP SIGKILL SIGQUIT SIGUSR1 SIGUSR2 pause pthread_sigmask setitimer sigwait",
    select: "poll epoll",
    socket: "AF_UNIX",
}.items():
    for name in names.split():
        vars(module).pop(name, None)

import radarcore as rc

for found in pkgutil.walk_packages(rc.__path__, "radarcore."):
    if not found.name.endswith("__main__"):
        importlib.import_module(found.name)
sphere = rc.Body(rc.shapes.sphere(0.1), motion=rc.Pose([2.0, 0.0, 0.0]))
frame = rc.Simulator(rc.Scene([sphere]), rc.bgt60tr13c(), resolution=64).frame()
print(f"{rc.strongest_peak(frame, min_range=1.0).range:.1f}")
"""
"""Windows has none of these modules and names; every module is imported, and a sphere is simulated."""


def test_package_is_imported_and_simulates_without_posix():
    pytest.importorskip("matplotlib", reason="needs the extra `plot`: pip install radarcore[plot]")
    command = [sys.executable, "-c", WITHOUT_POSIX]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (0, "1.9\n"), done.stderr


def pins(name: str) -> dict[str, str]:
    text = (ROOT / "requirements" / name).read_text(encoding="utf-8")
    return dict(re.findall(r"^([\w.-]+)==(\S+)", text, flags=re.MULTILINE))


def test_releases_are_built_with_the_builder_of_the_checks():
    assert pins("wheels.txt")["maturin"] == pins("demo.txt")["maturin"]
    assert pins("wheels.txt").keys() == {"maturin", "ziglang"}


REQUIREMENTS = sorted(path.name for path in (ROOT / "requirements").glob("*.txt"))


@pytest.mark.parametrize("name", REQUIREMENTS)
def test_requirements_have_hashes_agree_and_name_no_index(name):
    text = (ROOT / "requirements" / name).read_text(encoding="utf-8")
    entries = re.split(r"\n(?=[\w.-]+==)", text)[1:]
    assert len(entries) == len(pins(name)) > 0
    assert [entry for entry in entries if "--hash=sha256:" not in entry] == []
    assert "://" not in text
    known = pins("test.txt")
    assert {package: pin for package, pin in pins(name).items() if known.get(package, pin) != pin} == {}


def test_requirements_are_of_the_groups_of_the_project():
    groups = PROJECT["dependency-groups"]
    assert {f"{group}.txt" for group in groups} == set(REQUIREMENTS)
    extras = PROJECT["project"]["optional-dependencies"].values()
    wanted = [*PROJECT["project"]["dependencies"], *chain.from_iterable(extras), *groups["test"][1:]]
    names = {re.split(r"[^\w.-]", requirement)[0].lower() for requirement in wanted}
    assert names <= pins("test.txt").keys(), "make requirements"


def test_actions_are_pinned_to_commits_and_nothing_is_secret():
    assert len(WORKFLOWS) == 2
    for path in WORKFLOWS:
        text = path.read_text(encoding="utf-8")
        uses = [line for line in re.findall(r"uses: (.*)", text) if not line.startswith("./.github/workflows/")]
        assert uses
        assert [line for line in uses if not re.fullmatch(r"[\w-]+/[\w-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", line)] == []
        assert "secrets." not in text


def jobs(name: str) -> dict[str, dict]:
    yaml = pytest.importorskip("yaml", reason="needs PyYAML: pip install -r requirements/test.txt")
    text = (ROOT / ".github" / "workflows" / name).read_text(encoding="utf-8")
    return yaml.safe_load(text)["jobs"]


def commands(job: dict) -> str:
    return "\n".join(step.get("run", "") for step in job.get("steps", []))


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflows_name_files_and_make_targets_that_exist(path):
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    oldest = PROJECT["project"]["requires-python"].removeprefix(">=")
    for job in jobs(path.name).values():
        text = commands(job)
        for name in re.findall(r"(?:\.ci|requirements|tests)/[\w./]+", text):
            assert (ROOT / name).is_file(), name
        for target in re.findall(r"make ([\w-]+)", text):
            assert re.search(rf"^{target}:", makefile, flags=re.MULTILINE), target
        for step in job.get("steps", []):
            assert step.get("with", {}).get("python-version", oldest) == oldest


def test_linux_wheels_are_those_of_make_wheels():
    text = (ROOT / ".ci" / "wheels").read_text(encoding="utf-8")
    linux = re.search(r'^LINUX="(.*)"$', text, flags=re.MULTILINE)
    assert linux is not None
    included = jobs("wheels.yml")["linux"]["strategy"]["matrix"]["include"]
    assert [entry["target"] for entry in included] == linux[1].split()


def test_only_a_tag_publishes_and_only_what_was_tested_installed_and_run():
    found = jobs("wheels.yml")
    publish = found.pop("publish")
    assert publish["if"] == "startsWith(github.ref, 'refs/tags/v')"
    assert set(publish["needs"]) == set(found)
    assert publish["permissions"] == {"id-token": "write"}
    assert found.pop("test") == {"if": publish["if"], "uses": "./.github/workflows/test.yml"}
    (checks,) = jobs("test.yml").values()
    assert ".ci/run" in commands(checks)
    for name, job in found.items():
        assert "tests/wheel_smoke.py" in commands(job), name
        assert "permissions" not in job


def test_wheel_of_this_checkout_would_hold_typed_python_and_its_data():
    assert {"radarcore/__init__.pyi", "radarcore/py.typed", "radarcore/cli/experiment.toml"} <= package_files()
