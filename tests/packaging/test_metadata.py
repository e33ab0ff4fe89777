"""What the package says of itself: every import is declared, and where robots come from."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions

import pytest
from paths import REPOSITORY

PACKAGES = ("robots", "drivers", "humanoid_getup", "sim2real")
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text("utf-8"))["project"]
IMPORTED_BY_OTHERS = {"onnxscript", "tensorboard"}  # by torch's exporter and by rsl-rl
NOT_INSTALLED = {
    "dask_jobqueue": "dask-jobqueue",
    "rsl_rl": "rsl-rl-lib",
    "PIL": "pillow",
    "mcap_ros2": "mcap-ros2-support",
    "yaml": "pyyaml",
    "warp": "warp-lang",
    "mujoco_warp": "mujoco-warp",
}  # in every environment: modules named unlike their package
EXTRAS = ("train", "policies", "sdk", "studio", "ros", "dask", "slurm", "warp")


def list_imports() -> set[str]:
    """List the top-level modules that the packages import, anywhere in their files."""
    modules: set[str] = set()
    for package in PACKAGES:
        for file in (REPOSITORY / package).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text("utf-8"))):
                if isinstance(node, ast.Import):
                    modules |= {alias.name.split(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                    modules.add(node.module.split(".")[0])
    return modules - sys.stdlib_module_names - {*PACKAGES}


def list_declared(*extras: str) -> set[str]:
    """List the distributions that the package declares, with some extras."""
    optional = PROJECT["optional-dependencies"]
    rows = [*PROJECT["dependencies"], *(row for extra in extras for row in optional[extra])]
    return {re.split(r"[<>=\[; ]", row)[0].lower() for row in rows}


@pytest.fixture(scope="module")
def imported() -> dict[str, set[str]]:
    """The distributions of each imported module, lower case."""
    homes = packages_distributions()
    return {
        name: {d.lower() for d in homes.get(name, [NOT_INSTALLED.get(name, name)])}
        for name in list_imports()
    }


def test_every_imported_package_is_declared(imported: dict[str, set[str]]):
    declared = list_declared(*EXTRAS)
    assert [name for name, homes in imported.items() if not homes & declared] == []


def test_every_declared_package_is_imported(imported: dict[str, set[str]]):
    used = set().union(*imported.values())
    assert list_declared(*EXTRAS) - used - IMPORTED_BY_OTHERS == set()


def test_license_and_notice_are_filled_in_and_ship():
    assert set(PROJECT["license-files"]) == {"LICENSE", "NOTICE"}
    assert "[yyyy]" not in (REPOSITORY / "LICENSE").read_text("utf-8")


def test_the_notice_names_the_source_of_every_robot():
    notice = (REPOSITORY / "NOTICE").read_text("utf-8")
    robots = [file.parent.name for file in (REPOSITORY / "robots").glob("*/robot.toml")]
    assert len(robots) >= 4
    assert [robot for robot in robots if f"\nrobots/{robot}\n" not in notice] == []
