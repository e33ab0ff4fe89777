"""On a slope, robots stand uphill on flat soles, and begin with the ways up that are stored."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.experiments.disturbances import USUAL, Scenarios, Uniform
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.posture_chains.goal import Goal
from humanoid_getup.posture_chains.move_player import MovePlayer
from humanoid_getup.posture_chains.moves import RandomMoves
from humanoid_getup.posture_chains.resting_state import PostureMove
from humanoid_getup.posture_chains.stored_states import find_ways, load_ways, save_ways
from humanoid_getup.posture_chains.ways_up import WaysUp
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Body, Robot, load_robot, quaternion
from robots.body.limbs import Limbs
from robots.body.squats import fit_stance
from robots.body.statics import Statics
from robots.kinematics import place


@pytest.mark.parametrize("degrees", [20, 30, -30])
def test_the_stance_fitted_to_a_slope_is_held_facing_uphill(op3: Robot, degrees: int):
    world = World(op3, load_scene(f"slope:{degrees}", op3))
    statics = Statics(op3, world.scene.footing)
    angles = fit_stance(Limbs(op3), statics.up)
    assert angles is not None
    start = place(op3, world.model, statics.make_posture(angles))
    cycles = round(4.0 / op3.control_period)
    targets = np.tile(statics.find_targets(angles), (1, cycles, 1))
    record = Experiment(world, threads=1).play(Scenarios.nominal(world, start), targets)
    assert Outcome(record, op3).stood[0]
    assert math.degrees(record.stance.tilt[0, -1]) < 6.0
    torso = record.qpos[0, -1, op3.layout(world.model).root_orientation]
    ahead = quaternion.rotate(torso, np.array([1.0, 0.0, 0.0]))
    assert ahead[0] * math.copysign(1.0, degrees) > 0.95


def test_no_disturbance_lets_a_robot_slide_off_a_slope(op3: Robot):
    drawn = USUAL.on_slope(load_scene("slope:30", op3)).ground_friction
    assert isinstance(drawn, Uniform)
    assert drawn.lower > math.tan(math.radians(30.0))
    assert USUAL.on_slope(load_scene("slope:10", op3)) is USUAL
    assert USUAL.on_slope(load_scene("flat", op3)) is USUAL


def test_ways_up_a_slope_come_back_from_their_file(
    op3: Robot, few_moves: RandomMoves, tmp_path: Path
):
    robot = replace(op3, folder=tmp_path)
    world = World(robot, load_scene("slope:30", robot))
    player = MovePlayer(world, Goal(world, moves=few_moves), np.random.default_rng(0), threads=1)
    assert load_ways(world, player.goal) == []
    stand = player.describe(player.goal.qpos, player.goal.target)
    up = PostureMove(knots=np.tile(stand.target, (2, 1)), duration=1.6, kind="squats")
    squat = place(robot, world.model, few_moves.squats.postures[-1])
    lower = player.describe(squat, few_moves.squats.targets[-1])
    known = [stand, replace(lower, after=stand, onward=up, depth=1)]
    file = find_ways(world)
    assert file is not None
    save_ways(file, known, world)
    ups = WaysUp(player, few_moves, np.random.default_rng(0), load_ways(world, player.goal))
    assert ups.are_stored
    first, second = ups
    assert np.array_equal(second.target, lower.target)
    assert second.cell == lower.cell
    assert second.after is first is ups.goal
    assert second.onward is not None
    assert np.array_equal(second.onward.knots, up.knots)


def test_a_damaged_file_of_ways_up_is_named(op3: Robot, few_moves: RandomMoves, tmp_path: Path):
    robot = replace(op3, folder=tmp_path)
    world = World(robot, load_scene("slope:30", robot))
    file = find_ways(world)
    assert file is not None
    file.parent.mkdir()
    file.write_bytes(b"cut")
    with pytest.raises(ValueError, match=r"ways up .*30\.npz: .*delete it to search from scratch"):
        load_ways(world, Goal(world, moves=few_moves))


def test_ways_up_are_stored_for_slopes_of_the_original_body_alone(op3: Robot):
    flat, slope = (World(op3, load_scene(name, op3)) for name in ("flat", "slope:30"))
    long = load_robot("op3", Body.parse("arms=1.6"))
    assert find_ways(flat) is None
    assert find_ways(World(long, load_scene("slope:30", long))) is None
    moves = RandomMoves(op3, None, slope.scene.footing)
    assert len(load_ways(slope, Goal(slope, moves=moves))) > 50
