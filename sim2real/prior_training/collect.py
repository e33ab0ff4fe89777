"""Collects rises for the pose prior: stored motions, planned rises, and those of policies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import as_completed
from pathlib import Path

import mujoco
import numpy as np

from humanoid_getup.experiments.starts.drop import Drops
from humanoid_getup.experiments.starts.falls import CLASSES, sample_fall_set
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.progress.worker_pool import worker_pool
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from robots import Posture, Robot
from robots.kinematics import place_postures, transfer_positions
from sim2real.environment.physics.training_simulation import TrainingSim
from sim2real.environment.physics.training_world import build_training_world
from sim2real.environment.starts.settled_falls import drop_falls
from sim2real.policy_evaluation import PolicyDriver, roll_out_policy
from sim2real.pose_prior.rise_set import PERIOD, POLICY_SOURCE, CollectedRise

PRIOR_SEED = 7_003  # makes these falls differ from those of trainings and evaluations
LONGEST = 8.0  # s of a policy's rollout
AFTER = 4  # frames of the stand that belong to a rise
SHORTEST = 12  # frames of a rise
LEDGER = "ledger.jsonl"
"""Ledger of the planned rises and of whether each stands."""
PHYSICS_STEP = 0.002  # s, the twin's


def plan_rises(
    robot: Robot, count: int, seed: int, folder: Path, jobs: int, report: Callable[[float], None]
) -> list[Motion]:
    """Plan rises from settled falls, equally many of each class, in processes.

    Those that stand are kept in a folder of this count and seed, so that the planning can be
    interrupted: what is there already is not planned again. Each rise is reported.
    """
    own_seed = int(np.random.default_rng([seed, PRIOR_SEED]).integers(2**31))
    each = -(-count // len(CLASSES))
    falls = sample_fall_set(World(robot, "flat"), dict.fromkeys(CLASSES, each), own_seed).falls
    kept = folder / f"plans_{count}_seed_{seed}"
    kept.mkdir(parents=True, exist_ok=True)
    recipe = {"robot": robot.name, "count": count, "seed": seed}
    ledger = Ledger.resume(kept / LEDGER, recipe)
    files = {f"{number:05d}": kept / f"{number:05d}.npz" for number in range(len(falls))}
    done = [name for name, stood in ledger.done.items() if not stood or files[name].exists()]
    report(len(done))
    with worker_pool(jobs, _start_planner, robot) as pool:
        started = {
            pool.submit(_plan, fall.posture, (own_seed, number), file): name
            for number, (fall, (name, file)) in enumerate(zip(falls, files.items(), strict=True))
            if name not in done
        }
        for planned in as_completed(started):
            ledger.add(started[planned], planned.result())
            report(1)
    return [_load_plan(file) for name, file in files.items() if ledger.done[name]]


def _load_plan(file: Path) -> Motion:
    """Load a planned motion of a robot."""
    try:
        motion = Motion.load(file)
    except ValueError as error:
        raise ValueError(f"{error}; delete it, and it is planned again") from error
    return motion


_planner: PlannedRise
"""In a worker: its planner."""


def _start_planner(robot: Robot) -> None:
    global _planner
    _planner = PlannedRise(World(robot, "flat"), options=PlannerOptions(threads=1))


def _plan(start: Posture, seed: tuple[int, int], file: Path) -> bool:
    """In a worker: plan a rise, and write the motion if it stands; return whether it does."""
    plan = _planner.plan(start, np.random.default_rng(seed))
    if isinstance(plan, MotionPlan) and plan.status is RiseStatus.STOOD:
        plan.motion.save(file)
        return True
    return False


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
    """Load one of the robot's policies that rises can be taken from.

    Raises:
        ValueError: if there is none of this name, or it follows style curves.
    """
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
    world = build_training_world(
        robot, World(robot, "flat").scene, robot.choose_timestep(PHYSICS_STEP)
    )
    action = policy.action
    sim = TrainingSim(world, count, cycles=action.cycles, pwm_limit=action.pwm_limit)
    rng = np.random.default_rng([seed, PRIOR_SEED, *name.encode()])
    falls = drop_falls(Drops(world, count), count, rng)
    driver = PolicyDriver.of(policy)
    rollouts = roll_out_policy(sim, driver, falls, duration=LONGEST)
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
    count: int,
    seed: int,
    folder: Path,
    policies: Mapping[str, OnnxPolicy],
    *,
    jobs: int = 1,
    report: Callable[[float], None] = lambda _: None,
) -> list[CollectedRise]:
    """Collect the robot's stored motions, ``count`` planned rises, and half as many of policies.

    Raises:
        FallError: if too few falls settle.
        ValueError: if the robot has no motions.
    """
    model = robot.spec().compile()
    stored = [motion for motion in load_database(robot).motions if motion.rises]
    rises = [read_motion(robot, model, motion, "stored") for motion in stored]
    planned = plan_rises(robot, count, seed, folder, jobs, report)
    rises += [read_motion(robot, model, motion, "planned") for motion in planned]
    for name, policy in policies.items():
        if each := count // (2 * len(policies)):
            rises += roll_out(robot, name, policy, each, seed)
    return rises
