"""Learned policies: a network in an ONNX file as a controller, run by one thread."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from drivers import Command, Guidance, State
from humanoid_getup.experiments.judging.standing import HOLD, MAX_TILT
from humanoid_getup.policy.action import between, next_target
from humanoid_getup.policy.contract import PolicyContract
from humanoid_getup.policy.observation import Sensed, compute_torque_share, observe
from humanoid_getup.policy.onnx_file import OnnxNetwork
from humanoid_getup.policy.slope_legs import SlopeLegs, find_heading
from humanoid_getup.policy.style_follower import StyleFollower
from humanoid_getup.style.features import UNKNOWN
from humanoid_getup.style.followed_style import FollowedStyle
from humanoid_getup.style.style import Style, load_any_style
from robots import Posture, Robot, quaternion
from robots.arguments import expect
from robots.kinematics import GravitySense, imu_in_torso
from robots.quaternion import Array
from robots.storage.files import describe

SUFFIX = ".onnx"
LONGEST = 12.0  # s; includes further tries of the policy itself
MOST_PERIODS = 20  # control periods that an inference may take on a simulated robot
STILL_TARGET = 1.0  # rad/s of the fastest target while a policy only balances


class PolicyError(ValueError):
    """A file is not a policy for this robot; the message names every problem."""

    def __init__(self, file: Path, problems: list[str]) -> None:
        super().__init__(f"policy file {file}: {'; '.join(problems)}")
        self.file, self.problems = file, tuple(problems)


def read_contract(file: Path) -> PolicyContract:
    """Read the contract of a policy file."""
    try:
        return PolicyContract.from_json(OnnxNetwork(file).contract)
    except ValueError as error:
        raise PolicyError(file, [str(error)]) from error


class OnnxPolicy:
    """Runs a trained policy with the same code as training: observation, action, interpolation.

    Every ``cycles`` control cycles it observes and computes new targets; in between the
    targets are interpolated. If the network returns NaN or infinity, torque is switched off
    for good and ``failure`` holds the reason. It is done when the robot has stood, by gravity
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
        slope: float = 0.0,
        start: Posture | None = None,
    ) -> None:
        self.robot, self.contract, self.longest = robot, contract, longest
        self.style = style
        """Style to follow; ``None`` for a policy that follows none."""
        self._start = start
        self._follower = StyleFollower(robot, lambda _, seen: style.choose(seen)) if style else None
        self.action = contract.action
        self.failure: str | None = None
        """Reason of a failure; ``None`` without one."""
        self._network, self.torque_limit = network, torque_limit
        limit = np.inf if torque_limit is None else torque_limit
        self.torque_share = compute_torque_share(robot, self.action, limit)
        self._imu_in_torso = imu_in_torso(robot, robot.spec().compile())
        self._sense_gravity = GravitySense(self._imu_in_torso)
        self._legs = SlopeLegs(robot, 1, slope) if style and slope else None
        self._step_time = contract.control_period * contract.action.cycles
        self._begin = self._clock = 0.0
        self._start_at(robot.standing.joint_pos)

    def __repr__(self) -> str:
        names = ", ".join(term.name for term in self.contract.observation)
        return (
            f"OnnxPolicy({self.robot.name}: {names} to {self.robot.n} {self.action.mode} targets, "
            f"every {self._step_time:g} s)"
        )

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
            PolicyError: if the file cannot be read, or naming every mismatch.
            ValueError: if an argument is of another type.
        """
        expect("file", file, str | Path, f"an {SUFFIX} file")
        expect("robot", robot, Robot, "a Robot, e.g. load_robot('op3')")
        file = Path(file)
        try:
            network = OnnxNetwork(file)
            contract = PolicyContract.from_json(network.contract)
        except (ValueError, OSError) as error:
            raise PolicyError(file, [describe(error)]) from error
        period = period or robot.control_period
        problems = contract.find_mismatches(robot, period)
        problems += network.find_problems(
            contract.observation_size, len(contract.action.names), contract.memory_size
        )
        if style is not None and contract.style is None:
            problems.append(f"it follows no style curves, expected no style '{style.name}' with it")
        if network.inference_time > MOST_PERIODS * period:
            problems.append(
                f"an inference takes {network.inference_time:.2g} s, expected at most "
                f"{MOST_PERIODS} control periods of {period:g} s"
            )
        if problems := problems or network.faults:
            raise PolicyError(file, problems)
        if contract.style is not None and style is None:
            style = load_any_style(robot)
        return OnnxPolicy(
            robot, contract, network, torque_limit=torque_limit, longest=longest, style=style
        )

    def following(
        self, style: Style, slope: float = 0.0, start: Posture | None = None
    ) -> OnnxPolicy:
        """Return the same policy with another style to follow, on ground of a slope [rad].

        The slope rises along +x of the world of the posture in which the robot starts: an IMU does
        not measure its heading there, but how it turns from then on.
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
            slope=slope,
            start=start,
        )

    @property
    def guidance(self) -> Guidance | None:
        """Return the wanted and the measured style features, for flight logs."""
        if self._follower is None:
            return None
        return Guidance(wanted=self._follower.wanted[0], measured=self._follower.measured[0])

    @property
    def metadata(self) -> dict[str, str]:
        """Return the metadata of its file."""
        return self._network.metadata

    @property
    def followed(self) -> FollowedStyle | None:
        """Return how well its first curves were followed so far; ``None`` if it follows none."""
        return self._follower and self._follower.summarize()

    @property
    def done(self) -> bool:
        """Return whether the robot has stood long enough, the time is up, or it failed.

        A robot that deviates from its style curves, and lies where none begin, has failed.
        """
        stood = self._steady * self._step_time >= HOLD
        timed_out = self._clock - self._begin >= self.longest - 1e-9
        is_lost = self._follower is not None and bool(self._follower.is_lost[0])
        return self.failure is not None or stood or timed_out or is_lost

    def reset(self, state: State) -> None:
        """Begin at the measured joint angles."""
        self._begin = self._clock = state.time
        self.failure = None
        self._start_at(state.joint_pos)

    def step(self, state: State) -> Command:
        """Compute new targets if a policy step begins, and return those of this cycle."""
        self._clock = state.time
        if self.failure is None and self._cycle == 0:
            self._decide(state)
        if self.failure is not None:
            return Command.limp(self.robot.n)
        cycles, reach = self.action.cycles, self.action.hold_reach
        target = between(*self._sent, self._cycle, cycles, reach)
        self._cycle = (self._cycle + 1) % cycles
        pwm_limit, shares = self.action.pwm_limit, self.action.gain_share
        command = Command.position(self.robot, target, self.torque_limit, pwm_limit)
        return replace(command, gain_scale=np.array(shares)) if shares else command

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
        more: list[Array] = []
        if self._follower is not None:
            more = [term[0] for term in self._follower.observe()]
            if self.contract.style is not None and self.contract.style.height_map:
                more.append(UNKNOWN)
        return observe(self.robot, sensed, self._following, self._memory, self.torque_share, more)

    def act(self, observations: NDArray[np.float32]) -> tuple[Array, Array]:
        """Compute actions and memory from observations, (N, size) to (N, k) and (N, m).

        Actions are not yet clipped.
        """
        return self._network(observations)

    def _start_at(self, joint_pos: Array) -> None:
        self._target = self._following = joint_pos
        self._sent = joint_pos, joint_pos
        """Targets of the servos at the beginning and at the end of the policy step [rad]."""
        self._memory = np.zeros(self.contract.memory_size or self.action.size)
        if self._follower is not None:
            self._follower.reset()
        if self._legs is not None:
            self._legs.shift[:] = 0.0
        self._turn: Array | None = None  # from the IMU's world to that of the slope
        self._cycle = 0
        self._steady = 0  # policy steps in a row in which it stands

    def _decide(self, state: State) -> None:
        sensed = self.sense(state)
        if self._legs is not None:
            sensed = replace(sensed, joint_pos=sensed.joint_pos - self._legs.shift[0])
        if self._follower and self._follower.update(sensed, self._step_time).size:
            self._memory = np.zeros_like(self._memory)
        (action,), (memory,) = self.act(self.observe(sensed)[None])
        self._target = self._following
        if not np.isfinite(action).all():
            names = self.action.names
            bad = ", ".join(names[i] for i in np.flatnonzero(~np.isfinite(action)))
            self.failure = f"the network returns NaN or infinity: {bad}"
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
        self._sent = self._target, self._following
        if self._legs is not None and self._follower is not None:
            self._sent = self._shift(self._legs, self._follower, state)
        moved = float(np.abs(self._following - self._target).max())
        upright = -sensed.gravity[2] >= math.cos(MAX_TILT)
        steady = upright and moved <= STILL_TARGET * self._step_time
        self._steady = self._steady + 1 if steady else 0

    def _shift(self, legs: SlopeLegs, follower: StyleFollower, state: State) -> tuple[Array, Array]:
        """Shift the targets of a policy step on a slope, before and after it is fitted again."""
        torso = quaternion.multiply(state.orientation, quaternion.inverse(self._imu_in_torso))
        if self._turn is None:
            start = torso if self._start is None else self._start.orientation
            self._turn = quaternion.from_yaw(find_heading(start) - find_heading(torso))
        torso = quaternion.multiply(self._turn, torso)
        wanted = legs.compute(torso[np.newaxis], follower.measured[:, 0])
        steps = self._target[np.newaxis], self._following[np.newaxis]
        before, after = legs.send(*steps, wanted, self.action.reach, self._step_time)
        return before[0], after[0]


def list_policies(robot: Robot) -> list[Path]:
    """List the files of a robot's policies, by name."""
    return sorted((robot.folder / "policies").glob(f"*{SUFFIX}"))


def find_policy(robot: Robot, name: str) -> Path:
    """Find a policy of a robot by name, or an .onnx file."""
    if name.endswith(SUFFIX):
        return Path(name)
    known = {file.stem: file for file in list_policies(robot)}
    if name not in known:
        expected = ", ".join([*known, f"an {SUFFIX} file"])
        raise ValueError(f"unknown policy '{name}', expected {expected}")
    return known[name]
