"""`getup fall`: the file that it writes is the fall itself, and may be changed."""

import json
from pathlib import Path

import numpy as np
import pytest
from run_getup import Run

import humanoid_getup as hg
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.get_up import rise_session as rise
from humanoid_getup.commands.inputs import find_start


@pytest.fixture
def file(run: Run, tmp_path: Path) -> Path:
    """The posture file of a fall."""
    file = tmp_path / "posture.json"
    code, said, _ = run("fall", "--from", "prone", "--seed", "3", "--out", str(file))
    assert (code, said) == (0, f"op3 lies prone, seed 3: {file}\n")
    return file


def test_a_rise_from_the_file_begins_and_goes_on_as_one_from_the_side(file: Path, world: hg.World):
    """Start and random numbers of the plan are the same, so the rise is."""
    sampling, loading = np.random.default_rng(3), np.random.default_rng(3)
    sampled = find_start(world, "prone", sampling, print)
    loaded = find_start(world, str(file), loading, print)
    for name in ("position", "orientation", "joint_pos"):
        np.testing.assert_array_equal(
            getattr(loaded.posture, name), getattr(sampled.posture, name), name
        )
    assert loading.bit_generator.state == sampling.bit_generator.state


def test_standard_output_is_the_file(file: Path, run: Run):
    code, said, _ = run("fall", "--from", "prone", "--seed", "3", "--json", "-")
    assert code == 0
    assert json.loads(said) == json.loads(file.read_text())


def test_a_changed_file_is_what_it_says(file: Path, world: hg.World):
    record = json.loads(file.read_text())
    record["position"][2] += 0.01
    file.write_text(json.dumps(record))
    loaded = find_start(world, str(file), np.random.default_rng(3), print)
    assert loaded.posture.position[2] == record["position"][2]


def test_joints_left_out_take_the_stance_and_are_named(
    file: Path, run: Run, world: hg.World, monkeypatch: pytest.MonkeyPatch
):
    record = json.loads(file.read_text())
    for name in ("head_pan", "head_tilt"):
        del record["joint_pos"][name]
    file.write_text(json.dumps(record))
    loaded = find_start(world, str(file), np.random.default_rng(3), print)
    heads = [world.robot.joint_names.index(name) for name in ("head_pan", "head_tilt")]
    assert np.array_equal(loaded.posture.joint_pos[heads], world.robot.standing.joint_pos[heads])

    def end(*_: object, **__: object) -> None:
        raise BadInputError("that is all")

    monkeypatch.setattr(rise, "AttemptManager", end)
    code, _, error = run("rise", "--from", str(file))
    assert code == 2
    assert f"posture file {file}: head_pan, head_tilt missing, taken from the stance" in error


def test_without_a_file_to_write_it_is_refused(run: Run):
    assert run("fall", "--from", "prone") == (
        2,
        "",
        "getup: --out is missing, expected a posture file to write, or --json -\n",
    )
