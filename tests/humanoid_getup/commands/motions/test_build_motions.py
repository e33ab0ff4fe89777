"""Builds of motions: the same on every engine, kept as far as they came, and continued."""

import shutil
from pathlib import Path

import pytest
from run_getup import Run

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.inputs import find_keyframes
from humanoid_getup.commands.motions.build_motions import (
    BuildPiece,
    BuildRequest,
    build_motions,
    build_piece,
)
from humanoid_getup.commands.pieces import SharedFolder, sharing
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.motion import Motion
from humanoid_getup.progress.callback import CancelledError, Progress
from humanoid_getup.progress.worker import passing_reports
from robots import load_robot

NAMES = ("squat_to_stand", "sit_and_lie_down")


def build(folder: Path, engine: str) -> dict[str, object]:
    """Build two motions in a copy of a robot's folder; return their targets and provenance."""
    copied = Path(shutil.copytree(folder, folder.with_name(f"on_{engine.replace(':', '_')}")))
    shutil.rmtree(copied / "motions")
    request = BuildRequest(names=NAMES, robot=str(copied), generations=1, engine=engine)
    assert sorted(build_motions(request).built) == sorted(NAMES)
    assert not (copied / "unfinished").exists()
    built = {name: Motion.load(copied / "motions" / f"{name}.npz") for name in NAMES}
    return {name: (each.joint_target.tobytes(), each.provenance) for name, each in built.items()}


@pytest.mark.scale
def test_motions_are_built_by_several_workers_as_by_one_process(copied_op3: Path):
    pytest.importorskip("distributed")
    here, *elsewhere = [build(copied_op3, engine) for engine in ("local:1", "local:2", "dask:2")]
    assert elsewhere == [here] * 2


def test_a_worker_that_does_not_share_the_folder_builds_nothing(copied_op3: Path, tmp_path: Path):
    (keyframes,) = find_keyframes(load_robot(copied_op3), NAMES[:1])
    folder = SharedFolder(folder=copied_op3, mark=tmp_path / "elsewhere")
    piece = BuildPiece(keyframes=keyframes, folder=folder)
    with pytest.raises(BadInputError, match="expected one that all machines share"):
        build_piece(BuildRequest(robot=str(copied_op3)), piece)
    assert not (copied_op3 / "unfinished").exists()


@pytest.mark.slow
def test_a_build_on_another_machine_ends_after_the_generation_in_which_it_is_released(
    copied_op3: Path,
):
    robot, generations = load_robot(copied_op3), list[float]()
    request = BuildRequest(robot=str(copied_op3), engine="dask:2", generations=3)
    (keyframes,) = find_keyframes(robot, NAMES[:1])

    def release(progress: Progress) -> None:
        generations.append(progress.done)
        assert folder.mark is not None
        folder.mark.unlink()

    cancelled = pytest.raises(CancelledError)
    with sharing(robot, request) as folder, passing_reports(release), cancelled:
        build_piece(request, BuildPiece(keyframes=keyframes, folder=folder))
    assert generations == [1.0]


@pytest.mark.slow
def test_a_build_that_fails_keeps_its_best_try_and_continues(
    run: Run, copied_op3: Path, tmp_path: Path
):
    (tmp_path / "kick.csv").write_text("time,l_knee_deg,r_knee_deg\n0,0,0\n0.3,60,-60\n")
    robot, unfinished = ("--robot", str(copied_op3)), copied_op3 / "unfinished"
    assert run("motions", "import", "kick.csv", "--start", "supine", *robot)[0] == 0
    wanted = ("motions", "build", "kick", *robot)
    code, out, _ = run(*wanted, "--generations", "1")
    assert code == 1
    message = " ".join(out.split())
    assert "not built: motion 'kick' does not end in a held stand: its neck came to" in message
    best = Motion.load(unfinished / "kick.npz")
    assert (best.name, best.end_class) == ("kick", "other")
    assert "neck came to" in str(best.provenance["failure"])
    assert len(load_keyframes(unfinished / "kick.toml", load_robot(copied_op3))) == 1
    code, out, _ = run(*wanted, "--generations", "2", "--resume")
    assert code == 1
    assert "kick continues after generation 1" in out
    assert len((unfinished / "kick.jsonl").read_text().splitlines()) == 1 + 2
    code, _, error = run(*wanted, "--resume", "--seed", "5")
    assert code == 2
    assert "kick.jsonl: made with another seed" in error
