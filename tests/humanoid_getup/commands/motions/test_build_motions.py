"""Builds of motions: the same on every engine, kept as far as they came, and continued."""

import shutil
from pathlib import Path

import pytest
from run_getup import Run

from humanoid_getup.commands.motions.build_motions import BuildRequest, build_motions
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.motion import Motion
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
