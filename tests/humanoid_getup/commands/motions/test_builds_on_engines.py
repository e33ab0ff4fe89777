"""Builds of motions on an engine: the same motions, in the folder that its workers share."""

import shutil
from pathlib import Path

import pytest

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.inputs import find_keyframes
from humanoid_getup.commands.motions.build_motions import (
    BuildPiece,
    BuildRequest,
    build_motions,
    build_piece,
)
from humanoid_getup.commands.pieces import SharedFolder, sharing
from humanoid_getup.motions.motion import Motion
from humanoid_getup.progress.callback import CancelledError, Progress
from humanoid_getup.progress.worker import passing_reports
from robots import Robot, load_robot

NAMES = ("squat_to_stand", "sit_and_lie_down")


def build(folder: Path, engine: str) -> dict[str, Motion]:
    """Build two motions in a copy of a robot's folder, on an engine."""
    copied = Path(shutil.copytree(folder, folder.with_name(f"on_{engine.replace(':', '_')}")))
    shutil.rmtree(copied / "motions")
    request = BuildRequest(names=NAMES, robot=str(copied), generations=1, engine=engine)
    assert sorted(build_motions(request).built) == sorted(NAMES)
    assert not (copied / "unfinished").exists()
    return {name: Motion.load(copied / "motions" / f"{name}.npz") for name in NAMES}


@pytest.mark.scale
def test_motions_are_built_by_several_workers_as_by_one_process(copied_op3: Path):
    pytest.importorskip("distributed")
    here, *elsewhere = [build(copied_op3, engine) for engine in ("local:1", "local:2", "dask:2")]
    assert [*map(_describe, elsewhere)] == [_describe(here)] * 2


def _describe(built: dict[str, Motion]) -> dict[str, object]:
    """Describe motions by their targets and by how they were made."""
    return {name: (each.joint_target.tobytes(), each.provenance) for name, each in built.items()}


def test_a_worker_that_does_not_share_the_folder_builds_nothing(copied_op3: Path, tmp_path: Path):
    (keyframes,) = find_keyframes(load_robot(copied_op3), NAMES[:1])
    folder = SharedFolder(folder=copied_op3, mark=tmp_path / "elsewhere")
    with pytest.raises(BadInputError, match="expected one that all machines share"):
        build_piece(
            BuildRequest(robot=str(copied_op3)), BuildPiece(keyframes=keyframes, folder=folder)
        )
    assert not (copied_op3 / "unfinished").exists()


@pytest.mark.slow
def test_a_build_on_another_machine_ends_after_the_generation_in_which_it_is_released(
    copied_op3: Path,
):
    robot, generations = load_robot(copied_op3), list[float]()
    assert isinstance(robot, Robot)
    request = BuildRequest(robot=str(copied_op3), engine="dask:2", generations=3)
    (keyframes,) = find_keyframes(robot, NAMES[:1])

    def release(progress: Progress) -> None:
        generations.append(progress.done)
        assert folder.mark is not None
        folder.mark.unlink()

    with sharing(robot, request) as folder, passing_reports(release):
        (copied_op3 / "unfinished").mkdir(exist_ok=True)
        with pytest.raises(CancelledError):
            build_piece(request, BuildPiece(keyframes=keyframes, folder=folder))
    assert generations == [1.0]
