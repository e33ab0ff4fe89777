"""`--body`: what a run writes names the body, and what reads it finds the same one."""

import json
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.cli.main import main
from humanoid_getup.experiments.starts.falls import settle_posture
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.retargeting import BODY
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from robots import Body, load_robot
from robots.kinematics import read_posture

BODY_TEXT = "shoulders=1.2"


@pytest.mark.usefixtures("no_film")
def test_a_flight_with_another_body_is_replayed_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    out = tmp_path / "wide"
    flown = f"play prone_push_up_gentle --body {BODY_TEXT} --out {out}"
    assert main(flown.split()) == 0
    assert json.loads((out / "report.json").read_text())["body"] == BODY_TEXT
    assert Motion.load(out / "motion.npz").provenance[BODY] == BODY_TEXT
    capsys.readouterr()
    assert main(["replay", str(out / "flight.mcap"), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["about"]["body"] == BODY_TEXT


def test_a_plan_names_the_body_that_it_was_made_for(rng: np.random.Generator):
    world = World(load_robot("op3", Body.parse(BODY_TEXT)))
    planner = PlannedRise(world, options=PlannerOptions(planning=False, filtering=False))
    motion = planner.database.rising[0]
    start = read_posture(world.robot, world.model, settle_posture(world, motion.posture(0)))
    plan = planner.plan(start, rng)
    assert plan.motion is not None
    assert plan.motion.provenance[BODY] == BODY_TEXT


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_a_verdict_says_which_body_it_judged(tmp_path: Path):
    file = tmp_path / "verdict.json"
    command = f"preflight squat_to_stand --body {BODY_TEXT} --json {file}"
    assert main(command.split()) == 0
    assert json.loads(file.read_text())["body"] == BODY_TEXT
