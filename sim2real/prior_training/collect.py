"""Collects rises for the pose prior: stored motions, planned rises, and those of policies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path

import mujoco
import numpy as np

from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.engines.versions import checked
from humanoid_getup.experiments.drop import Drops
from humanoid_getup.experiments.falls import CLASSES, sample_fall_set
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.planning.planner_settings import PlannerSettings
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.progress.callback import ProgressMonitor
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Posture, Robot, load_robot
from robots.kinematics import place_postures, transfer_positions
from sim2real.environment.starts import drop_falls
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import build_training_world
from sim2real.policy_evaluation import PolicyRun
from sim2real.pose_prior import PERIOD, POLICY_SOURCE, CollectedRise

PRIOR_SEED = 7_003  # makes these falls differ from those of trainings and evaluations
LONGEST = 8.0  # s of a policy's rollout
AFTER = 4  # frames of the stand that belong to a rise
SHORTEST = 12  # frames of a rise
LEDGER = "ledger.jsonl"
"""Ledger of the planned rises and of whether each stands."""


@dataclass(frozen=True, kw_only=True)
class PriorPiece:
    """A rise to plan, which depends on nothing but this and the robot."""

    start: Posture
    seed: tuple[int, int]
    """Of all rises, and its number."""


StartWorkers = Callable[[int], AbstractContextManager[Executor]]
"""Starts the workers for a number of pieces."""


def plan_rises(
    robot: Robot,
    robot_name: str,
    count: int,
    seed: int,
    folder: Path,
    start: StartWorkers,
    monitor: ProgressMonitor,
) -> list[Motion]:
    """Plan rises from settled falls, equally many of each class.

    Those that stand are kept in a folder of this count and seed, so that the planning can be
    interrupted: what is there already is not planned again. Workers load the robot by its name or
    folder.
    """
    report = monitor.count("rises", count)
    own_seed = int(np.random.default_rng([seed, PRIOR_SEED]).integers(2**31))
    each = -(-count // len(CLASSES))
    falls = sample_fall_set(World(robot, "flat"), dict.fromkeys(CLASSES, each), own_seed).falls
    kept = folder / f"plans_{count}_seed_{seed}"
    kept.mkdir(parents=True, exist_ok=True)
    recipe = {"robot": robot.name, "count": count, "seed": seed}
    ledger = Ledger.resume(kept / LEDGER, recipe)
    files = {f"{number:05d}": kept / f"{number:05d}.npz" for number in range(len(falls))}
    done = {name for name, stood in ledger.done.items() if not stood or files[name].exists()}
    report(len(done))

    def end(name: str, motion: Motion | None) -> None:
        if motion is not None:
            motion.save(files[name])
        ledger.add(name, motion is not None)
        report(1)

    pieces = {
        name: PriorPiece(start=fall.posture, seed=(own_seed, number))
        for number, (name, fall) in enumerate(zip(files, falls, strict=True))
        if name not in done
    }
    with start(len(pieces)) as executor:
        work = partial(plan_piece, robot_name, 0 if is_here(executor) else 1)
        work = checked(work, executor, robot_name)
        do_pieces(work, pieces, executor, ended=end, monitor=monitor)
    _make_planner.cache_clear()  # the robot may change
    return [_load_plan(file) for name, file in files.items() if ledger.done[name]]


def _load_plan(file: Path) -> Motion:
    try:
        return Motion.load(file)
    except ValueError as error:
        raise ValueError(f"{error}; delete it, and it is planned again") from error


def plan_piece(robot: str, threads: int, piece: PriorPiece) -> Motion | None:
    """Plan a rise of a robot or its folder, in a worker; return its motion if it stands."""
    plan = _make_planner(robot, threads).plan(piece.start, np.random.default_rng(piece.seed))
    if plan.motion is not None and plan.status is RiseStatus.STOOD:
        return plan.motion
    return None


@lru_cache(maxsize=1)
def _make_planner(robot: str, threads: int) -> PlannedRise:
    """Make the planner of a worker, once."""
    return PlannedRise(World(load_robot(robot), "flat"), settings=PlannerSettings(threads=threads))


def read_motion(robot: Robot, model: mujoco.MjModel, motion: Motion, kind: str) -> CollectedRise:
    """Read the frames of a motion."""
    time = np.arange(motion.time[0], motion.time[-1] + 1e-9, PERIOD)
    k = np.clip(np.searchsorted(motion.time, time), 0, len(motion.time) - 1)
    qpos = place_postures(
        robot, model, motion.position[k], motion.orientation[k], motion.joint_pos[k]
    )
    return CollectedRise(
        source=f"{kind}: {motion.strategy}", qpos=qpos, joint_target=motion.joint_target[k]
    )


def load_policy(robot: Robot, name: str) -> OnnxPolicy:
    """Load one of the robot's policies that rises can be taken from."""
    policy = OnnxPolicy.load(find_policy(robot, name), robot)
    if policy.contract.style is not None:
        raise ValueError(
            f"policy '{name}' follows style curves, expected one that rises without them"
        )
    return policy


def roll_out(
    robot: Robot, name: str, policy: OnnxPolicy, count: int, seed: int
) -> Iterator[CollectedRise]:
    """Roll out a policy from settled falls; yield the rises that stood."""
    step = robot.choose_timestep(0.002)  # s, the twin's
    world = build_training_world(robot, World(robot, "flat").scene, step)
    action = policy.action
    sim = TrainingSim(world, count, cycles=action.cycles, pwm_limit=action.pwm_limit)
    rng = np.random.default_rng([seed, PRIOR_SEED, *name.encode()])
    falls = drop_falls(Drops(world, count), count, rng)
    rollouts = PolicyRun(sim=sim, policy=policy, duration=LONGEST).run(falls)
    model = robot.spec().compile()
    for row in np.flatnonzero(rollouts.outcome.stood):
        end = round(rollouts.outcome.stand_time[row] / PERIOD) + AFTER
        qpos = transfer_positions(robot, world.model, model, rollouts.qpos[row, :end])
        if len(qpos) >= SHORTEST:
            joint_pos = qpos[:, robot.layout(model).qpos]
            # What is sent shortly before is where the joints are one step later, or beyond.
            target = np.concatenate([joint_pos[1:], joint_pos[-1:]])
            yield CollectedRise(source=f"{POLICY_SOURCE}{name}", qpos=qpos, joint_target=target)


def collect_rises(
    robot: Robot,
    robot_name: str,
    count: int,
    seed: int,
    folder: Path,
    policies: Mapping[str, OnnxPolicy],
    start: StartWorkers,
    monitor: ProgressMonitor,
) -> list[CollectedRise]:
    """Collect the robot's stored motions, ``count`` planned rises, and half as many of policies.

    The folder keeps the plans.
    """
    model = robot.spec().compile()
    stored = [motion for motion in load_database(robot).motions if motion.rises]
    rises = [read_motion(robot, model, motion, "stored") for motion in stored]
    planned = plan_rises(robot, robot_name, count, seed, folder, start, monitor)
    rises += [read_motion(robot, model, motion, "planned") for motion in planned]
    for name, policy in policies.items():
        if each := count // (2 * len(policies)):
            rises += roll_out(robot, name, policy, each, seed)
    return rises
