"""Collects rises for the pose prior: stored motions, planned rises, and those of policies."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import mujoco
import numpy as np

from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.simulation.falls import CLASSES, sample_fall_set
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan, RiseStatus
from humanoid_getup.strategies.planned_rise import PlannedRise
from robots import Robot
from robots.kinematics import place_postures
from robots.quaternion import Array
from sim2real.environment.initial_states import drop_falls
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import build_training_world
from sim2real.policy_evaluation import roll_out_policy
from sim2real.pose_prior.rise_set import PERIOD, POLICY_SOURCE, Rise

PRIOR_SEED = 7_003  # makes these falls differ from those of trainings and evaluations
PLANS = "plans"
"""Folder of the planned motions, so that a collection can be interrupted."""
LONGEST = 8.0  # s of a policy's rollout
AFTER = 4  # frames of the stand that belong to a rise
SHORTEST = 12  # frames of a rise
PHYSICS_STEP = 0.002  # s, the twin's


def plan_rises(
    robot: Robot, count: int, seed: int, folder: Path, report: Callable[[float], None]
) -> list[Motion]:
    """Plan rises from settled falls, equally many of each class, and keep them in a folder.

    A rise that is there already is not planned again; each one is reported.
    """
    world = World(robot, "flat")
    own_seed = int(np.random.default_rng([seed, PRIOR_SEED]).integers(2**31))
    falls = sample_fall_set(world, dict.fromkeys(CLASSES, -(-count // len(CLASSES))), own_seed)
    planner = PlannedRise(world)
    folder.mkdir(parents=True, exist_ok=True)
    order = np.random.default_rng(own_seed).permutation(len(falls.falls))[:count]
    motions = []
    for number in order.tolist():
        file, missing = folder / f"{number:05d}.npz", folder / f"{number:05d}.none"
        if not file.exists() and not missing.exists():
            start = falls.falls[number].posture
            plan = planner.plan(start, np.random.default_rng([own_seed, number]))
            if isinstance(plan, MotionPlan) and plan.status is RiseStatus.STOOD:
                plan.motion.save(file)
            else:
                missing.touch()
        if file.exists():
            motions.append(Motion.load(file))
        report(1)
    return motions


def read_motion(robot: Robot, model: mujoco.MjModel, motion: Motion, kind: str) -> Rise:
    """Read the frames of a motion."""
    time = np.arange(motion.time[0], motion.time[-1] + 1e-9, PERIOD)
    k = np.clip(np.searchsorted(motion.time, time), 0, len(motion.time) - 1)
    qpos = place_postures(
        robot, model, motion.position[k], motion.orientation[k], motion.joint_pos[k]
    )
    return Rise(source=f"{kind}: {motion.strategy}", qpos=qpos, joint_target=motion.joint_target[k])


def roll_out(robot: Robot, name: str, count: int, seed: int) -> Iterator[Rise]:
    """Roll out one of the robot's policies from settled falls; yield the rises that stood."""
    policy = OnnxPolicy.load(find_policy(robot, name), robot)
    if policy.contract.style is not None:
        return
    world = build_training_world(robot, World(robot, "flat").scene, PHYSICS_STEP)
    action = policy.action
    sim = TrainingSim(world, count, cycles=action.cycles, pwm_limit=action.pwm_limit)
    rng = np.random.default_rng([seed, PRIOR_SEED, *name.encode()])
    falls = drop_falls(VecSim(world, count), count, rng)
    rollouts = roll_out_policy(sim, action, policy.act, falls, duration=LONGEST)
    model = robot.spec().compile()
    for row in np.flatnonzero(rollouts.stood):
        end = round(rollouts.stand_time[row] / PERIOD) + AFTER
        qpos = _keep_own(robot, world.model, model, rollouts.qpos[row, :end])
        if len(qpos) >= SHORTEST:
            joint_pos = qpos[:, robot.layout(model).qpos]
            # What is sent shortly before is where the joints are one step later, or beyond.
            target = np.concatenate([joint_pos[1:], joint_pos[-1:]])
            yield Rise(source=f"{POLICY_SOURCE}{name}", qpos=qpos, joint_target=target)


def collect_rises(
    robot: Robot,
    count: int,
    seed: int,
    folder: Path,
    policies: Sequence[str],
    report: Callable[[float], None] = lambda _: None,
) -> list[Rise]:
    """Collect the robot's stored motions, ``count`` planned rises, and half as many of policies.

    Raises:
        FallError: if too few falls settle.
        ValueError: if the robot has no motions, or not these policies.
    """
    model = robot.spec().compile()
    stored = [motion for motion in load_database(robot).motions if motion.rises]
    rises = [read_motion(robot, model, motion, "stored") for motion in stored]
    planned = plan_rises(robot, count, seed, folder / PLANS, report)
    rises += [read_motion(robot, model, motion, "planned") for motion in planned]
    each = count // (2 * max(len(policies), 1))
    for name in policies if each else ():
        rises += roll_out(robot, name, each, seed)
    return rises


def _keep_own(robot: Robot, model: mujoco.MjModel, own: mujoco.MjModel, qpos: Array) -> Array:
    """Convert MuJoCo positions (T, nq) in a world to those of the robot's own model."""
    there = robot.layout(model)
    return place_postures(
        robot,
        own,
        qpos[:, there.root_position],
        qpos[:, there.root_orientation],
        qpos[:, there.qpos],
    )
