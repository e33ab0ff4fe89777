"""A robot for ros2_control: its servos on `dynamixel_hardware_interface`, and its controllers.

The plugin turns an angle of a servo about tick 2048 into joint angles by one matrix for each port;
directions, gears and coupled joints are in it. A zero elsewhere becomes a homing offset.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from xml.sax.saxutils import escape, quoteattr

import numpy as np

from drivers.dynamixel.configuration import OPERATING_MODES
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.robot_ports import find_bus
from drivers.errors import SetupError
from drivers.servo_units import fits_one_turn, tick_range
from drivers.state import Integers
from robots import Joint, Robot, TorqueLimit
from robots.quaternion import Array
from robots.servo import TICKS_PER_TURN, count_pwm
from robots.storage.encoding import to_json

PLUGIN = "dynamixel_hardware_interface/DynamixelHardware"
MODEL_FOLDER = "/param/dxl_model"
MIDDLE = TICKS_PER_TURN // 2
"""Ticks that the plugin takes for angle 0."""
ERROR_TIMEOUT = 500  # ms without a reply, after which the plugin gives up
GOAL_TOLERANCE = 0.2  # rad, from which a loaded joint is not where a motion ends
STOPPED = 0.1  # rad/s; servos count speed in steps of 0.024
GOAL_TIME = 1.0  # s
BROADCASTER, CONTROLLER = "joint_state_broadcaster", "joint_trajectory_controller"
SERVICES = {
    "dynamixel_state_pub_msg_name": "dxl_state",
    "get_dynamixel_data_srv_name": "get_dxl_data",
    "set_dynamixel_data_srv_name": "set_dxl_data",
    "reboot_dxl_srv_name": "reboot_dxl",
    "set_dxl_torque_srv_name": "set_dxl_torque",
}
COMMANDS = ("Goal Position",)
STATES = ("Present Position", "Present Velocity", "Hardware Error Status")


@dataclass(frozen=True, kw_only=True)
class RobotControl:
    """Files of a robot for ros2_control."""

    xacro: str
    """Macro with a `<ros2_control>` for each port."""
    controllers: str
    """Parameters of the controller manager and of the controllers, YAML."""
    notes: tuple[str, ...]
    """What the files cannot express; they say it in comments, too."""

    @classmethod
    def of(cls, robot: Robot, limit: TorqueLimit) -> RobotControl:
        """Describe a robot whose servos are limited in torque."""
        notes = tuple(_find_notes(robot))
        return cls(
            xacro=_write_xacro(robot, limit, notes),
            controllers=_write_controllers(robot),
            notes=notes,
        )


def _find_notes(robot: Robot) -> Iterator[str]:
    bus = find_bus(robot)
    if plain := {j.servo.model.name for j in robot.joints if not has_watchdog(j)}:
        raise SetupError(
            f"robot '{robot.name}' has servos {', '.join(sorted(plain))}, expected those of the X "
            "and MX(2.0) series: the plugin's settings are theirs"
        )
    yield (
        "there is no guard: ros2_control keeps joints in their ranges if it enforces command "
        "limits, and nothing checks a measurement"
    )
    yield (
        "the servos' watchdog is off, for it would trip before the plugin's first command: if "
        "the computer stops, servos hold their last targets"
    )
    yield "Drive Mode is left as it is in each servo: directions are in the matrices"
    if moved := [j.name for j in robot.joints if j.servo.zero_ticks != MIDDLE]:
        yield (
            f"zeros other than {MIDDLE} ticks become homing offsets in the EEPROM ("
            f"{', '.join(moved)}); getup expects offsets of 0: reset them before you use it again"
        )
    if crossing := [j.name for j in robot.actuators if not fits_one_turn(tick_range(j))]:
        yield (
            f"the ranges of {', '.join(crossing)} leave one turn of their servos, and the plugin "
            "does not count turns: switch the power on with these joints near their middle"
        )
    if bus.board is not None and bus.board.powers_servos:
        yield "the board switches the servos' power: switch it on before ROS starts"
    if robot.imu_site is not None:
        yield "the IMU is not in it: the plugin does not know it"
    if robot.passive_joints:
        yield f"joints without servo are not in it: {', '.join(robot.passive_joints)}"


def has_watchdog(joint: Joint) -> bool:
    """Return whether a joint's servo has the registers of the X series."""
    return table_named(joint.servo.model.name).has_watchdog


def _write_xacro(robot: Robot, limit: TorqueLimit, notes: Sequence[str]) -> str:
    ports = find_bus(robot).ports
    names = {port: "port" if len(ports) == 1 else f"{port}_port" for port in ports}
    parameters = " ".join(f"{name}:=/dev/ttyUSB{k}" for k, name in enumerate(names.values()))
    lines = [
        '<?xml version="1.0"?>',
        "<!-- Servos of a robot for ros2_control; written by getup robots export.",
        f"     Torque limit: {_describe(limit)}. What these files cannot express:",
        *(f"     - {escape(note).replace('--', '- -')}" for note in notes),
        "-->",
        '<robot xmlns:xacro="http://www.ros.org/wiki/xacro">',
        f'  <xacro:macro name={quoteattr(f"{robot.name}_ros2_control")} params="{parameters}">',
    ]
    for port, joints in ports.items():
        rows = np.array([k for k, name in enumerate(robot.joint_names) if name in joints])
        system = robot.name if len(ports) == 1 else f"{robot.name}_{port}"
        lines += [f"    {line}" for line in _write_system(robot, limit, system, names[port], rows)]
    return "\n".join([*lines, "  </xacro:macro>", "</robot>", ""])


def _describe(limit: TorqueLimit) -> str:
    value = "stall torque" if limit.value is None else f"{limit.value:g} N·m"
    return f"{value}, by {limit.mode}"


def _write_system(
    robot: Robot, limit: TorqueLimit, name: str, port: str, rows: Integers
) -> Iterator[str]:
    to_servo = servo_matrix(robot)
    others = np.setdiff1d(np.arange(robot.n), rows)
    if to_servo[np.ix_(rows, others)].any() or to_servo[np.ix_(others, rows)].any():
        raise ValueError(
            f"robot '{robot.name}': coupled joints are on different ports, expected on one"
        )
    own = to_servo[np.ix_(rows, rows)]
    parameters = {
        "port_name": f"${{{port}}}",
        "baud_rate": find_bus(robot).baud,
        "error_timeout_ms": ERROR_TIMEOUT,
        "dynamixel_model_folder": MODEL_FOLDER,
        "number_of_joints": len(rows),
        "number_of_transmissions": len(rows),
        "disable_torque_at_init": "true",
        "transmission_to_joint_matrix": _write_matrix(np.asarray(np.linalg.inv(own), dtype=float)),
        "joint_to_transmission_matrix": _write_matrix(own),
    } | {key: f"dynamixel_hardware_interface/{value}" for key, value in SERVICES.items()}
    yield f'<ros2_control name={quoteattr(name)} type="system">'
    yield "  <hardware>"
    yield f"    <plugin>{PLUGIN}</plugin>"
    yield from (f"    {_write_parameter(key, value)}" for key, value in parameters.items())
    yield "  </hardware>"
    for k in rows.tolist():
        yield from (f"  {line}" for line in _write_joint(robot, k))
    for k in rows.tolist():
        yield from (f"  {line}" for line in _write_servo(robot, limit, k))
    yield "</ros2_control>"


def servo_matrix(robot: Robot) -> Array:
    """Return the turns of each servo (rows) per turn of each joint (columns), signed, (n, n)."""
    sign = np.array([joint.servo.sign for joint in robot.joints])
    return sign[:, np.newaxis] * robot.transmission.to_servo(np.eye(robot.n)).T


def _write_matrix(matrix: Array) -> str:
    """Write a matrix, one row a line."""
    rows = (", ".join(f"{value:.8g}" for value in row) for row in matrix + 0.0)  # no -0
    return ",\n".join(rows)


def _write_parameter(name: str, value: object) -> str:
    return f"<param name={quoteattr(name)}>{escape(str(value))}</param>"


def _write_joint(robot: Robot, k: int) -> Iterator[str]:
    joint = robot.joints[k]
    yield f"<joint name={quoteattr(joint.name)}>"
    yield '  <command_interface name="position">'
    yield f"    {_write_parameter('min', f'{joint.lower:.6g}')}"
    yield f"    {_write_parameter('max', f'{joint.upper:.6g}')}"
    yield "  </command_interface>"
    yield from (f'  <state_interface name="{name}"/>' for name in ("position", "velocity"))
    yield "</joint>"


def _write_servo(robot: Robot, limit: TorqueLimit, k: int) -> Iterator[str]:
    joint = robot.joints[k]
    settings = {"type": "dxl", "ID": joint.servo.id} | _list_settings(robot, limit, k)
    yield f"<!-- {escape(joint.name).replace('--', '- -')}: {escape(joint.servo.model.name)} -->"
    yield f'<gpio name="dxl{joint.servo.id}">'
    yield from (f"  {_write_parameter(key, value)}" for key, value in settings.items())
    yield from (f'  <command_interface name="{name}"/>' for name in COMMANDS)
    yield from (f'  <state_interface name="{name}"/>' for name in STATES)
    yield "</gpio>"


def _list_settings(robot: Robot, limit: TorqueLimit, k: int) -> dict[str, int]:
    """List the registers of a servo, as our driver sets them; a limp one gets no torque."""
    servo = robot.joints[k].servo
    released = {"Torque Enable": 0} if robot.joints[k].name in robot.limp_joints else {}
    moved = MIDDLE - servo.zero_ticks
    return {
        **released,
        "Operating Mode": int(OPERATING_MODES[limit.mode]),
        "Return Delay Time": 0,
        "Min Position Limit": 0,
        "Max Position Limit": TICKS_PER_TURN - 1,
        **({"Homing Offset": moved} if moved else {}),
        "Position P Gain": servo.p_gain,
        "Position I Gain": 0,
        **({"Position D Gain": servo.model.d_gain} if limit.mode == "current" else {}),
        "Profile Velocity": 0,
        "Profile Acceleration": 0,
        **_limit_torque(robot, limit, k),
    }


def _limit_torque(robot: Robot, limit: TorqueLimit, k: int) -> dict[str, int]:
    """Return the register that limits a servo's torque, as our driver sets it."""
    full = robot.max_torque
    torque = full if limit.value is None else np.minimum(full, limit.value)
    if limit.mode == "current":
        return {"Goal Current": int(robot.count_current(torque)[k])}
    return {"Goal PWM": int(count_pwm(torque / full)[k])}


def _write_controllers(robot: Robot) -> str:
    names = [to_json(name).strip() for name in robot.joint_names]
    rate = round(1.0 / robot.control_period)
    tolerances = "\n".join(f"      {name}: {{goal: {GOAL_TOLERANCE}}}" for name in names)
    listed = "\n".join(f"      - {name}" for name in names)
    return f"""# Controllers of a robot for ros2_control; written by getup robots export.
controller_manager:
  ros__parameters:
    update_rate: {rate}  # Hz
    {BROADCASTER}:
      type: {BROADCASTER}/JointStateBroadcaster
    {CONTROLLER}:
      type: {CONTROLLER}/JointTrajectoryController

{CONTROLLER}:
  ros__parameters:
    joints:
{listed}
    command_interfaces: [position]
    state_interfaces: [position, velocity]
    interpolation_method: splines  # quintic through what getup motions export writes
    allow_partial_joints_goal: false
    allow_nonzero_velocity_at_trajectory_end: false
    constraints:
      goal_time: {GOAL_TIME}  # s
      stopped_velocity_tolerance: {STOPPED}  # rad/s
      # rad; loaded joints lag behind their targets, on the way by more: no tolerance there
{tolerances}
"""
