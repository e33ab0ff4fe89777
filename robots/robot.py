"""A robot: its joints in one canonical order, its model, its servos."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.bus_settings import BusSettings
from robots.imu import ImuKind, ImuSettings
from robots.individual import AS_DESCRIBED, HeldMass, Individual
from robots.posture import Posture
from robots.proportions import ORIGINAL, Body
from robots.quaternion import Array
from robots.servo import COUNT_ROUNDING, LimitMode, Servo
from robots.transmission import Coupling, Transmission

SPEED_SHARE = 0.999  # of a servo's speed in targets, so that rounding does not exceed it
LONGEST_TIMESTEP = 0.002  # s; contacts and servos need no shorter step, and bear no longer one
# MuJoCo's dry friction is soft: with these a loaded joint hardly creeps (7 mrad instead of 99 in
# public logs of an XL330 at P 800). Servos without friction by load keep MuJoCo's own.
STIFF_SOLREF, STIFF_SOLIMP = (0.002, 1.0), (0.99, 0.999, 0.001)
LOWEST_SUPPLY = 0.5  # V, however much current flows
ROBOTS_FOLDER = Path(__file__).parent

# MuJoCo's own log goes to the terminal, not to MUJOCO_LOG.TXT in the working folder.
_log = mujoco.MjLogConfig.get()
_log.logto_file = False
mujoco.MjLogConfig.set(_log)


class RobotError(ValueError):
    """A robot is unknown or its description is wrong."""

    def __init__(self, message: str, problems: Sequence[str] = ()) -> None:
        super().__init__(message)
        self.problems = tuple(problems) or (message,)
        """One message for each problem."""


@dataclass(frozen=True, kw_only=True)
class Joint:
    """One servo joint."""

    name: str
    lower: float
    """[rad]"""
    upper: float
    """[rad]"""
    servo: Servo
    segment: str
    """Class that weighs the joint in the posture metric: head, foot, other..."""


@dataclass(frozen=True)
class Layout:
    """Addresses of the robot's root and joints in a compiled model."""

    qpos: np.ndarray
    """Addresses of the joint angles in ``qpos``, shape (n,), canonical order."""
    dof: np.ndarray
    """Addresses of the joint speeds in ``qvel``, shape (n,), canonical order."""
    root_qpos: int
    """Address of the root's position and quaternion (7 numbers)."""
    root_dof: int
    """Address of the root's velocity (6 numbers)."""
    torso: int
    """Body id of the torso."""

    root_position: slice = field(init=False)
    """Where ``qpos`` holds the root's position."""
    root_orientation: slice = field(init=False)
    """Where ``qpos`` holds the root's orientation, w x y z."""

    def __post_init__(self) -> None:
        root = self.root_qpos
        object.__setattr__(self, "root_position", slice(root, root + 3))
        object.__setattr__(self, "root_orientation", slice(root + 3, root + 7))


class JointArrays:
    """Arrays derived from the joints of a robot and their servos."""

    n: int
    """Number of joints."""
    joint_names: tuple[str, ...]
    """Joint names in canonical order."""
    transmission: Transmission
    """Gears and couplings between the servos and the joints."""
    lower: Array
    """Lower joint limits [rad], (n,)."""
    upper: Array
    """Upper joint limits [rad], (n,)."""
    max_torque: Array
    """The actuators' stall torques at nominal voltage [N·m], (n,). An actuator is a servo behind
    its gear: its torque is that at its joint, unless two joints are coupled."""
    max_velocity: Array
    """The joints' no-load speeds at the servos' nominal voltage [rad/s], (n,). Coupled joints reach
    theirs whatever the other one does."""
    position_gain: Array
    """The actuators' position-mode stiffness at nominal voltage [N·m/rad], (n,)."""
    p_gain: Array
    """Register values of the position P gain at full gain scale, (n,)."""
    nominal_voltage: Array
    """Supplies at which the servos' figures hold [V], (n,)."""
    torque_speed_slope: Array
    """Torque lost to back-EMF per speed [N·m·s/rad], (n,)."""
    current_damping: Array
    """Damping of current-based position mode [N·m·s/rad], (n,)."""
    torque_per_ampere: Array
    """Actuator torque per current at the servos' stall points [N·m/A], (n,)."""
    motor_constant: Array
    """Volts per speed of the actuators [V·s/rad], which is N·m/A as well, (n,)."""
    current_step: Array
    """Current of a count [A], (n,); 0 for servos without current sensor."""
    trips: NDArray[np.bool_]
    """Whether overload protection may switch a servo off, (n,)."""
    supply_range: tuple[float, float]
    """Lowest and highest supply that all servos accept [V]."""

    def _derive(self, joints: Sequence[Joint], couplings: tuple[Coupling, ...]) -> None:
        """Compute the arrays; an instance may be frozen."""
        servos = [joint.servo for joint in joints]
        models = [servo.model for servo in servos]
        lowest, highest = max(m.min_voltage for m in models), min(m.max_voltage for m in models)
        plain = {
            "lower": [joint.lower for joint in joints],
            "upper": [joint.upper for joint in joints],
            "p_gain": [servo.p_gain for servo in servos],
            "nominal_voltage": [m.nominal_voltage for m in models],
            "current_step": [m.current_step for m in models],
            "trips": [m.trips for m in models],
        }
        torques = {
            "max_torque": [m.stall_torque for m in models],
            "torque_per_ampere": [m.torque_per_ampere for m in models],
            "motor_constant": [m.motor_constant for m in models],
        }
        gains = {
            "position_gain": [servo.position_gain for servo in servos],
            "torque_speed_slope": [m.torque_speed_slope for m in models],
            "current_damping": [m.damping_gain(m.d_gain) for m in models],
        }
        geared = Transmission(np.array([servo.gear for servo in servos]), couplings)
        speed = geared.motion_at_actuator(np.array([m.top_speed for m in models]))
        derived = (
            {name: np.array(values) for name, values in plain.items()}
            | {name: geared.torque_at_actuator(np.array(v)) for name, v in torques.items()}
            | {name: geared.gain_at_actuator(np.array(v)) for name, v in gains.items()}
            | {"n": len(servos), "joint_names": tuple(joint.name for joint in joints)}
            | {
                "supply_range": (lowest, highest),
                "transmission": geared,
                "max_velocity": geared.speed_at_joint(speed),
            }
        )
        for name, value in derived.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)  # shared by all that the robot is given to
            object.__setattr__(self, name, value)


@dataclass(frozen=True, kw_only=True)
class Robot(JointArrays):
    """A robot as described by its folder."""

    name: str
    folder: Path
    joints: tuple[Joint, ...]
    torso: str
    neck_site: str
    imu_site: str | None
    """None without an IMU."""
    sole_sites: tuple[str, ...]
    control_period: float
    """[s]"""
    supply_voltage: float
    """Nominal supply [V]."""
    standing: Posture
    """The stance in which a rise ends, soles on the ground z = 0."""
    standing_neck_height: float
    """Height of the neck site over the soles in the standing posture [m]."""
    mirror_index: np.ndarray
    """Joint that takes each joint's place when left and right are exchanged, (n,)."""
    mirror_sign: Array
    """Sign of its angle there, (n,)."""
    model_file: Path
    supply_resistance: float = 0.0
    """Resistance of battery and wires, through which all currents flow [Ω]."""
    bus: BusSettings | None = None
    """How its servos are reached; None if not described."""
    imu: ImuSettings | None = None
    """How its IMU is reached; None for that of the board on its bus, if there is one."""
    rising_joints: tuple[str, ...] = ()
    """One joint of each mirrored pair that a learned rise moves."""
    spreading_joints: tuple[str, ...] = ()
    """One joint of each pair that spreads limbs and comes home by itself."""
    passive_joints: tuple[str, ...] = ()
    """Hinges of its model without servo; see `robots.kinematics`."""
    limp_joints: tuple[str, ...] = ()
    """Joints whose servos make no torque, such as broken ones; they still measure."""
    couplings: tuple[Coupling, ...] = ()
    """Pairs of joints that two servos turn together."""
    limit_by: LimitMode = "pwm"
    """What a torque limit acts on by default: ``"current"`` or ``"pwm"``."""
    body: Body = ORIGINAL
    """Factors on the lengths of its model; see `robots.description.loading.reshape`."""
    individual: Individual = AS_DESCRIBED
    """What sets it apart from its description, as identified."""
    held: tuple[HeldMass, ...] = ()
    """Masses that it holds; see `robots.description.loading.hold`."""

    def __post_init__(self) -> None:
        self._derive(self.joints, self.couplings)
        for array in (self.standing.position, self.standing.orientation, self.standing.joint_pos):
            array.setflags(write=False)

    def __repr__(self) -> str:
        return (
            f"{type(self).__name__}({self.name}: {self.n} joints, stands "
            f"{self.standing_neck_height:.3g} m high at the neck)"
        )

    @cached_property
    def strength(self) -> Array:
        """Return the share of each servo's torque that it has, (n,): 0 for limp joints."""
        return np.array([float(name not in self.limp_joints) for name in self.joint_names])

    @property
    def load(self) -> str:
        """Return the masses [kg] that it holds as NAME:KG,...; empty for none."""
        return ",".join(f"{each.name}:{each.mass!r}" for each in self.held)

    @property
    def imu_kind(self) -> ImuKind | None:
        """Return the kind of its IMU, None if none is described."""
        if self.imu is not None and self.imu.kind != "board":
            return self.imu.kind
        return "board" if self.bus is not None and self.bus.board is not None else None

    def require_imu_site(self) -> str:
        """Return the site of its IMU; a robot without one is refused."""
        if self.imu_site is None:
            raise RobotError(
                f"robot '{self.name}' has no IMU: its orientation is unknown, expected imu_site "
                "in its robot.toml; without one, use `getup play MOTION --without-imu`"
            )
        return self.imu_site

    @cached_property
    def actuators(self) -> tuple[Joint, ...]:
        """Return the joints with the ranges that their servos turn through.

        They differ from those of the joints where joints are coupled.
        """
        lower, upper = self.transmission.range_at_actuator(self.lower, self.upper)
        return tuple(
            replace(joint, lower=float(low), upper=float(high))
            for joint, low, high in zip(self.joints, lower, upper, strict=True)
        )

    def compute_lead(self, torque: Array) -> Array:
        """Compute the lead of targets over joints that makes given torques, (..., n) [rad].

        The torques at the joints [N·m] are (..., n), and full gain and nominal supply are assumed.
        """
        actuator_torque = self.transmission.torque_for_joint(torque)
        return self.transmission.to_joint(actuator_torque / self.position_gain)

    def compute_lag(self, speed: Array) -> Array:
        """Compute the lag of joints behind targets by back-EMF at given speeds, (..., n) [rad].

        The speeds of the joints [rad/s] are (..., n).
        """
        lag = self.torque_speed_slope / self.position_gain
        return self.transmission.to_joint(lag * self.transmission.to_actuator(speed))

    def limit_targets(self, target: Array, start: Array) -> Array:
        """Keep targets (T, n) within the joints' limits and the servos' speed from a start (n,)."""
        limited, last = target.copy(), start
        for row in limited:  # rows are views
            last = row[:] = self.limit_target(row, last)
        return limited

    def limit_target(self, target: Array, last: Array) -> Array:
        """Keep targets (..., n) within the joints' limits, and within reach of the last ones."""
        reach = SPEED_SHARE * self.max_velocity * self.control_period
        return np.clip(np.clip(target, self.lower, self.upper), last - reach, last + reach)

    def mirror_joints(self, joint_pos: Array) -> Array:
        """Exchange left and right in joint angles, (..., n)."""
        return joint_pos[..., self.mirror_index] * self.mirror_sign

    def symmetrize(self, joint_pos: Array) -> Array:
        """Return the mean of joint angles (..., n) and their mirror image."""
        return 0.5 * (joint_pos + self.mirror_joints(joint_pos))

    def spec(self) -> mujoco.MjSpec:
        """Build the robot's model with one position servo a joint, in joint order."""
        spec = self.read_model()
        spec.option.timestep = self.choose_timestep(min(spec.option.timestep, LONGEST_TIMESTEP))
        for i in range(self.n):
            self._add_actuator(spec, i)
        self.individual.shape(spec, self.torso, self.imu_site)
        for held in self.held:
            held.fix(spec)
        return spec

    def read_model(self) -> mujoco.MjSpec:
        """Read its model, without servos."""
        return mujoco.MjSpec.from_file(str(self.model_file))

    def _add_actuator(self, spec: mujoco.MjSpec, i: int) -> None:
        """Add friction and rotor of a servo, and a motor in position mode; all behind its gear.

        The servo drives voltage from the position error without compensating its back-EMF. A
        ``dcmotor`` compensates it, so a derivative gain of K²/R takes the compensation out again.
        """
        name, servo = self.joint_names[i], self.joints[i].servo
        motor, gear = servo.model, servo.gear
        actuator = spec.add_actuator(name=name, target=name)
        coupling = next((c for c in self.couplings if i in c.joints), None)
        if coupling is None:
            turned = spec.joint(name)
            actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
        else:  # a fixed tendon whose length is the angle that the servo turns
            turned = spec.add_tendon(name=name)
            row = coupling.matrix[coupling.joints.index(i)]
            for k, turns in zip(coupling.joints, row.tolist(), strict=True):
                turned.wrap_joint(self.joint_names[k], turns)
            actuator.trntype = mujoco.mjtTrn.mjTRN_TENDON
        turned.armature = motor.armature * gear**2
        turned.frictionloss = motor.friction * gear * self.individual.friction
        if motor.viscous_friction:
            turned.damping[0] += motor.viscous_friction * gear**2
        if motor.loads_gears or self.individual.load_friction:
            turned.solref_friction[:] = STIFF_SOLREF
            turned.solimp_friction[: len(STIFF_SOLIMP)] = STIFF_SOLIMP
        gain, slope = float(self.position_gain[i]), float(self.torque_speed_slope[i])
        actuator.set_to_dcmotor(
            motorconst=[float(self.motor_constant[i])] * 2,
            resistance=motor.resistance,
            saturation=[float(self.max_torque[i]), 0.0, 0.0],
            controller=[gain, 0, slope, 0, 0, motor.nominal_voltage],
            ctrlspec=mujoco.mjtCtrlInput.mjINPUT_POS,
        )

    def choose_timestep(self, longest: float) -> float:
        """Choose the longest physics step, up to one, that divides the control period [s]."""
        steps = math.ceil(self.control_period / longest - 1e-9)
        fits = abs(steps * longest - self.control_period) < 1e-9
        return longest if fits else self.control_period / steps

    def layout(self, model: mujoco.MjModel) -> Layout:
        """Find the addresses of this robot's root and joints in a compiled model."""
        ids = [model.joint(name).id for name in self.joint_names]
        root = model.body(self.torso).jntadr[0]
        return Layout(
            qpos=model.jnt_qposadr[ids],
            dof=model.jnt_dofadr[ids],
            root_qpos=int(model.jnt_qposadr[root]),
            root_dof=int(model.jnt_dofadr[root]),
            torso=model.body(self.torso).id,
        )

    def with_individual(self, individual: Individual) -> Robot:
        """Return this robot, as described, with what sets an individual apart."""
        own = individual.supply_resistance
        resistance = self.supply_resistance if own is None else own
        return replace(self, individual=individual, supply_resistance=resistance)

    def find_stall(self, voltage: Array | float) -> Array:
        """Compute the actuators' torques at standstill at supplies (...) [V], (..., n) [N·m]."""
        share = self.individual.strength * np.asarray(voltage)[..., None] / self.nominal_voltage
        return share * self.max_torque

    def sag(self, voltage: Array | float, torque: Array, actuator_vel: Array) -> Array:
        """Compute the supply at the servos under load, (...) [V].

        Args:
            voltage: Supply without load [V], (...).
            torque: Torques of the actuators [N·m], (..., n).
            actuator_vel: Their speeds [rad/s], (..., n).
        """
        current = self.find_supply_current(voltage, torque, actuator_vel)
        return np.maximum(voltage - self.supply_resistance * current, LOWEST_SUPPLY)

    def find_supply_current(
        self, voltage: Array | float, torque: Array, actuator_vel: Array
    ) -> Array:
        """Compute the current that all servos draw from their supply, (...) [A]; see `sag`."""
        resistance = np.array([joint.servo.model.resistance for joint in self.joints])
        needed = torque * resistance / self.motor_constant + self.motor_constant * actuator_vel
        share = np.clip(needed / np.asarray(voltage)[..., None], -1.0, 1.0)
        return np.maximum(np.sum(share * torque / self.torque_per_ampere, axis=-1), 0.0)

    def round_current(self, torque: Array | float) -> Array:
        """Round torques down to those of whole counts of the motors' current [N·m], (..., n)."""
        return self.count_current(torque) * self.current_step * self.torque_per_ampere

    def count_current(self, torque: Array | float) -> Array:
        """Convert torques [N·m] to whole counts of the motors' current, (..., n)."""
        return np.floor(torque / (self.current_step * self.torque_per_ampere) + COUNT_ROUNDING)


def list_robots() -> list[str]:
    """List the robots that come with the package."""
    return sorted(path.parent.name for path in ROBOTS_FOLDER.glob("*/robot.toml"))
