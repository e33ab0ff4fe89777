"""Compare mujoco-warp with MuJoCo: the same falls, the same policy, the same judge, in one run.

Robots that tumble are chaotic. MuJoCo from starts that differ by the rounding of single precision
shows how much of a difference that alone makes.

    python benchmarks/warp_parity.py --n 256 --policy robust --json parity.json
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from json import dumps
from pathlib import Path

import numpy as np
import tyro
from numpy.typing import NDArray

from humanoid_getup.experiments.drop import Drops, DropSampler
from humanoid_getup.experiments.falls import classify
from humanoid_getup.experiments.judging.summary import wilson_interval
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import ANYWHERE
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.physics_engine import MUJOCO, PhysicsEngine
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World
from robots import load_robot
from robots.quaternion import Array
from sim2real.environment.starts import SETTLED_SPEED
from sim2real.environment.training_simulation import TrainingSim
from sim2real.environment.training_world import MODEL_VARIANTS, build_training_world
from sim2real.policy_evaluation import PolicyRun

STATES, STEPS_BETWEEN = 24, 4  # of each fall, from which single steps are compared
SAME_SPEED = 0.01  # rad/s and m/s
Labels = NDArray[np.str_]


@dataclass(frozen=True)
class Timed:
    """What an engine made of all robots, and in how many seconds."""

    labels: Labels
    """(N,)"""
    seconds: float


def settle(world: World, physics: PhysicsEngine, starts: Array) -> tuple[Timed, Array]:
    """Let robots fall limp; return where they lie, by class, and their MuJoCo positions."""
    drops = Drops(world, len(starts), threads=1, physics=physics)
    drops.settle(starts, SETTLED_SPEED, longest=0.1)  # loads the kernels
    began = time.perf_counter()
    qpos, settled = drops.settle(starts, SETTLED_SPEED)
    seconds = time.perf_counter() - began
    at = world.robot.layout(world.model).root_orientation
    sides = [classify(row[at]) for row in qpos]
    labels = [side if side and ok else "none" for side, ok in zip(sides, settled, strict=True)]
    return Timed(np.array(labels), seconds), qpos


def rise(world: World, physics: PhysicsEngine, policy: OnnxPolicy, starts: Array) -> Timed:
    """Let a policy get all robots up; return who stood."""
    action = policy.action
    sim = TrainingSim(
        world,
        len(starts),
        cycles=action.cycles,
        pwm_limit=action.pwm_limit,
        threads=1,
        physics=physics,
    )
    began = time.perf_counter()
    rollouts = PolicyRun(sim=sim, policy=policy).run(starts)
    stood = np.where(rollouts.outcome.stood, "stood", "not")
    return Timed(stood, time.perf_counter() - began)


def rounded(starts: Array) -> Array:
    """Round MuJoCo positions to single precision."""
    return starts.astype(np.float32).astype(float)


def compare(name: str, one: Timed, other: Timed) -> dict[str, object]:
    """Print and return how often two engines agree, and how often each label occurs."""
    agree, n = int(np.sum(one.labels == other.labels)), len(one.labels)
    low, high = wilson_interval(agree, n)
    counts = {
        label: (int(np.sum(one.labels == label)), int(np.sum(other.labels == label)))
        for label in np.unique([one.labels, other.labels]).tolist()
    }
    print(f"{name}: {agree} of {n} agree ({agree / n:.3f}, {low:.3f} to {high:.3f}); {counts}")
    return {"n": n, "agree": agree, "interval_95": (low, high), "counts": counts}


def compare_steps(world: World, starts: Array, warp: PhysicsEngine) -> dict[str, object]:
    """Take single steps from the same states of falls; print and return how many differ."""
    n = len(starts)
    falling, *engines = (VecSim(world, n, threads=1, physics=p) for p in (MUJOCO, MUJOCO, warp))
    limp = DomainParameters.nominal(world, n, torque_limit=0.0)
    for sim in (falling, *engines):
        sim.set_parameters(sim.everyone, limp)
    falling.place(falling.everyone, starts)
    target = np.zeros((n, world.robot.n))
    largest = []
    for _ in range(STATES):
        falling.hold(target, STEPS_BETWEEN)
        for sim in engines:
            sim.place(sim.everyone, falling.qpos, falling.qvel)
            sim.hold(target, 1)
        one, other = engines
        largest.append(np.abs(one.qvel - other.qvel).max(axis=1))
    change = np.concatenate(largest)
    differ = int(np.sum(change > SAME_SPEED))
    print(f"steps: {differ} of {change.size} differ by more than {SAME_SPEED:g} rad/s or m/s")
    return {"n": change.size, "differ": differ, "median": float(np.median(change))}


def sample_starts(world: World, n: int, seed: int) -> Array:
    """Sample postures in which robots are dropped, (n, nq)."""
    sampler = DropSampler(world, world.scene.starts or (ANYWHERE,))
    rng = np.random.default_rng(seed)
    return np.array([sampler.sample(rng) for _ in range(n)])


def compare_engines(
    name: str, play: Callable[[PhysicsEngine, Array], Timed], starts: Array, warp: PhysicsEngine
) -> dict[str, object]:
    """Play both engines, and MuJoCo from rounded starts."""
    mujoco, same = play(MUJOCO, starts), play(MUJOCO, rounded(starts))
    other = play(warp, starts)
    ratio = mujoco.seconds / other.seconds
    print(f"{name}: MuJoCo {mujoco.seconds:.1f} s on one thread, warp {other.seconds:.1f} s")
    return {
        "warp": compare(f"{name}, mujoco and warp", mujoco, other),
        "rounded": compare(f"{name}, mujoco and mujoco from rounded starts", mujoco, same),
        "speed_of_warp_over_mujoco": ratio,
    }


def main(
    *,
    robot: str = "op3",
    policy: str = "robust",
    scene: str = "flat",
    n: int = 256,
    seed: int = 0,
    step: float = 0.004,
    variant: str = "",
    device: str = "",
    json: Path | None = None,
) -> None:
    """Compare mujoco-warp with MuJoCo.

    Args:
        robot: Name of a robot.
        policy: Name of one of its policies; '' for falls alone.
        scene: Name of a scene.
        n: Falls.
        seed: Of the falls.
        step: Physics step [s].
        variant: Name of a model variant for both, such as 'elliptic cones'.
        device: Of mujoco-warp: cpu, cuda or cuda:N; default: a GPU if there is one.
        json: File for the results.
    """
    loaded, warp = load_robot(robot), PhysicsEngine("warp", device)
    variants = (MODEL_VARIANTS[variant],) if variant else ()
    world = build_training_world(loaded, load_scene(scene, loaded), step, variants=variants)
    starts = sample_starts(world, n, seed)
    found: dict[str, dict[str, object]] = {
        "settled": compare_engines("settled", lambda p, q: settle(world, p, q)[0], starts, warp)
    }
    found["steps"] = compare_steps(world, starts, warp)
    if policy:
        network = OnnxPolicy.load(find_policy(loaded, policy), loaded)
        lying = settle(world, MUJOCO, starts)[1]
        found["rises"] = compare_engines(
            "rises", lambda p, q: rise(world, p, network, q), lying, warp
        )
    if json:
        record = {"name": "warp_parity", "robot": robot, "seed": seed, "n": n, "step": step}
        record |= {"scene": scene, "variant": variant}
        json.write_text(dumps(record | found, indent=1) + "\n", "utf-8")


if __name__ == "__main__":
    tyro.cli(main)
