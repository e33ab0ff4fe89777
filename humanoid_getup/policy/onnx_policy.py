"""Learned policies: a network in an ONNX file as a controller, run by one thread."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers import Command, Guidance, State
from humanoid_getup.evaluation.standing import HOLD, MAX_TILT
from humanoid_getup.policy.action import between, next_target
from humanoid_getup.policy.contract import ContractError, PolicyContract
from humanoid_getup.policy.observation import (
    Sensed,
    compute_torque_share,
    observe,
    observe_style,
)
from humanoid_getup.policy.onnx_file import CONTRACT_KEY, NetworkError, read_model
from humanoid_getup.style.curve_tracker import CurveTracker
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.height_map import UNKNOWN
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_errors import FollowedStyle, StyleErrors
from humanoid_getup.style.style_file import load_any_style
from robots import Robot
from robots.kinematics import GravitySense
from robots.quaternion import Array

SUFFIX = ".onnx"
QUIET = 4  # onnxruntime's log level: fatal errors only


class OnnxNetwork:
    """Maps observations to actions as the graph of an ONNX file does.

    A second output, if the graph has one, is what the network remembers: part of its next input.
    """

    def __init__(self, file: Path) -> None:
        """Load a file.

        Raises:
            OSError: if it cannot be read.
            NetworkError: if it is damaged, has no contract, or does not map one vector to one.
        """
        import onnxruntime  # which takes time, and not every rise needs it

        onnxruntime.disable_telemetry_events()
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = QUIET
        model = read_model(file)
        try:
            self._session = onnxruntime.InferenceSession(
                model, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime's errors have no base of their own
            reason = " ".join(str(error).split())
            raise NetworkError(f"it is not a complete ONNX file: {reason}") from error
        self.contract = self._session.get_modelmeta().custom_metadata_map.get(CONTRACT_KEY, "")
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        faults = [f"{len(inputs)} inputs, expected 1"] if len(inputs) != 1 else []
        if len(outputs) not in (1, 2):
            faults.append(f"{len(outputs)} outputs, expected 1, or 2 with a memory")
        if faults:
            raise NetworkError(f"the network has {' and '.join(faults)}")
        self._input, self._outputs = inputs[0], outputs

    def find_faults(
        self, observation_size: int, action_size: int, memory_size: int | None = None
    ) -> list[str]:
        """List deviations from a network that maps (N, observation) to (N, action).

        With a memory, it maps to (N, memory) as well.
        """
        sizes = [action_size] if memory_size is None else [action_size, memory_size]
        if len(self._outputs) != len(sizes):
            return [f"the network has {len(self._outputs)} outputs, expected {len(sizes)}"]
        faults = []
        for name, value, size in (
            ("input", self._input, observation_size),
            *zip(("output", "memory"), self._outputs, sizes, strict=False),
        ):
            if value.type != "tensor(float)":
                faults.append(f"network {name}: {value.type}, expected tensor(float)")
            shape = value.shape
            if len(shape) != 2 or (isinstance(shape[0], int) and shape[0] != 1) or shape[1] != size:
                faults.append(f"network {name}: shape {shape}, expected (N, {size})")
        return faults

    def __call__(self, observations: NDArray[np.float32]) -> tuple[Array, Array]:
        """Map observations, (N, size), to actions (N, k) and to what is remembered of them, (N, m).

        Without a memory of its own, that is the actions, clipped.
        """
        found = self._session.run(None, {self._input.name: observations})
        actions, *memory = (np.asarray(values, dtype=float) for values in found)
        return actions, memory[0] if memory else np.clip(actions, -1.0, 1.0)


LONGEST = 12.0  # s; includes further tries of the policy itself
LYING = 0.6  # share of the standing neck height below which a robot lies, sits or kneels
LOST = 3.0  # s of deviation from style curves while it lies where none begin: it gives up
STILL_TARGET = 1.0  # rad/s of the fastest target while a policy only balances


class PolicyError(ValueError):
    """A file is not a policy for this robot; the message names every problem."""

    def __init__(self, file: Path, faults: list[str]) -> None:
        super().__init__(f"policy file {file}: {'; '.join(faults)}")
        self.file, self.faults = file, tuple(faults)


class OnnxPolicy:
    """Runs a trained policy with the same code as training: observation, action, interpolation.

    Every ``cycles`` control cycles it observes and computes new targets; in between the
    targets are interpolated. If the network returns NaN or infinity, torque is switched off
    for good and ``fault`` holds the reason. It is done when the robot has stood, by gravity
    and by targets that hardly move, for the duration of a held stand, or when its time is up.
    """

    def __init__(
        self,
        robot: Robot,
        contract: PolicyContract,
        network: OnnxNetwork,
        *,
        torque_limit: float | None = None,
        longest: float = LONGEST,
        style: Style | None = None,
    ) -> None:
        """Prepare to run a policy that fits the robot; :meth:`load` checks it."""
        self.robot, self.contract, self.longest = robot, contract, longest
        self.style = style
        """What it follows; ``None`` for a policy that follows no style."""
        self.tracker = CurveTracker(robot) if style else None
        self.action = contract.action
        self.fault: str | None = None
        """Why it failed, if it did."""
        self._network, self.torque_limit = network, torque_limit
        limit = np.inf if torque_limit is None else torque_limit
        self._torque_share = compute_torque_share(robot, self.action, limit)
        self._sense_gravity = GravitySense(
            robot.spec().compile().site(robot.imu_site).quat  # orientation of the IMU in the torso
        )
        self._step_time = contract.control_period * contract.action.cycles
        self._begin = self._clock = 0.0
        self._start_at(robot.standing.joint_pos)

    @staticmethod
    def load(
        file: Path | str,
        robot: Robot,
        period: float | None = None,
        torque_limit: float | None = None,
        *,
        longest: float = LONGEST,
        style: Style | None = None,
    ) -> OnnxPolicy:
        """Load a policy that fits a robot and its control period [s].

        The torque limit [N·m] is that of every servo; after ``longest`` [s] the policy is done,
        standing or not. Without a style, a policy that follows style curves chooses among all
        named ones, as `Style.choose` does.

        Raises:
            OSError: if the file cannot be read.
            PolicyError: naming every mismatch.
        """
        file = Path(file)
        try:
            network = OnnxNetwork(file)
            contract = PolicyContract.from_json(network.contract)
        except (NetworkError, ContractError) as error:
            raise PolicyError(file, [str(error)]) from error
        faults = contract.find_mismatches(robot, period or robot.control_period)
        memory = contract.style.memory if contract.style else None
        faults += network.find_faults(contract.observation_size, len(contract.action.names), memory)
        if style is not None and contract.style is None:
            faults.append(f"it follows no style curves, expected no style '{style.name}' with it")
        if faults:
            raise PolicyError(file, faults)
        # A weight that is not finite makes every action not finite.
        blank = np.zeros((1, contract.observation_size), dtype=np.float32)
        if not all(np.isfinite(values).all() for values in network(blank)):
            raise PolicyError(file, ["the network returns NaN or infinity"])
        if contract.style is not None and style is None:
            style = load_any_style(robot)
        return OnnxPolicy(
            robot, contract, network, torque_limit=torque_limit, longest=longest, style=style
        )

    def following(self, style: Style) -> OnnxPolicy:
        """Return the same policy with another style to follow.

        Raises:
            ValueError: if it follows no style curves.
        """
        if self.contract.style is None:
            raise ValueError(
                f"the policy follows no style curves, expected no style '{style.name}' with it"
            )
        return OnnxPolicy(
            self.robot,
            self.contract,
            self._network,
            torque_limit=self.torque_limit,
            longest=self.longest,
            style=style,
        )

    @property
    def guidance(self) -> Guidance | None:
        """Return the style features that are wanted now, and those measured; for flight logs."""
        if self.tracker is None:
            return None
        return Guidance(wanted=self.tracker.wanted[0], measured=self.tracker.features[0])

    @property
    def followed(self) -> FollowedStyle | None:
        """Return how its first curves were followed so far; ``None`` if it follows none."""
        return self._following_style and self._following_style.summarize()

    @property
    def done(self) -> bool:
        """Return whether the robot has stood long enough, the time is up, or it failed.

        A robot that deviates from its style curves, and lies where none begin, has failed.
        """
        stood = self._steady * self._step_time >= HOLD
        timed_out = self._clock - self._begin >= self.longest - 1e-9
        is_lost = self._following_style is not None and self._has_lost_style
        return self.fault is not None or stood or timed_out or is_lost

    def reset(self, state: State) -> None:
        """Begin at the measured joint angles."""
        self._begin = self._clock = state.time
        self.fault = None
        self._start_at(state.joint_pos)

    def step(self, state: State) -> Command:
        """Compute new targets if a policy step begins, and return those of this cycle."""
        self._clock = state.time
        if self.fault is None and self._cycle == 0:
            self._decide(state)
        if self.fault is not None:
            return Command.limp(self.robot.n)
        cycles = self.action.cycles
        target = between(self._target, self._following, self._cycle, cycles)
        self._cycle = (self._cycle + 1) % cycles
        return Command.position(self.robot, target, self.torque_limit, self.action.pwm_limit)

    def sense(self, state: State) -> Sensed:
        """Convert a measurement to the quantities that a policy observes."""
        return Sensed(
            gravity=self._sense_gravity(state.orientation),
            gyro=self._sense_gravity.torso_from_imu @ state.gyro,
            joint_pos=state.joint_pos,
            joint_vel=state.joint_vel,
        )

    def observe(self, sensed: Sensed) -> NDArray[np.float32]:
        """Build the observation at the beginning of a policy step, (size,)."""
        more: Sequence[Array] = ()
        if self.tracker is not None:
            terms = observe_style(self.tracker.targets, self.tracker.features)
            more = [term[0] for term in terms]
            if self.contract.style is not None and self.contract.style.height_map:
                more.append(UNKNOWN)
        return observe(self.robot, sensed, self._following, self._memory, self._torque_share, more)

    def act(self, observations: NDArray[np.float32]) -> tuple[Array, Array]:
        """Compute actions and memory from observations, (N, size) to (N, k) and (N, m).

        Actions are not yet clipped.
        """
        return self._network(observations)

    def _start_at(self, joint_pos: Array) -> None:
        self._target = self._following = joint_pos
        style = self.contract.style
        self._memory = np.zeros(style.memory if style else self.action.size)
        self._following_style: _FirstCurves | None = None
        self._has_lost_style = False
        self._cycle = 0
        self._steady = 0  # policy steps in a row in which it stands

    def _decide(self, state: State) -> None:
        sensed = self.sense(state)
        self._follow_style(sensed)
        (action,), (memory,) = self.act(self.observe(sensed)[None])
        self._target = self._following
        if not np.isfinite(action).all():
            names = self.action.names
            bad = ", ".join(names[i] for i in np.flatnonzero(~np.isfinite(action)))
            self.fault = f"the network returns NaN or infinity: {bad}"
            return
        self._memory = memory
        self._following = next_target(
            self.robot,
            self.action,
            self._target,
            sensed.joint_pos,
            sensed.gravity,
            np.clip(action, -1.0, 1.0),
        )
        moved = float(np.abs(self._following - self._target).max())
        upright = -sensed.gravity[2] >= math.cos(MAX_TILT)
        steady = upright and moved <= STILL_TARGET * self._step_time
        self._steady = self._steady + 1 if steady else 0

    def _follow_style(self, sensed: Sensed) -> None:
        """Measure the style features; choose curves, at first and at restarts."""
        if self.tracker is None or self.style is None:
            return
        self.tracker.measure(sensed.gravity[None], sensed.joint_pos[None])
        style, first = self.style, self._following_style
        if first is None:
            curves = style.choose(self.tracker.features[0])
            self.tracker.begin(np.arange(1), [curves])
            errors = StyleErrors([curves], self.tracker.features, self.tracker.time)
            self._following_style = _FirstCurves(curves, self.tracker.features[0], errors)
            return
        first.errors.note(self.tracker.features, self._step_time)
        self.tracker.advance(self._step_time)
        if len(self.tracker.restart_deviating(self._step_time, lambda _, seen: style.choose(seen))):
            self._memory = np.zeros_like(self._memory)
            first.restarts += 1
        lies = self.tracker.features[0, 0] < LYING
        self._has_lost_style = bool(lies and self.tracker.deviating[0] > LOST)


@dataclass(eq=False)
class _FirstCurves:
    """The style curves that a robot was first given, and how it followed them so far."""

    curves: StyleCurves
    features: Array
    """Measured when it was given them, (3,)."""
    errors: StyleErrors
    restarts: int = 0

    def summarize(self) -> FollowedStyle:
        return FollowedStyle.of(self.errors, self.curves, self.features, self.restarts)


def find_policy(robot: Robot, name: str) -> Path:
    """Find a policy of a robot by name, or an .onnx file.

    Raises:
        ValueError: naming the policies that the robot has.
    """
    if name.endswith(SUFFIX):
        return Path(name)
    folder = robot.folder / "policies"
    known = sorted(file.stem for file in folder.glob(f"*{SUFFIX}"))
    if name not in known:
        expected = ", ".join([*known, f"an {SUFFIX} file"])
        raise ValueError(f"unknown policy '{name}', expected {expected}")
    return folder / f"{name}{SUFFIX}"
