"""Experts: what robots should do next on the way of a known rise.

A rise that was planned is known by its targets over time; one of a policy by the policy itself,
which answers to what it finds.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.action import next_target
from humanoid_getup.policy.observation import compute_torque_share, observe
from humanoid_getup.policy.onnx_policy import OnnxPolicy, find_policy
from robots.quaternion import Array
from sim2real.environment.get_up_env import GetUpEnv
from sim2real.environment.style_task import StyleTask
from sim2real.pose_prior.rise_set import POLICY_SOURCE


class Expert(Protocol):
    """Knows the joint targets at the end of the next policy step."""

    def find_targets(self) -> tuple[Array, NDArray[np.bool_]]:
        """Return joint targets [rad], (N, n), and for which robots they are known, (N,)."""
        ...


class MotionExpert:
    """Knows the targets of planned motions over time."""

    def __init__(self, env: GetUpEnv, task: StyleTask) -> None:
        self._env, self._task = env, task
        self._known = np.array(
            [bool(s) and not s.startswith(POLICY_SOURCE) for s in task.library.sources]
        )

    def find_targets(self) -> tuple[Array, NDArray[np.bool_]]:
        """Return the targets of each robot's own motion."""
        task = self._task
        share = (task.guide.time + self._env.step_time) / task.guide.duration
        target = task.library.interpolate_targets(task.row, share)
        return np.nan_to_num(target), self._known[task.row]


class PolicyExpert:
    """Asks a policy what it would do."""

    def __init__(self, env: GetUpEnv, task: StyleTask, name: str) -> None:
        self._env, self._task = env, task
        self._policy = OnnxPolicy.load(find_policy(env.robot, name), env.robot)
        self._known = np.array([s == f"{POLICY_SOURCE}{name}" for s in task.library.sources])
        self._memory = np.zeros((env.num_envs, self._policy.action.size))

    def find_targets(self) -> tuple[Array, NDArray[np.bool_]]:
        """Return the targets that the policy would send."""
        env, action = self._env, self._policy.action
        self._memory[env.ages == 0] = 0.0
        share = compute_torque_share(env.robot, action, env.sim.parameters.torque_limit)
        seen = observe(env.robot, env.sensed, env.target, self._memory, share)
        outputs, self._memory = self._policy.act(seen)
        targets = next_target(
            env.robot,
            action,
            env.target,
            env.sensed.joint_pos,
            env.sensed.gravity,
            np.clip(outputs, -1.0, 1.0),
        )
        return targets, self._known[self._task.row]


def find_experts(env: GetUpEnv, task: StyleTask) -> list[Expert]:
    """Find the experts of all curves of a training."""
    names = {
        s.removeprefix(POLICY_SOURCE) for s in task.library.sources if s.startswith(POLICY_SOURCE)
    }
    return [MotionExpert(env, task), *(PolicyExpert(env, task, name) for name in sorted(names))]
