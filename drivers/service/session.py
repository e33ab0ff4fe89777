"""Opens the buses of a robot for service: power on, torque as it is, nothing configured."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

from drivers.dynamixel.board import Board, check_board
from drivers.dynamixel.bus import TRIES, DynamixelBus
from drivers.dynamixel.control_table import Item, table_named
from drivers.dynamixel.diagnostics import (
    Diagnostics,
    DiagnosticsError,
    Finding,
    ServoFacts,
    diagnose,
    find_duplicate_ids,
    name_of,
)
from drivers.dynamixel.robot_ports import RobotPort, build_ports, find_imu, open_ports
from drivers.dynamixel.startup import SETUP_MARGIN, await_servos, locate, open_imu
from drivers.imu.source import ImuSource
from drivers.serial_port import MakePort, SerialPort
from robots import Joint, Robot
from robots.bench import ServoBench


class RobotBus:
    """All ports of a robot, its board, and its IMU.

    Two things may be written at the start, and are listed in ``written``: the board's switch
    for the servos' power, and the status return level of a servo that does not reply to reads. Both
    are reset when the robot is switched off.
    """

    def __init__(self, robot: Robot, ports: Sequence[RobotPort], imu: ImuSource | None) -> None:
        """Check the board, the IMU and the servos' replies, through ports that are open."""
        self.robot, self.ports = robot, ports
        self.servos = [(port.bus, joint) for port in ports for joint in port.joints]
        """Each joint, and the bus of its servo."""
        self.written: list[str] = []
        """What was written at the start, in words."""
        self.board: Board | None = None
        """The board, if it replies and is the expected one."""
        self.imu: ImuSource | None = None
        """The IMU, if it could be opened."""
        self.findings: list[Finding] = find_duplicate_ids(robot)
        """Problems of the description and the board."""
        self._check_board()
        if imu is not None or not isinstance(robot, ServoBench):
            self._open_imu(imu)
        for bus, joint in self.servos:
            self._unmute(bus, joint)

    def diagnose(self, joints: tuple[Joint, ...] | None = None) -> Diagnostics:
        """Diagnose all joints, or some."""
        servos: list[ServoFacts] = []
        findings = list(self.findings)
        for port in self.ports:
            found = diagnose(port.bus, [j for j in port.joints if joints is None or j in joints])
            servos += found.servos
            findings += found.findings
        return locate(self.robot, Diagnostics(tuple(servos), tuple(findings)))

    def find_torque(self) -> tuple[Joint, ...]:
        """List the joints whose servos have torque."""
        return tuple(
            joint for bus, joint in self.servos if bus.read_item(*_register(joint, "torque_enable"))
        )

    def release(self) -> None:
        """Switch off the torque of every joint that has it."""
        held = self.find_torque()
        failed = [
            joint
            for bus, joint in self.servos
            if joint in held and not bus.write_item(*_register(joint, "torque_enable"), 0)
        ]
        if failed:
            text, remedy = "does not confirm torque off", "check its cable, or switch it off"
            raise DiagnosticsError([Finding.error(name_of(j), text, remedy) for j in failed])

    def _check_board(self) -> None:
        board = next((port.board for port in self.ports if port.board), None)
        if board is None:
            return
        was_off = board.settings.powers_servos and not board.is_powering()
        found = check_board(board, set_delay=False)
        self.findings += found
        if found:
            return
        self.board = board
        if was_off:
            self.written.append(f"the servos' power was off: switched on at the {board.name}")
            await_servos(self.servos)

    def _open_imu(self, imu: ImuSource | None) -> None:
        if imu is None:
            text, remedy = "names no IMU", "add an [imu] table, or [bus.board] for one on the bus"
            self.findings.append(Finding.error("robot.toml", text, remedy))
        elif isinstance(imu, Board):
            self.imu = self.board
        elif found := open_imu(imu):
            self.findings += found
        else:
            self.imu = imu

    def _unmute(self, bus: DynamixelBus, joint: Joint) -> None:
        """Make a servo reply to reads that is configured to reply to pings only."""
        damaged = bus.statistics.damaged
        if bus.ping(joint.servo.id, TRIES) is None:
            return
        device, item = _register(joint, "status_return_level")
        if bus.read_item(device, item) is not None:
            return
        if bus.statistics.damaged > damaged:
            return  # two of one id, which `diagnose` reports
        level = item.upper or 0
        bus.write_item(device, item, level)
        self.written.append(
            f"{name_of(joint)} ignored reads: its status return level is {level} now"
        )


@contextmanager
def open_robot_bus(
    robot: Robot, ports: Mapping[str, str], make_port: MakePort = SerialPort
) -> Iterator[RobotBus]:
    """Open the ports of a robot with a bus for service, and close them afterwards.

    ``ports`` names the device of each port, by its name in the robot's description.
    """
    built = build_ports(robot, ports, make_port, answer_margin=SETUP_MARGIN)
    imu = find_imu(robot, built, ports)
    try:
        open_ports([port.bus for port in built])
        yield RobotBus(robot, built, imu)
    finally:
        if imu is not None:
            imu.close()
        for port in built:
            port.bus.port.close()


def _register(joint: Joint, name: str) -> tuple[int, Item]:
    return joint.servo.id, table_named(joint.servo.model.name)[name]
