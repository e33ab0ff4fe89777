"""`getup fall`: the file that it writes is the fall itself, and may be changed."""

import json
from pathlib import Path

import numpy as np
from paths import TINY
from run_getup import Run

from humanoid_getup.commands.inputs import find_start
from humanoid_getup.simulation.world import World
from robots import Robot


def test_a_start_from_the_file_of_a_fall_is_that_from_the_side_and_it_may_be_changed(
    run: Run, tmp_path: Path, tiny: Robot
):
    """Start and random numbers of the plan are the same, so the rise is."""
    file, world = tmp_path / "posture.json", World(tiny)
    words = ("--from", "prone", "--seed", "3", "--out", str(file), "--json", "-")
    code, said, told = run("fall", "--robot", str(TINY), *words)
    assert (code, told) == (0, f"tiny lies prone, seed 3: {file}\n")
    record = json.loads(file.read_text())
    assert json.loads(said) == record

    sampling, loading, heard = np.random.default_rng(3), np.random.default_rng(3), list[str]()
    sampled = find_start(world, "prone", sampling, heard.append).posture
    loaded = find_start(world, str(file), loading, heard.append).posture
    for name in ("position", "orientation", "joint_pos"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(sampled, name), name)
    assert loading.bit_generator.state == sampling.bit_generator.state
    assert heard == []

    record["position"][2] += 0.03
    del record["joint_pos"]["r_hip"]
    file.write_text(json.dumps(record))
    changed = find_start(world, str(file), loading, heard.append).posture
    assert changed.position[2] == record["position"][2]
    assert changed.joint_pos[1] == tiny.standing.joint_pos[1]
    assert heard == [f"posture file {file}: r_hip missing, taken from the stance"]


def test_without_a_file_to_write_it_is_refused(run: Run):
    assert run("fall", "--from", "prone") == (
        2,
        "",
        "getup: --out is missing, expected a posture file to write, or --json -\n",
    )
