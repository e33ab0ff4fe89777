"""The wheel is all that a user needs: every file is in it, and it works outside the repository."""

import json
import os
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest
from nonempty import nonempty
from paths import REPOSITORY

from robots import load_robot

pytestmark = pytest.mark.slow

PACKAGES = ("robots", "drivers", "humanoid_getup", "sim2real")
LEFT_OUT = {".md", ".pyc"}


def list_files(*paths: str) -> list[str]:
    """List the repository's files under some paths, those that git ignores left out."""
    command = ("git", "ls-files", "--cached", "--others", "--exclude-standard", *paths)
    result = subprocess.run(command, cwd=REPOSITORY, check=True, capture_output=True, text=True)
    return result.stdout.splitlines()


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    # Built from a copy: setuptools leaves a build folder behind.
    source = folder / "source"
    for name in list_files(*PACKAGES, "pyproject.toml", "README.md", "LICENSE", "NOTICE"):
        (source / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).write_bytes((REPOSITORY / name).read_bytes())
    pip = (sys.executable, "-m", "pip", "wheel", "-q", "--no-deps")
    subprocess.run([*pip, "-w", str(folder), str(source)], check=True)
    (built,) = folder.glob("humanoid_getup-*.whl")
    return built


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Install the wheel in a new environment, which borrows the dependencies of this one."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=True)
    purelib = sysconfig.get_path("purelib", "venv", {"base": str(folder)})
    pip = (sys.executable, "-m", "pip", "--python", str(folder / "bin" / "python"))
    subprocess.run([*pip, "install", "-q", "--no-deps", str(wheel)], check=True)
    Path(purelib, "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder


@pytest.fixture
def run(environment: Path, tmp_path: Path):
    """Run a program of the new environment in an empty folder."""
    clean = {key: value for key, value in os.environ.items() if key != "PYTHONPATH"}

    def run(name: str, *arguments: str) -> str:
        command = [environment / "bin" / name, *arguments]
        result = subprocess.run(command, cwd=tmp_path, env=clean, capture_output=True, text=True)
        assert result.returncode == 0, result.stderr
        return result.stdout

    return run


def test_every_file_of_the_packages_is_in_the_wheel(wheel: Path):
    packed = set(zipfile.ZipFile(wheel).namelist())
    tracked = list_files(*PACKAGES)
    assert len(tracked) > 200
    assert [f for f in tracked if f not in packed and Path(f).suffix not in LEFT_OUT] == []
    assert {f"{package}/py.typed" for package in PACKAGES} <= packed


def test_the_installed_package_is_what_runs(run, environment: Path):
    for package in nonempty(PACKAGES):
        file = run("python", "-c", f"import {package}; print({package}.__file__)").strip()
        assert Path(file).is_relative_to(environment)


def test_an_installed_robot_gets_up(run, tmp_path: Path):
    assert "op3" in run("getup", "robots")
    motions = json.loads(run("getup", "motions", "list", "--json", "-"))["motions"]
    assert len(motions) == len(list((load_robot("op3").folder / "motions").glob("*.npz")))
    run("getup", "rise", "--from", "supine", "--out", "out")
    assert json.loads((tmp_path / "out" / "report.json").read_text())["stood"] is True


def test_an_installed_policy_gets_a_robot_up(run, tmp_path: Path):
    run("getup", "run", "robust", "--from", "prone", "--seed", "1", "--out", "out")
    assert json.loads((tmp_path / "out" / "report.json").read_text())["stood"] is True
