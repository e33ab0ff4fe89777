"""A virtual Dynamixel servo: everything but its motor, which physics simulates."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial

from drivers.dynamixel.control_table import DriveMode, OperatingMode
from drivers.dynamixel.protocol2 import ErrorNumber, Instruction, Reset, Status
from drivers.virtual_bus.devices.motor_servo import MotorCommand, MotorServo
from drivers.virtual_bus.devices.profile import PositionControl
from drivers.virtual_bus.devices.registers import Registers, clamp
from drivers.virtual_bus.devices.sensors import Measured, Sensors
from robots.servo import PWM_FULL_SCALE

GAINS = (
    *("velocity_i_gain", "velocity_p_gain", "position_d_gain", "position_i_gain"),
    *("position_p_gain", "feedforward_2nd_gain", "feedforward_1st_gain"),
)
PROFILE = ("profile_acceleration", "profile_velocity")
KEPT = {Reset.ALL: (), Reset.ALL_BUT_ID: ("id",), Reset.ALL_BUT_ID_AND_BAUD: ("id", "baud_rate")}
CLEAR_TURNS = b"\x01\x44\x58\x4c\x22"
CLEAR_FIRMWARE = 42  # first that has clear, and that refuses a broadcast reset of all
TORQUE_AT_BOOT = 1  # bit of startup_configuration
WATCHDOG_UNIT = 0.02  # s
TRIPPED = -1  # value of bus_watchdog after it stopped the servo
NOT_MODELLED = (OperatingMode.CURRENT, OperatingMode.VELOCITY, OperatingMode.PWM)
PROTOCOL_2_TYPE = 2  # value of protocol_type (e-manual)


class VirtualServo(MotorServo):
    """Replies like an X-series servo; physics reads `motor_command` and calls `sense`."""

    usual = "XM430-W350", 46, 57_600

    def _connect(self) -> None:
        self._control = PositionControl(self.registers)
        self._sensors = Sensors(self.registers, self._control)
        self._farthest_goal = self.table["goal_position"].upper or 0
        self._handlers |= {
            Instruction.REBOOT: self._handle_reboot,
            Instruction.CLEAR: self._handle_clear,
            Instruction.FACTORY_RESET: self._handle_reset,
        }
        self._checks |= make_checks(self.registers)
        configuration = ("homing_offset", "moving_threshold", *GAINS)
        limits = ("temperature_limit", "min_voltage_limit", "max_voltage_limit")
        goal_limits = ("pwm_limit", "current_limit", "velocity_limit")
        self._effects |= dict.fromkeys((*configuration, *limits), self._reload)
        self._effects |= dict.fromkeys(goal_limits, self._clamp_goals)
        self._effects |= {
            "operating_mode": self._change_mode,
            "drive_mode": self._change_direction,
            "torque_enable": self._switch_torque,
            "bus_watchdog": self._set_watchdog,
            "goal_position": self._set_position_goal,
            "goal_current": self._take_limit,
            "goal_pwm": self._take_limit,
        }

    # For bus and physics ------------------------------------------------------------------------

    @property
    def has_profile(self) -> bool:
        """Return whether a profile is being executed."""
        return self._control.running

    def handle(
        self, instruction: int, params: bytes = b"", *, is_broadcast: bool = False
    ) -> Status | None:
        """Execute an instruction; all refuse to be reset to the same id."""
        resets = instruction == Instruction.FACTORY_RESET and params == bytes((Reset.ALL,))
        if is_broadcast and resets and self.firmware >= CLEAR_FIRMWARE:
            return None
        return super().handle(instruction, params, is_broadcast=is_broadcast)

    def poke(self, name: str, value: int) -> None:
        """Set a register, regardless of access rights and range; `sense` sets measured ones."""
        super().poke(name, value)
        effect = self._effects.get(name)
        if effect is not None and name != "operating_mode":
            effect(value)
        self.alarms = self.peek("hardware_error_status")
        self._reload()

    def sense(self, measured: Measured) -> None:
        """Set the measured quantities."""
        self._sensors.update(measured)
        if self._powered:
            self._protect(measured)

    def clear_turns(self) -> None:
        """Bring the position back into one turn and hold it."""
        self._sensors.fold()
        self._seed_goal()

    def _run(self, duration: float) -> float:  # noqa: ARG002
        """Finish a restart, watch the bus, follow a profile."""
        now = self.now
        if self._is_booting:
            self._is_booting = False
            if self.registers.get("startup_configuration") & TORQUE_AT_BOOT:
                self._switch_torque(1)
        if self.torque_on:
            if self._watchdog > 0 and now - self._traffic_at > self._watchdog * WATCHDOG_UNIT:
                self._trip_watchdog()
            if self._control.running:
                self._control.advance(now)
                self._motor_command = None
                self._sensors.write_flags()
        return self._sensors.measured.current

    def _compute_motor_command(self) -> MotorCommand:
        registers, current_limit = self.registers, math.inf
        by_current = self._mode == OperatingMode.CURRENT_BASED_POSITION
        if "goal_current" in registers:
            counts = registers["goal_current" if by_current else "current_limit"]
            current_limit = abs(counts * self.table["goal_current"].scale)
        return MotorCommand(
            torque_on=self.torque_on,
            by_current=by_current,
            target_ticks=self._sensors.to_horn(self._control.position),
            p_gain=registers["position_p_gain"],
            d_gain=registers["position_d_gain"],
            pwm_limit=min(abs(registers["goal_pwm"] / PWM_FULL_SCALE), 1.0),
            current_limit=current_limit,
        )

    def _trip_watchdog(self) -> None:
        registers = self.registers
        registers["bus_watchdog"] = self._watchdog = TRIPPED
        for name in PROFILE:
            registers[name] = 0
        self._seed_goal()

    # Torque and goals --------------------------------------------------------------------------

    def _is_locked(self) -> bool:
        return self.torque_on

    def _switch_torque(self, value: int) -> None:
        if not value:
            self._release()
        elif self._is_shut_down:
            self.registers["torque_enable"] = 0
        elif not self.torque_on:
            self._engage()
            if self._mode == OperatingMode.POSITION:
                self._sensors.fold()
            self._seed_goal()  # the manual only says that goals may be written before

    def _engage(self) -> None:
        self.torque_on, self._traffic_at = True, self.now
        self.registers["torque_enable"] = 1
        self._motor_command = None

    def _release(self) -> None:
        self.torque_on = False
        self.registers["torque_enable"] = 0
        self._halt()

    def _halt(self) -> None:
        self._control.halt(self._sensors.position)
        self._motor_command = None

    def _seed_goal(self) -> None:
        self.registers["goal_position"] = clamp(self._sensors.position, self._farthest_goal)
        self._halt()

    def _set_position_goal(self, goal: int) -> None:
        """Go to a goal, which may switch torque on."""
        self._motor_command = None
        if not self.torque_on and self.peek("drive_mode") & DriveMode.TORQUE_BY_GOAL:
            self._halt()
            if not self._is_shut_down:
                self._engage()
        if self.torque_on:
            self._control.aim(self.now, goal)
            self._sensors.write_flags()

    def _take_limit(self, _value: int) -> None:
        self._motor_command = None

    # Configuration ---------------------------------------------------------------------

    def _reload(self, _value: int = 0) -> None:
        self._mode = self.peek("operating_mode")
        self._watchdog = self.peek("bus_watchdog")
        self._sensors.reload()
        self._reload_limits()
        self._motor_command = None

    def _set_watchdog(self, value: int) -> None:
        self._watchdog, self._traffic_at = value, self.now

    def _clamp_goals(self, _value: int) -> None:
        registers = self.registers
        for quantity in ("pwm", "current", "velocity"):
            if (name := f"goal_{quantity}") in registers:
                registers[name] = clamp(registers[name], registers[f"{quantity}_limit"])
        self._motor_command = None

    def _change_mode(self, mode: int) -> None:
        self.registers.reset(self.table[name] for name in (*GAINS, *PROFILE))
        self._free_goals()
        self._reload()
        if mode == OperatingMode.POSITION:
            self._sensors.fold()
        self._seed_goal()

    def _change_direction(self, _drive_mode: int) -> None:
        self._reload()
        self.clear_turns()

    def _free_goals(self) -> None:
        """Set the goals that also act as limits to their maximum (e-manual, Operating Mode)."""
        for quantity in ("pwm", "current"):
            if (name := f"goal_{quantity}") in self.registers:
                self.registers[name] = self.registers[f"{quantity}_limit"]

    def _handle_clear(self, params: bytes) -> int:
        if self.firmware < CLEAR_FIRMWARE:
            return ErrorNumber.INSTRUCTION
        if params != CLEAR_TURNS:
            return ErrorNumber.DATA_RANGE
        if self.registers["moving"]:
            return ErrorNumber.RESULT_FAIL
        self.clear_turns()
        return ErrorNumber.NONE

    def _handle_reset(self, params: bytes) -> int:
        if len(params) != 1:
            return ErrorNumber.DATA_LENGTH
        if params[0] not in set(Reset):
            return ErrorNumber.DATA_RANGE
        kept = KEPT[Reset(params[0])]
        items = (item for item in self.table if item.eeprom and item.writable)
        self.registers.reset(item for item in items if item.name not in kept)
        self.reboot()
        return ErrorNumber.NONE

    # Restart -----------------------------------------------------------------------------------

    def _restart(self) -> None:
        registers = self.registers
        registers.reset_ram()
        self._is_booting = True
        self.alarms, self._is_shut_down = 0, False
        self.torque_on, self._traffic_at = False, self.now
        """Whether it drives its motor."""
        self._heat = 0.0
        self._free_goals()
        self._reload()
        self.clear_turns()


def make_checks(registers: Registers) -> dict[str, Callable[[int], int]]:
    """Make the check of each item's values by other registers; it returns an `ErrorNumber`."""
    # The mask of the model's bits, without that of profiles by time, which are not modelled.
    drive_bits = (registers.table["drive_mode"].upper or 0) & ~DriveMode.TIME_BASED

    def check_range(accepts: Callable[[int], object], value: int) -> int:
        return ErrorNumber.NONE if accepts(value) else ErrorNumber.DATA_RANGE

    def check_position(goal: int) -> int:
        if registers["bus_watchdog"] == TRIPPED:
            return ErrorNumber.DATA_RANGE
        lower, upper = registers["min_position_limit"], registers["max_position_limit"]
        is_free = registers["operating_mode"] != OperatingMode.POSITION
        return ErrorNumber.NONE if is_free or lower <= goal <= upper else ErrorNumber.DATA_LIMIT

    def check_by(limit: str, goal: int) -> int:
        if registers["bus_watchdog"] == TRIPPED:
            return ErrorNumber.DATA_RANGE
        return ErrorNumber.DATA_LIMIT if abs(goal) > registers[limit] else ErrorNumber.NONE

    ranges: dict[str, Callable[[int], object]] = {
        "operating_mode": lambda mode: mode in registers.table.modes and mode not in NOT_MODELLED,
        "drive_mode": lambda bits: not bits & ~drive_bits,
        # A real one speaks Protocol 1.0 after it was set to 1; a virtual one cannot, and refuses.
        "protocol_type": lambda kind: kind == PROTOCOL_2_TYPE,
        "bus_watchdog": lambda value: not value or registers["bus_watchdog"] != TRIPPED,
    }
    return {name: partial(check_range, accepts) for name, accepts in ranges.items()} | {
        "goal_position": check_position,
        "goal_pwm": partial(check_by, "pwm_limit"),
        "goal_current": partial(check_by, "current_limit"),
        "goal_velocity": partial(check_by, "velocity_limit"),
    }
