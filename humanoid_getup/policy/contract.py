"""The policy contract: the properties of a robot that a trained policy requires."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
import numpy as np

from humanoid_getup.policy.action import ActionMode, ActionSpec, Vector
from humanoid_getup.policy.observation import StyleInput, Term, list_terms
from robots import Robot
from robots.quaternion import Array
from robots.storage.validation import Names, positive, read_table, shown, whole

FORMAT = 5
IMU_FRAME = "gravity and gyro in the torso's frame: x forward, y left, z up"
SERVO_SLACK = 0.01  # share of a servo's position gain and torque
ANGLE_SLACK = 1e-6  # rad
TIME_SLACK = 1e-6  # share
SPEED_SLACK = 1e-6  # share of a servo's speed

Fact = Annotated[str | int | float | bool | None, msgspec.Meta(description="a text or a number")]


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyContract:
    """Properties with which a policy was trained, and which must match where it runs.

    It is stored as JSON in the metadata of the policy's ONNX file (`onnx_file`), with these
    fields. Their values are checked by :meth:`find_mismatches` only.
    """

    robot: str
    joints: Names
    """Names in the order of every vector of joints."""
    observation: tuple[Term, ...]
    """Parts of the observation, in their order."""
    action: ActionSpec
    control_period: Annotated[float, positive(1.0, "s")]
    """[s]"""
    rate_hz: Annotated[float, positive(10_000.0, "Hz")]
    """Policy steps per second."""
    position_gain: Vector
    """Position gains of the servos [N·m/rad], shape (n,)."""
    max_torque: Vector
    """Torques of the servos [N·m], shape (n,); a torque limit is observed as a share of the
    largest."""
    imu_frame: str
    provenance: dict[str, Fact]
    """How it was made: command, seed, iterations..."""
    style: StyleInput | None = None
    """Inputs with which it follows style curves; ``None`` if it follows none."""
    memory: Annotated[int, whole(0, 10_000)] = 0
    """Size of the memory of a network without style curves; 0 if it has none."""

    @staticmethod
    def of(
        robot: Robot,
        action: ActionSpec,
        period: float,
        provenance: Mapping[str, Fact],
        style: StyleInput | None = None,
        memory: int = 0,
    ) -> PolicyContract:
        """Build the contract of a policy from its robot, actions and control period [s]."""
        return PolicyContract(
            robot=robot.name,
            joints=robot.joint_names,
            observation=list_terms(robot, action, style, memory),
            action=action,
            control_period=period,
            rate_hz=1.0 / (period * action.cycles),
            position_gain=robot.position_gain,
            max_torque=robot.max_torque,
            imu_frame=IMU_FRAME,
            provenance=dict(provenance),
            style=style,
            memory=memory,
        )

    @property
    def observation_size(self) -> int:
        """Return the size of the observation."""
        return sum(term.size for term in self.observation)

    @property
    def memory_size(self) -> int | None:
        """Return the size of the network's memory; ``None`` if it has none."""
        return self.style.memory if self.style else self.memory or None

    def find_mismatches(self, robot: Robot, period: float) -> list[str]:
        """List every mismatch with a robot and its control period [s]."""
        problems = []
        if self.robot != robot.name:
            problems.append(f"robot: made for '{self.robot}', this is '{robot.name}'")
        if not robot.body.is_original:
            problems.append(f"body: made for the original, this is '{robot.body}'")
        if self.action.mode not in list(ActionMode):
            problems.append(f"action mode: '{self.action.mode}', expected {', '.join(ActionMode)}")
        problems += self._find_rate_mismatches(period)
        if self.imu_frame != IMU_FRAME:
            problems.append(f"IMU frame: '{self.imu_frame}', here '{IMU_FRAME}'")
        problems += self._find_joint_mismatches(robot)
        misshapen = self._find_shape_mismatches(robot)
        return problems + (misshapen or self._find_value_mismatches(robot, period))

    def _find_rate_mismatches(self, period: float) -> list[str]:
        here = 1.0 / (period * self.action.cycles)
        if np.isclose(self.rate_hz, here, rtol=TIME_SLACK, atol=0.0) and np.isclose(
            self.control_period, period, rtol=TIME_SLACK, atol=0.0
        ):
            return []
        return [
            f"rate: {self.rate_hz:.2f} Hz with a control period of {1e3 * self.control_period:g} "
            f"ms, here {here:.2f} Hz with {1e3 * period:g} ms"
        ]

    def _find_joint_mismatches(self, robot: Robot) -> list[str]:
        if self.joints == robot.joint_names:
            return []
        missing = [name for name in robot.joint_names if name not in self.joints]
        foreign = [name for name in self.joints if name not in robot.joint_names]
        if not missing and not foreign:
            pairs = zip(self.joints, robot.joint_names, strict=True)
            wrong, right = next((a, b) for a, b in pairs if a != b)
            return [f"joint order: '{wrong}' in place of '{right}'"]
        parts = [f"it lacks {', '.join(missing)}"] if missing else []
        parts += [f"it has {', '.join(foreign)}"] if foreign else []
        return [f"joints: {' and '.join(parts)}"]

    def _find_shape_mismatches(self, robot: Robot) -> list[str]:
        n, k = robot.n, len(self.action.names)
        problems = []
        layout = tuple((term.name, term.size) for term in self.observation)
        wanted = tuple(
            (term.name, term.size)
            for term in list_terms(robot, self.action, self.style, self.memory)
        )
        if layout != wanted:
            problems.append(f"observation: {_list_sizes(layout)}, here {_list_sizes(wanted)}")
        vectors = ("scale", "reach", "home", "homing", "position_gain", "max_torque")
        shapes = {"directions": (k, n), **dict.fromkeys(vectors, (n,))}
        for name, shape in shapes.items():
            found = getattr(self if hasattr(self, name) else self.action, name).shape
            if found != shape:
                problems.append(f"{name.replace('_', ' ')}: shape {found}, expected {shape}")
        if len(shares := self.action.gain_share) not in (0, n):
            problems.append(f"gain share: {len(shares)} numbers, expected {n}")
        if not all(0.0 < share <= 1.0 for share in shares):
            problems.append(f"gain share: {min(shares):g} to {max(shares):g}, expected 0 to 1")
        return problems

    def _find_value_mismatches(self, robot: Robot, period: float) -> list[str]:
        """Compare vectors of joints whose shapes match."""
        names = robot.joint_names
        gain, torque = robot.position_gain, robot.max_torque
        problems = _find_servo_mismatches("gains", names, self.position_gain, gain, "N·m/rad")
        problems += _find_servo_mismatches("torque", names, self.max_torque, torque, "N·m")
        off = np.abs(self.action.home - robot.standing.joint_pos)
        if off.max() > ANGLE_SLACK:
            i = int(off.argmax())
            problems.append(
                f"home angles: joint '{names[i]}' {self.action.home[i]:+.3f} rad, here "
                f"{robot.standing.joint_pos[i]:+.3f} rad"
            )
        if np.any(self.action.reach <= 0.0):
            i = int(self.action.reach.argmin())
            problems.append(
                f"reach: joint '{names[i]}' {self.action.reach[i]:g} rad, expected > 0 rad"
            )
        speed = self.action.reach / (self.action.cycles * period)
        if np.any(speed > robot.max_velocity * (1.0 + SPEED_SLACK)):
            i = int((speed / robot.max_velocity).argmax())
            problems.append(
                f"speed: targets of joint '{names[i]}' move at {speed[i]:.2f} rad/s, "
                f"the servo at {robot.max_velocity[i]:.2f} rad/s"
            )
        return problems

    def to_json(self) -> str:
        """Write the contract as JSON text."""
        record: dict[str, Any] = msgspec.to_builtins(self, enc_hook=np.ndarray.tolist)
        return json.dumps({"format": FORMAT, **record}, ensure_ascii=False, allow_nan=False)

    @staticmethod
    def from_json(text: str) -> PolicyContract:
        """Read a contract; raises ValueError that names every problem."""
        try:
            record = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"the policy contract is not JSON: {error}") from error
        if not isinstance(record, dict):
            raise ValueError(f"the policy contract is {shown(record)}, expected a JSON object")
        if record.get("format") != FORMAT:
            found = shown(record.get("format"))
            raise ValueError(f"the policy contract has format {found}, expected {FORMAT}")
        problems: list[str] = []
        contract = read_table(PolicyContract, record, "", problems)
        if problems:
            raise ValueError(f"the policy contract: {'; '.join(problems)}")
        return contract


def _find_servo_mismatches(
    what: str, names: tuple[str, ...], learned: Array, here: Array, unit: str
) -> list[str]:
    """Compare a figure of the servos, (n,), with that of this robot."""
    off = np.abs(learned / here - 1.0)
    if off.max() <= SERVO_SLACK:
        return []
    i = int(off.argmax())
    return [f"{what}: joint '{names[i]}' {learned[i]:.2f} {unit}, here {here[i]:.2f} {unit}"]


def _list_sizes(layout: tuple[tuple[str, int], ...]) -> str:
    return " ".join(f"{name}[{size}]" for name, size in layout)
