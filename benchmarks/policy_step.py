"""Time of a policy's control cycles, on one core.

    python benchmarks/policy_step.py robots/op3/policies/robust.onnx

Every sixth cycle observes and runs the network; the others interpolate targets. The
measurements come from a twin that the policy moves, so every branch is taken.
"""

from __future__ import annotations

import json
import time
from pathlib import Path
from typing import Annotated

import numpy as np
import tyro

from drivers import SafetyGuard, Twin
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from robots import load_robot

WARM_UP = 5  # policy steps that are not counted


def time_cycles(policy: OnnxPolicy, steps: int) -> np.ndarray:
    """Time each control cycle [s], (steps, cycles)."""
    guard = SafetyGuard(Twin(policy.robot))
    spent = []
    with guard:
        state = guard.read()
        policy.reset(state)
        for _ in range((WARM_UP + steps) * policy.action.cycles):
            begin = time.perf_counter()
            command = policy.step(state)
            spent.append(time.perf_counter() - begin)
            guard.write(command)
            state = guard.read()
    return np.array(spent).reshape(-1, policy.action.cycles)[WARM_UP:]


def main(
    policy: Annotated[Path, tyro.conf.Positional], *, robot: str = "op3", steps: int = 2000
) -> None:
    """Measure the time of a policy's control cycles and print it.

    Args:
        policy: ONNX file.
        robot: Name of a robot.
        steps: Policy steps.
    """
    loaded = load_robot(robot)
    spent = 1e3 * time_cycles(OnnxPolicy.load(policy, loaded, loaded.control_period), steps)  # ms
    figures = {
        "policy_steps": len(spent),
        "deciding_cycle_median_ms": float(np.median(spent[:, 0])),
        "deciding_cycle_p99_ms": float(np.percentile(spent[:, 0], 99)),
        "mean_cycle_median_ms": float(np.median(spent.mean(axis=1))),
    }
    print(json.dumps({key: round(value, 4) for key, value in figures.items()}, indent=1))


if __name__ == "__main__":
    tyro.cli(main)
