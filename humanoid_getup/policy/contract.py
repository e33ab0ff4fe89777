"""The policy contract: what a trained policy expects of the robot that runs it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from humanoid_getup.policy.action import ActionMode, ActionSpec, StanceScaling
from humanoid_getup.policy.observation import Term, list_terms
from robots import Robot
from robots.quaternion import Array
from robots.schema import Fields
from robots.validation import is_number, shown

FORMAT = 5
IMU_FRAME = "gravity and gyro in the torso's frame: x forward, y left, z up"
SERVO_SLACK = 0.01  # share of a servo's position gain and torque
ANGLE_SLACK = 1e-6  # rad
TIME_SLACK = 1e-6  # share
SPEED_SLACK = 1e-6  # share of a servo's speed

Fact = str | int | float | bool | None


class ContractError(ValueError):
    """A text is no policy contract; the message tells all that is wrong with it."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PolicyContract:
    """What a policy was trained with; nothing of it may differ where it runs.

    It is stored as JSON in the metadata of the policy's ONNX file (`onnx_file`). It may hold
    anything that can be read; :meth:`find_mismatches` reports what does not fit.
    """

    robot: str
    joints: tuple[str, ...]
    """Names in the order of every vector of joints."""
    terms: tuple[Term, ...]
    """Parts of the observation, in their order."""
    mode: str
    """An `ActionMode`."""
    names: tuple[str, ...]
    """What each number of an action moves."""
    directions: Array
    """Shape (k, n); this and the next eight as in `ActionSpec`."""
    scale: Array
    """[rad], shape (n,)"""
    reach: Array
    """[rad], shape (n,)"""
    lead: float
    """[rad]"""
    pwm_limit: float
    home: Array
    """[rad], shape (n,); joint angles in the observation are counted from here."""
    homing: Array
    """[rad], shape (n,)"""
    calm: StanceScaling
    cycles: int
    control_period: float
    """[s]"""
    rate_hz: float
    """Policy steps a second."""
    position_gain: Array
    """Of the servos [N·m/rad], shape (n,)."""
    max_torque: Array
    """Of the servos [N·m], shape (n,); a torque limit is told as a share of the largest."""
    imu_frame: str
    provenance: Mapping[str, Fact]
    """How it was made, for people."""

    @staticmethod
    def of(
        robot: Robot, action: ActionSpec, period: float, provenance: Mapping[str, Fact]
    ) -> PolicyContract:
        """Write down what a policy is trained with.

        Args:
            robot: Robot.
            action: What its actions mean.
            period: Control period [s].
            provenance: How it is made: command, seed, iterations...
        """
        return PolicyContract(
            robot=robot.name,
            joints=robot.joint_names,
            terms=list_terms(robot, action),
            mode=action.mode.value,
            names=action.names,
            directions=action.directions,
            scale=action.scale,
            reach=action.reach,
            lead=action.lead,
            pwm_limit=action.pwm_limit,
            home=action.home,
            homing=action.homing,
            calm=action.calm,
            cycles=action.cycles,
            control_period=period,
            rate_hz=1.0 / (period * action.cycles),
            position_gain=robot.position_gain,
            max_torque=robot.max_torque,
            imu_frame=IMU_FRAME,
            provenance=dict(provenance),
        )

    @property
    def observation_size(self) -> int:
        """Return how many numbers the policy sees."""
        return sum(term.size for term in self.terms)

    def action_spec(self, robot: Robot) -> ActionSpec:
        """Return what the actions mean, on a robot that the contract fits."""
        return ActionSpec(
            mode=ActionMode(self.mode),
            names=self.names,
            directions=self.directions,
            scale=self.scale,
            reach=self.reach,
            lead=self.lead,
            pwm_limit=self.pwm_limit,
            home=self.home,
            homing=self.homing,
            calm=self.calm,
            lower=robot.lower,
            upper=robot.upper,
            cycles=self.cycles,
        )

    def find_mismatches(self, robot: Robot, period: float) -> list[str]:
        """Tell all that does not fit a robot and its control period [s]."""
        faults = []
        if self.robot != robot.name:
            faults.append(f"robot: made for '{self.robot}', this is '{robot.name}'")
        if self.mode not in list(ActionMode):
            allowed = ", ".join(ActionMode)
            faults.append(f"action mode: '{self.mode}', allowed {allowed}")
        faults += self._find_rate_faults(period)
        if self.imu_frame != IMU_FRAME:
            faults.append(f"IMU frame: '{self.imu_frame}', here '{IMU_FRAME}'")
        faults += self._find_joint_faults(robot)
        shape_faults = self._find_shape_faults(robot)
        return faults + (shape_faults or self._find_value_faults(robot, period))

    def _find_rate_faults(self, period: float) -> list[str]:
        here = 1.0 / (period * self.cycles)
        if np.isclose(self.rate_hz, here, rtol=TIME_SLACK, atol=0.0) and np.isclose(
            self.control_period, period, rtol=TIME_SLACK, atol=0.0
        ):
            return []
        return [
            f"rate: {self.rate_hz:.2f} Hz with a control period of {1e3 * self.control_period:g} "
            f"ms, here {here:.2f} Hz with {1e3 * period:g} ms"
        ]

    def _find_joint_faults(self, robot: Robot) -> list[str]:
        if self.joints == robot.joint_names:
            return []
        missing = [name for name in robot.joint_names if name not in self.joints]
        foreign = [name for name in self.joints if name not in robot.joint_names]
        if not missing and not foreign:
            pairs = zip(self.joints, robot.joint_names, strict=True)
            wrong, right = next((a, b) for a, b in pairs if a != b)
            return [f"joint order: '{wrong}' stands where '{right}' should"]
        told = [f"it lacks {', '.join(missing)}"] if missing else []
        told += [f"it has {', '.join(foreign)}"] if foreign else []
        return [f"joints: {' and '.join(told)}"]

    def _find_shape_faults(self, robot: Robot) -> list[str]:
        n, k = robot.n, len(self.names)
        faults = []
        layout = tuple((term.name, term.size) for term in self.terms)
        wanted = tuple((term.name, term.size) for term in _list_layout(robot, k))
        if layout != wanted:
            faults.append(f"observation: {_list_sizes(layout)}, here {_list_sizes(wanted)}")
        shapes = {"directions": (k, n)}
        vectors = ("scale", "reach", "home", "homing", "position_gain", "max_torque")
        shapes |= dict.fromkeys(vectors, (n,))
        for name, shape in shapes.items():
            found = getattr(self, name).shape
            if found != shape:
                faults.append(f"{name.replace('_', ' ')}: shape {found}, allowed {shape}")
        return faults

    def _find_value_faults(self, robot: Robot, period: float) -> list[str]:
        """Compare vectors of joints, whose shapes are right."""
        names = robot.joint_names
        gain, torque = robot.position_gain, robot.max_torque
        faults = _find_servo_faults("gains", names, self.position_gain, gain, "N·m/rad")
        faults += _find_servo_faults("torque", names, self.max_torque, torque, "N·m")
        off = np.abs(self.home - robot.standing.joint_pos)
        if off.max() > ANGLE_SLACK:
            i = int(off.argmax())
            faults.append(
                f"home angles: joint '{names[i]}' {self.home[i]:+.3f} rad, here "
                f"{robot.standing.joint_pos[i]:+.3f} rad"
            )
        if np.any(self.reach <= 0.0):
            i = int(self.reach.argmin())
            faults.append(f"reach: joint '{names[i]}' {self.reach[i]:g} rad, allowed > 0 rad")
        speed = self.reach / (self.cycles * period)
        if np.any(speed > robot.max_velocity * (1.0 + SPEED_SLACK)):
            i = int((speed / robot.max_velocity).argmax())
            faults.append(
                f"speed: targets of joint '{names[i]}' move at {speed[i]:.2f} rad/s, "
                f"the servo at {robot.max_velocity[i]:.2f} rad/s"
            )
        return faults

    def to_json(self) -> str:
        """Write the contract as JSON text."""
        record = {
            "format": FORMAT,
            "robot": self.robot,
            "joints": list(self.joints),
            "observation": [{"name": term.name, "size": term.size} for term in self.terms],
            "action": {
                "mode": self.mode,
                "names": list(self.names),
                "directions": self.directions.tolist(),
                "scale": self.scale.tolist(),
                "reach": self.reach.tolist(),
                "lead": self.lead,
                "pwm_limit": self.pwm_limit,
                "home": self.home.tolist(),
                "homing": self.homing.tolist(),
                "calm": asdict(self.calm),
                "cycles": self.cycles,
            },
            "control_period": self.control_period,
            "rate_hz": self.rate_hz,
            "position_gain": self.position_gain.tolist(),
            "max_torque": self.max_torque.tolist(),
            "imu_frame": self.imu_frame,
            "provenance": dict(self.provenance),
        }
        return json.dumps(record, ensure_ascii=False, allow_nan=False)

    @staticmethod
    def from_json(text: str) -> PolicyContract:
        """Read a contract.

        Raises:
            ContractError: telling all that is missing or wrong.
        """
        try:
            record = json.loads(text)
        except ValueError as error:
            raise ContractError(f"the policy contract is no JSON: {error}") from error
        if not isinstance(record, dict):
            raise ContractError(f"the policy contract is {shown(record)}, allowed a JSON object")
        if record.get("format") != FORMAT:
            told = shown(record.get("format"))
            raise ContractError(f"the policy contract has format {told}, allowed {FORMAT}")
        faults: list[str] = []
        whole = _ContractFields(record, "", faults)
        action = _ContractFields(whole.table("action"), "action.", faults)
        contract = PolicyContract(
            robot=whole.text("robot"),
            joints=whole.texts("joints"),
            terms=whole.terms("observation"),
            mode=action.text("mode"),
            names=action.texts("names"),
            directions=action.array("directions", 2),
            scale=action.array("scale", 1),
            reach=action.array("reach", 1),
            lead=action.number("lead", 10.0, "rad"),
            pwm_limit=action.number("pwm_limit", 1.0, ""),
            home=action.array("home", 1),
            homing=action.array("homing", 1),
            calm=action.calm("calm"),
            cycles=action.integer("cycles", 1, 1000),
            control_period=whole.number("control_period", 1.0, "s"),
            rate_hz=whole.number("rate_hz", 10_000.0, "Hz"),
            position_gain=whole.array("position_gain", 1),
            max_torque=whole.array("max_torque", 1),
            imu_frame=whole.text("imu_frame"),
            provenance=whole.facts("provenance"),
        )
        if faults:
            raise ContractError(f"the policy contract: {'; '.join(faults)}")
        return contract


def _find_servo_faults(
    what: str, names: tuple[str, ...], learned: Array, here: Array, unit: str
) -> list[str]:
    """Compare a figure of the servos, (n,), with what it is here."""
    off = np.abs(learned / here - 1.0)
    if off.max() <= SERVO_SLACK:
        return []
    i = int(off.argmax())
    return [f"{what}: joint '{names[i]}' {learned[i]:.2f} {unit}, here {here[i]:.2f} {unit}"]


def _list_layout(robot: Robot, action_size: int) -> tuple[Term, ...]:
    """List the parts of an observation of a robot whose actions have some size."""
    none = np.zeros(robot.n)
    action = ActionSpec(
        mode=ActionMode.RATE,
        names=(),
        directions=np.zeros((action_size, robot.n)),
        scale=none,
        reach=none,
        lead=0.0,
        pwm_limit=1.0,
        home=none,
        homing=none,
        calm=StanceScaling(tilt=1.0, away=1.0, least=1.0),
        lower=none,
        upper=none,
    )
    return list_terms(robot, action)


def _list_sizes(layout: tuple[tuple[str, int], ...]) -> str:
    return " ".join(f"{name}[{size}]" for name, size in layout)


class _ContractFields(Fields):
    """Reads the kinds of fields that only contracts have."""

    def table(self, key: str) -> dict[str, Any]:
        """Read a table; the blank is {}."""
        value = self._table.get(key)
        if isinstance(value, dict):
            return value
        self._refuse(key, "a table")
        return {}

    def array(self, key: str, axes: int) -> Array:
        """Read numbers in rows of one length; the blank is empty."""
        try:
            value = np.array(self._table.get(key), dtype=float)
        except (TypeError, ValueError):
            value = np.array(np.nan)
        if value.ndim == axes and np.isfinite(value).all():
            return value
        self._refuse(key, f"finite numbers on {axes} axes")
        return np.zeros((0,) * axes)

    def calm(self, key: str) -> StanceScaling:
        """Read how rates slow down."""
        part = Fields(self.table(key), f"action.{key}.", self._faults)
        return StanceScaling(
            tilt=part.number("tilt", 10.0, "rad"),
            away=part.number("away", 10.0, "rad"),
            least=part.number("least", 1.0, ""),
        )

    def terms(self, key: str) -> tuple[Term, ...]:
        """Read the parts of an observation; the blank is ()."""
        value = self._table.get(key)
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            self._refuse(key, "a list of tables")
            return ()
        parts = [Fields(item, f"{key}[{i}].", self._faults) for i, item in enumerate(value)]
        return tuple(Term(part.text("name"), part.integer("size", 1, 10_000)) for part in parts)

    def facts(self, key: str) -> dict[str, Fact]:
        """Read texts and numbers by name; the blank is {}."""
        value = self.table(key)
        plain = all(v is None or isinstance(v, str | bool) or is_number(v) for v in value.values())
        if not plain:
            self._refuse(key, "texts and numbers")
        return value
