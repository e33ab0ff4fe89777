import shutil
from pathlib import Path

import pytest
from run_getup import Run
from stored_plans import lie_at_start, plan_stored

from humanoid_getup.commands.main import main
from humanoid_getup.experiments.falls import sample_fall
from humanoid_getup.motions.motion_database import MotionDatabase, load_database
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot
from robots.description.posture_file import format_posture


@pytest.fixture
def run(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Run:
    """Run `getup` in an empty folder; return exit code, standard output, standard error."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str) -> tuple[int, str, str]:
        code = main(arguments)
        return code, *capsys.readouterr()

    return run


@pytest.fixture
def copied_op3(tmp_path: Path, op3: Robot) -> Path:
    """A folder of OP3 with motions and no policies, to be spoiled by the test."""
    ignore = shutil.ignore_patterns("policies")
    return Path(shutil.copytree(op3.folder, tmp_path / "op3", ignore=ignore))


@pytest.fixture(scope="session")
def database(op3: Robot) -> MotionDatabase:
    return load_database(op3)


@pytest.fixture(scope="session")
def supine(world: World) -> Posture:
    """A robot that fell on its back."""
    return sample_fall(world, "supine", seed=3).posture


@pytest.fixture(scope="session")
def lying(world: World, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The file of a posture, prone, where a stored motion begins."""
    file = tmp_path_factory.mktemp("lying") / "prone.json"
    file.write_text(format_posture(lie_at_start(world), world.robot))
    return str(file)


@pytest.fixture
def stored_plans(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plan a stored motion, without a search: enough for a robot that lies where it begins."""
    monkeypatch.setattr(PlannedRise, "plan", plan_stored)
