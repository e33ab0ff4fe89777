"""A key posture on the way: how a robot rests in it, and gets up from there."""

from __future__ import annotations

import numpy as np

from humanoid_getup.experiments.disturbances import USUAL, Scenarios
from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions.motion_database import KeyPosture
from humanoid_getup.posture_chains.chain_search import ChainSearch, ChainTools
from humanoid_getup.posture_chains.features import ARRIVED, PostureMeter
from humanoid_getup.posture_chains.goal import PostureGoal
from humanoid_getup.posture_chains.move_player import measure_time_scale
from humanoid_getup.simulation.world import World
from robots import Posture, TorqueLimit
from robots.kinematics import place

ROUNDS, HOLDING = 3, 1.5  # in which targets are led, and s for OP3 of each
WORLDS, KEPT = 16, 14  # disturbed worlds in which a posture is held, and has to stay
BUDGET = 10_000.0  # s simulated, for the way from the posture to a stand


def find_key_goal(tools: ChainTools, key: KeyPosture) -> PostureGoal:
    """Find how a robot rests in a key posture, and gets up from there.

    Raises:
        ValueError: if it does not.
    """
    world, limit = tools.world, tools.settings.limit
    goal, count = None, 0
    for posture in (key.posture, *key.others):
        tried = settle(world, posture, limit)
        held = 0 if tried is None else _count_held(world, tried, limit)
        if held > count:
            goal, count = tried, held
        if count >= KEPT:
            break
    if goal is None or count < KEPT:
        raise ValueError(
            f"posture '{key.name}': robot '{world.robot.name}' rests in it in {count} of {WORLDS} "
            f"disturbed worlds, expected {KEPT} at least"
        )
    search, before = ChainSearch(tools, goal.qpos, goal.target), tools.player.simulated
    while not any(chain.fallen == 0 for chain in search.chains):
        if tools.player.simulated - before > BUDGET:
            break
        search.advance()
    if not search.chains:
        raise ValueError(
            f"posture '{key.name}': no way from it to a stand was found in {BUDGET:,.0f} s "
            "simulated, expected one from which the robot gets up"
        )
    onward = search.shorten(search.chains[0]).moves
    return PostureGoal(world, goal.qpos, goal.target, touches=goal.touches, onward=onward)


def settle(world: World, posture: Posture, limit: TorqueLimit) -> PostureGoal | None:
    """Hold a posture with targets that lead its angles; None if the robot leaves it."""
    robot, start = world.robot, place(world.robot, world.model, posture)
    target, experiment = posture.joint_pos, Experiment(world, threads=1)
    count = round(HOLDING * measure_time_scale(robot) / robot.control_period)
    for _ in range(ROUNDS):
        held = np.repeat(target[None, None], count, axis=1)
        record = experiment.play(Scenarios.nominal(world, start, limit), held)
        led = posture.joint_pos + target - record.joint_pos[0, -1]
        target = np.clip(led, robot.lower, robot.upper)
    touches = bool(record.stance.non_foot_contact[0, -1])
    goal = PostureGoal(world, record.qpos[0, -1], held[0, 0], touches=touches)
    near = PostureMeter(world, start).measure(goal.qpos[None]).progress[0] >= ARRIVED
    return goal if near else None


def _count_held(world: World, goal: PostureGoal, limit: TorqueLimit) -> int:
    """Count the disturbed worlds in which a robot stays in a posture."""
    worlds = USUAL.sample(world, goal.qpos, WORLDS, np.random.default_rng(0), limit)
    count = round(2.0 * HOLDING * measure_time_scale(world.robot) / world.robot.control_period)
    held = np.broadcast_to(goal.target, (WORLDS, count, world.robot.n))
    record = Experiment(world, threads=1).play(worlds, held)
    return int(goal.is_reached(record, round(HOLDING / 2.0 / record.period)).sum())
