"""A robot: its joints in one canonical order, its model, its servos."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robots.posture import Posture
from robots.rotation import Array
from robots.servo import Servo, servo_models

ROBOTS_FOLDER = Path(__file__).parent

GAIN_RESISTANCE, GAIN_MOTOR_CONSTANT = 0, 1  # columns of a dcmotor's gainprm
GAIN_KP, GAIN_KD, GAIN_VMAX = 4, 6, 7


class RobotError(ValueError):
    """A robot is unknown or its description is wrong."""


@dataclass(frozen=True, kw_only=True)
class Joint:
    """One servo joint."""

    name: str
    lower: float
    """[rad]"""
    upper: float
    """[rad]"""
    max_velocity: float
    """No-load speed of the servo at its nominal voltage [rad/s]."""
    max_torque: float
    """Stall torque of the servo at its nominal voltage [N·m]."""
    servo: Servo
    segment: str
    """Class that weighs the joint in the posture metric: head, wrist, foot, other."""


@dataclass(frozen=True)
class Layout:
    """Where a compiled model keeps the robot's root and joints."""

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


@dataclass(frozen=True, kw_only=True)
class Robot:
    """A robot as described by its folder."""

    name: str
    folder: Path
    joints: tuple[Joint, ...]
    torso: str
    neck_site: str
    imu_site: str
    sole_sites: tuple[str, ...]
    control_period: float
    """[s]"""
    supply_voltage: float
    """Nominal supply [V]."""
    standing: Posture
    """The stance to end in, soles on the ground z = 0."""
    standing_neck_height: float
    """Height of the neck site over the soles in the standing posture [m]."""
    mirror_index: np.ndarray
    """Joint that takes each joint's place when left and right are exchanged, (n,)."""
    mirror_sign: Array
    """Sign of its angle there, (n,)."""
    model_file: Path

    @property
    def n(self) -> int:
        """Return the number of joints."""
        return len(self.joints)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Return the joint names in canonical order."""
        return tuple(joint.name for joint in self.joints)

    @cached_property
    def lower(self) -> Array:
        """Return the lower joint limits [rad], (n,)."""
        return np.array([joint.lower for joint in self.joints])

    @cached_property
    def upper(self) -> Array:
        """Return the upper joint limits [rad], (n,)."""
        return np.array([joint.upper for joint in self.joints])

    @cached_property
    def max_torque(self) -> Array:
        """Return the stall torques [N·m], (n,)."""
        return np.array([joint.max_torque for joint in self.joints])

    @cached_property
    def max_velocity(self) -> Array:
        """Return the no-load speeds [rad/s], (n,)."""
        return np.array([joint.max_velocity for joint in self.joints])

    @cached_property
    def position_gain(self) -> Array:
        """Return the position-mode stiffness at nominal voltage [N·m/rad], (n,)."""
        return np.array([joint.servo.model.position_gain() for joint in self.joints])

    @cached_property
    def torque_speed_slope(self) -> Array:
        """Return the torque lost to back-EMF per speed [N·m·s/rad], (n,)."""
        return np.array([joint.servo.model.torque_speed_slope for joint in self.joints])

    def mirror_joints(self, joint_pos: Array) -> Array:
        """Exchange left and right in joint angles (..., n)."""
        return joint_pos[..., self.mirror_index] * self.mirror_sign

    def spec(self) -> mujoco.MjSpec:
        """Build the robot's model with one position servo a joint, in joint order."""
        spec = mujoco.MjSpec.from_file(str(self.model_file))
        spec.option.timestep = min(spec.option.timestep, 0.002)
        for joint in self.joints:
            _add_servo(spec, joint)
        return spec

    def layout(self, model: mujoco.MjModel) -> Layout:
        """Find where ``model`` keeps this robot's root and joints."""
        ids = [model.joint(name).id for name in self.joint_names]
        root = model.body(self.torso).jntadr[0]
        return Layout(
            qpos=model.jnt_qposadr[ids],
            dof=model.jnt_dofadr[ids],
            root_qpos=int(model.jnt_qposadr[root]),
            root_dof=int(model.jnt_dofadr[root]),
            torso=model.body(self.torso).id,
        )

    def drive_gains(self, voltage: Array | float, gain_scale: Array | float = 1.0) -> Array:
        """Compute the servos' ``actuator_gainprm`` at a supply voltage, (..., n, 10).

        Position mode sets a share of the supply, so stiffness and largest drive
        voltage both follow it.

        Args:
            voltage: Supply [V], shape (...).
            gain_scale: Share of the position gain, shape (..., n) or a number.
        """
        models = [joint.servo.model for joint in self.joints]
        voltage = np.asarray(voltage, dtype=float)[..., None]
        gains = np.zeros((*voltage.shape[:-1], self.n, 10))
        gains[..., GAIN_RESISTANCE] = [m.resistance for m in models]
        gains[..., GAIN_MOTOR_CONSTANT] = [m.motor_constant for m in models]
        nominal = np.array([m.nominal_voltage for m in models])
        gains[..., GAIN_KP] = self.position_gain * gain_scale * voltage / nominal
        gains[..., GAIN_KD] = self.torque_speed_slope
        gains[..., GAIN_VMAX] = voltage
        return gains


def _add_servo(spec: mujoco.MjSpec, joint: Joint) -> None:
    """Add a joint's servo: its friction and rotor, and a motor in position mode.

    The servo drives voltage from the position error without compensating its
    back-EMF. A ``dcmotor`` compensates it, so a derivative gain of K²/R takes the
    compensation out again.
    """
    motor = joint.servo.model
    element = spec.joint(joint.name)
    element.armature = motor.armature
    element.frictionloss = motor.friction
    actuator = spec.add_actuator(name=joint.name, target=joint.name)
    actuator.trntype = mujoco.mjtTrn.mjTRN_JOINT
    actuator.set_to_dcmotor(
        motorconst=[motor.motor_constant, motor.motor_constant],
        resistance=motor.resistance,
        saturation=[motor.stall_torque, 0.0, 0.0],
        controller=[
            motor.position_gain(),
            0,
            motor.torque_speed_slope,
            0,
            0,
            motor.nominal_voltage,
        ],
        ctrlspec=mujoco.mjtCtrlInput.mjINPUT_POS,
    )


def list_robots() -> list[str]:
    """List the robots that come with the package."""
    return sorted(path.parent.name for path in ROBOTS_FOLDER.glob("*/robot.toml"))


def load_robot(name_or_folder: str | Path) -> Robot:
    """Load a robot by name, or from a user's own folder that holds a robot.toml.

    Raises:
        RobotError: if there is no such robot, or its description is wrong.
    """
    folder = Path(name_or_folder)
    if not (folder / "robot.toml").is_file():
        folder = ROBOTS_FOLDER / str(name_or_folder)
    if not (folder / "robot.toml").is_file():
        raise RobotError(
            f"unknown robot '{name_or_folder}': allowed {', '.join(list_robots())}, "
            "or a folder that holds a robot.toml"
        )
    try:
        table = tomllib.loads((folder / "robot.toml").read_text("utf-8"))
        return _build_robot(folder, table)
    except (KeyError, TypeError, ValueError) as error:
        raise RobotError(f"{folder / 'robot.toml'}: {_explain(error)}") from error


def _explain(error: Exception) -> str:
    text = " ".join(str(error.args[0] if error.args else error).split())
    is_key = isinstance(error, KeyError) and " " not in text  # MuJoCo's KeyErrors are sentences
    return f"{text} is missing" if is_key else text


def _build_robot(folder: Path, table: dict[str, Any]) -> Robot:
    model_file = folder / table["model"]
    model = mujoco.MjModel.from_xml_path(str(model_file))
    rows = table["joints"]
    names = [row["name"] for row in rows]
    joints = tuple(_build_joint(row, model) for row in rows)
    standing, neck_height = _stand(table, names, model)
    return Robot(
        name=table["name"],
        folder=folder,
        joints=joints,
        torso=table["torso"],
        neck_site=table["neck_site"],
        imu_site=table["imu_site"],
        sole_sites=tuple(table["sole_sites"]),
        control_period=table["control_period"],
        supply_voltage=table["supply_voltage"],
        standing=standing,
        standing_neck_height=neck_height,
        mirror_index=np.array([names.index(row["mirror"]) for row in rows]),
        mirror_sign=np.array([float(row["mirror_sign"]) for row in rows]),
        model_file=model_file,
    )


def _build_joint(row: dict[str, Any], model: mujoco.MjModel) -> Joint:
    models = servo_models()
    if row["servo"] not in models:
        raise ValueError(
            f"joint '{row['name']}': unknown servo '{row['servo']}', allowed {', '.join(models)}"
        )
    motor = models[row["servo"]]
    lower, upper = model.joint(row["name"]).range
    return Joint(
        name=row["name"],
        lower=float(lower),
        upper=float(upper),
        max_velocity=motor.no_load_speed,
        max_torque=motor.stall_torque,
        servo=Servo(id=row["id"], model=motor, sign=row["sign"], zero_ticks=row["zero_ticks"]),
        segment=row["segment"],
    )


def _stand(table: dict[str, Any], names: list[str], model: mujoco.MjModel) -> tuple[Posture, float]:
    """Put the soles of the standing posture flat on the ground; return it and the neck height."""
    data = mujoco.MjData(model)
    for name, angle in table["standing"].items():
        data.joint(name).qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    torso_from_sole = np.mean(
        [data.site(site).xmat.reshape(3, 3) for site in table["sole_sites"]], axis=0
    )
    u, _, v = np.linalg.svd(torso_from_sole)
    orientation = np.zeros(4)
    mujoco.mju_mat2Quat(orientation, (u @ v).T.ravel())
    torso = model.body(table["torso"])
    root = int(model.jnt_qposadr[torso.jntadr[0]])
    data.qpos[root + 3 : root + 7] = orientation
    mujoco.mj_kinematics(model, data)
    sole_height = min(data.site(site).xpos[2] for site in table["sole_sites"])
    posture = Posture(
        position=np.array([0.0, 0.0, -sole_height]),
        orientation=orientation,
        joint_pos=np.array([table["standing"].get(name, 0.0) for name in names]),
    )
    return posture, float(data.site(table["neck_site"]).xpos[2] - sole_height)
