"""Time of a policy's control cycles, on one core.

    python benchmarks/policy_step.py robots/op3/policies/robust.onnx

Every sixth cycle observes and asks the network; the others move the targets on. The
measurements are those of a twin that the policy moves, so no branch is spared.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

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


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description="Time of control cycles.")
    parser.add_argument("policy", type=Path, help="ONNX file")
    parser.add_argument("--robot", default="op3")
    parser.add_argument("--steps", type=int, default=2000, help="policy steps")
    arguments = parser.parse_args()
    robot = load_robot(arguments.robot)
    policy = OnnxPolicy.load(arguments.policy, robot, robot.control_period)
    spent = 1e3 * time_cycles(policy, arguments.steps)  # ms
    figures = {
        "policy_steps": len(spent),
        "deciding_cycle_median_ms": float(np.median(spent[:, 0])),
        "deciding_cycle_p99_ms": float(np.percentile(spent[:, 0], 99)),
        "mean_cycle_median_ms": float(np.median(spent.mean(axis=1))),
    }
    print(json.dumps({key: round(value, 4) for key, value in figures.items()}, indent=1))


if __name__ == "__main__":
    main()
