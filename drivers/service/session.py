"""A robot's buses opened to be looked at: power on, no torque, nothing set."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from drivers.dynamixel.bus import DynamixelBus
from drivers.dynamixel.configuration import ALL_ANSWERED
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.diagnostics import (
    TRIES,
    Diagnostics,
    DiagnosticsError,
    Finding,
    ServoFacts,
    Severity,
    audit,
    list_doubled_ids,
    name_of,
)
from drivers.dynamixel.opencr import OpenCr
from drivers.dynamixel.port import Port, PortError, SerialPort
from drivers.dynamixel.startup import await_servos
from drivers.errors import SetupError
from robots import Joint, Robot

MARGIN = 0.03  # s that an answer may take: nothing here is in a hurry

MakePort = Callable[[str, int], Port]


@dataclass(frozen=True)
class Line:
    """One port of a robot and who hangs on it."""

    name: str
    """The port's name in the robot's description."""
    bus: DynamixelBus
    joints: tuple[Joint, ...]


class RobotBus:
    """All ports of a robot, and its board.

    Two things may be written on the way in, and are told in ``written``: the board's switch
    for the servos' power, and the status return level of a servo that answers no reads. Both
    are as after a power-up again as soon as the robot is switched off.
    """

    def __init__(self, robot: Robot, lines: tuple[Line, ...]) -> None:
        """Look at a robot's buses through ports that are open."""
        self.robot, self.lines = robot, lines
        self.written: list[str] = []
        """What was written in order to look, in words."""
        self.board = _find_board(robot, lines)
        self.answering_board: OpenCr | None = None
        """The board, when it is there and is one."""
        self.findings: list[Finding] = list_doubled_ids(robot)
        """What is wrong with the description and the board."""
        if self.board is None:
            self._complain("robot.toml", "names no board with an IMU", "add a [bus.board] table")
        else:
            self._wake(self.board)
        for line in lines:
            for joint in line.joints:
                self._unmute(line.bus, joint)

    def look(self, joints: tuple[Joint, ...] | None = None) -> Diagnostics:
        """Audit all joints, or some."""
        servos: list[ServoFacts] = []
        findings = list(self.findings)
        for line in self.lines:
            told = audit(line.bus, [j for j in line.joints if joints is None or j in joints])
            servos += told.servos
            findings += told.findings
        return Diagnostics(tuple(servos), tuple(findings))

    def line_of(self, joint: Joint) -> Line:
        """Return the line that a joint is on."""
        return next(line for line in self.lines if joint in line.joints)

    def find_torque(self) -> tuple[Joint, ...]:
        """List the joints whose servos have torque."""
        return tuple(
            joint
            for line in self.lines
            for joint in line.joints
            if _read_byte(line.bus, joint, "torque_enable")
        )

    def release(self, joints: tuple[Joint, ...]) -> None:
        """Take the torque off some joints.

        Raises:
            AuditError: naming those that do not confirm it.
        """
        held = [joint for joint in joints if not self._release(joint)]
        if held:
            text, remedy = "does not confirm that it is limp", "check its cable, or switch it off"
            raise DiagnosticsError(
                [Finding(Severity.ERROR, name_of(j), text, remedy) for j in held]
            )

    def _release(self, joint: Joint) -> bool:
        item = table_named(joint.servo.model.name)["torque_enable"]
        done = self.line_of(joint).bus.write(joint.servo.id, item.address, b"\x00", TRIES)
        return done is not None and not done.number

    def _wake(self, board: OpenCr) -> None:
        """Look whether the board is there, and let it give power to the servos."""
        bus = _line_with(self.lines, board.settings.port).bus
        who = f"board '{board.settings.model}' (id {board.id})"
        remedy = "check its power, its cable and bus.board"
        status = board.ping()
        if status is None:
            self._complain(who, "silent", remedy)
            return
        number = int.from_bytes(status.data[:2], "little")
        if number != board.model_number:
            self._complain(who, f"is of model {number}, allowed {board.model_number}", remedy)
            return
        self.answering_board = board
        power = table_named(board.settings.model)["dynamixel_power"]
        told = bus.read(board.id, power.span, TRIES)
        if not board.settings.powers_servos or (told is not None and told.data == b"\x01"):
            return
        if not board.power_servos():
            self._complain(who, "does not switch the servos' power on", remedy)
            return
        self.written.append(f"the servos' power was off: switched on at the {who}")
        await_servos(self.lines)

    def _unmute(self, bus: DynamixelBus, joint: Joint) -> None:
        """Let a servo answer that hears a ping but was told to answer nothing else."""
        damaged = bus.statistics.damaged
        if bus.ping(joint.servo.id, TRIES) is None:
            return
        if _read_byte(bus, joint, "status_return_level") is not None:
            return
        if bus.statistics.damaged > damaged:
            return  # two of one id: the audit says so
        level = table_named(joint.servo.model.name)["status_return_level"]
        bus.write(joint.servo.id, level.address, bytes((ALL_ANSWERED,)))
        self.written.append(f"{name_of(joint)} answered no reads: its status return level is 2 now")

    def _complain(self, who: str, text: str, remedy: str) -> None:
        self.findings.append(Finding(Severity.ERROR, who, text, remedy))


@contextmanager
def open_robot_bus(
    robot: Robot, ports: Mapping[str, str], make_port: MakePort = SerialPort
) -> Iterator[RobotBus]:
    """Open a robot's ports to look, and close them afterwards.

    Args:
        robot: Robot with a bus.
        ports: Device of each port, by its name in the robot's description.
        make_port: Makes a port of a path and a speed.

    Raises:
        SetupError: when a port does not open, telling of all that do not.
    """
    settings = robot.bus
    assert settings is not None
    joints = {joint.name: joint for joint in robot.joints}
    lines = tuple(
        Line(
            port.name,
            DynamixelBus(make_port(ports[port.name], settings.baud), answer_margin=MARGIN),
            tuple(joints[name] for name in port.joints),
        )
        for port in settings.ports
    )
    with ExitStack() as closing:
        refusals: list[PortError] = []
        for line in lines:
            try:
                line.bus.port.open()
                closing.callback(line.bus.port.close)
            except PortError as error:
                refusals.append(error)
        if len(refusals) == 1:
            raise refusals[0]
        if refusals:
            raise SetupError("; ".join(map(str, refusals)))
        yield RobotBus(robot, lines)


def _find_board(robot: Robot, lines: tuple[Line, ...]) -> OpenCr | None:
    if robot.bus is None or robot.bus.board is None:
        return None
    return OpenCr(_line_with(lines, robot.bus.board.port).bus, robot.bus.board)


def _line_with(lines: tuple[Line, ...], name: str) -> Line:
    return next(line for line in lines if line.name == name)


def _read_byte(bus: DynamixelBus, joint: Joint, name: str) -> int | None:
    """Read a register of one byte; ``None`` when the servo does not tell it."""
    item = table_named(joint.servo.model.name)[name]
    told = bus.read(joint.servo.id, item.span, TRIES)
    return None if told is None or told.number or not told.data else told.data[0]
