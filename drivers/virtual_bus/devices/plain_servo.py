"""A virtual servo without operating modes, profiles and watchdog: AX, MX(1.0), XL-320, Feetech."""

from __future__ import annotations

import math

from drivers.dynamixel.configuration import SLOPES, STIFFEST, full_scale, has_slope
from drivers.dynamixel.protocol2 import ErrorNumber, Instruction
from drivers.state import HardwareError
from drivers.virtual_bus.devices.motor_servo import MotorCommand, MotorServo
from drivers.virtual_bus.devices.registers import clamp
from drivers.virtual_bus.devices.sensors import Measured

MOST_LOAD = 1000  # counts of a load, which is a share in thousandths


class PlainServo(MotorServo):
    """Replies like a servo with one position loop; physics reads `motor_command`, calls `sense`.

    Turning without end (wheel mode) is not modelled: there it makes no torque. The speed limit of
    a move is kept, its acceleration is not.
    """

    passing = HardwareError.VOLTAGE | HardwareError.OVERHEATING

    usual = "AX-12A", 24, 1_000_000

    def _connect(self) -> None:
        table, figures = self.table, self._figures
        self._last_tick, self._rad_per_tick = figures.last_tick, figures.rad_per_tick
        self._full_scale = full_scale(table)
        self._kept = bytes(self.registers.memory)
        self._measured = Measured(ticks=figures.middle_tick, voltage=figures.nominal_voltage)
        self._target = float(figures.middle_tick)
        if Instruction.FACTORY_RESET in table.instructions:
            self._handlers[Instruction.FACTORY_RESET] = self._handle_reset
        if table.wire.name == "2.0":
            self._handlers[Instruction.REBOOT] = self._handle_reboot
        self._checks["goal_position"] = self._check_goal
        self._effects |= {item.name: self._reload for item in table if item.writable}
        self._effects |= {
            "torque_enable": self._switch_torque,
            "goal_position": self._take_goal,
            "goal_pwm": self._limit_torque,
        }

    # For bus and physics ------------------------------------------------------------------------

    @property
    def torque_on(self) -> bool:
        """Return whether it drives its motor."""
        return bool(self.registers["torque_enable"]) and not self._is_shut_down

    @property
    def has_profile(self) -> bool:
        """Return whether it is on its way to a goal at a limited speed."""
        return self.torque_on and self._target != self._goal

    @property
    def turns(self) -> bool:
        """Return whether it is set to turn without end instead of moving to goals."""
        registers, table = self.registers, self.table
        if "operating_mode" in registers:
            return registers["operating_mode"] != table.default_mode
        return registers["min_position_limit"] == registers["max_position_limit"] == 0

    def poke(self, name: str, value: int) -> None:
        """Set a register, regardless of access rights and range, and what follows from it."""
        super().poke(name, value)
        self._effects.get(name, int)(value)
        self._keep()

    def write(self, address: int, data: bytes) -> int:
        """Set registers; those of the EEPROM are kept without power unless they are locked."""
        error = super().write(address, data)
        if not error:
            self._keep()
        return error

    def sense(self, measured: Measured) -> None:
        """Set the measured quantities."""
        self._measured = measured
        self._write_measured()
        if self._powered:
            self._protect(measured)

    def _release(self) -> None:
        if "goal_pwm" in self.registers:
            self.registers["goal_pwm"] = 0
        self.registers["torque_enable"] = 0
        self._motor_command = None

    def _run(self, duration: float) -> float:
        if self.has_profile:
            limit = abs(self.registers["profile_velocity"])
            speed = limit * self.table["profile_velocity"].scale / self._rad_per_tick  # ticks/s
            way = self._goal - self._target
            step = abs(way) if not limit else min(speed * duration, abs(way))
            self._target += math.copysign(step, way)
            self._motor_command = None
        return self._measured.current

    # Motion -------------------------------------------------------------------------------------

    @property
    def _goal(self) -> float:
        return float(self.registers["goal_position"])

    def _compute_motor_command(self) -> MotorCommand:
        registers = self.registers
        limit = registers.get("goal_pwm", self._full_scale)
        return MotorCommand(
            torque_on=self.torque_on and not self.turns,
            target_ticks=self._target,
            p_gain=self._gain(),
            pwm_limit=min(limit, registers["pwm_limit"]) / self._full_scale,
            current_limit=math.inf,
        )

    def _gain(self) -> int:
        """Return its P gain, or the one that its softer compliance slope makes."""
        if not has_slope(self.table):
            return self.registers["position_p_gain"]
        slope = max(self.registers[name] for name in SLOPES)
        return STIFFEST // (1 << max(slope.bit_length() - 1, 1))

    def _take_goal(self, goal: int) -> None:
        if self.quirks.goal_switches_torque_on and not self.registers["torque_enable"]:
            self.registers["torque_enable"] = 1
            self._switch_torque(1)
        if not self.registers["profile_velocity"]:
            self._target = float(goal)
        self._motor_command = None

    def _switch_torque(self, value: int) -> None:
        self._motor_command = None
        if value:
            has_limit = self.registers["profile_velocity"]
            self._target = self._measured.ticks if has_limit else self._goal
            self._is_shut_down = False
            self._set_alarms(self.alarms & ~HardwareError.OVERLOAD)

    def _limit_torque(self, value: int) -> None:
        self._motor_command = None
        self._is_shut_down &= not value

    def _check_goal(self, goal: int) -> int:
        lower, upper = (self.registers[f"{end}_position_limit"] for end in ("min", "max"))
        if self.turns or lower <= goal <= upper:
            return ErrorNumber.NONE
        return ErrorNumber.DATA_LIMIT

    # Measurements -------------------------------------------------------------------------------

    def _write_measured(self) -> None:
        measured, table, registers = self._measured, self.table, self.registers
        speed = table["present_velocity"]
        most = (1 << (speed.sign_bit or 15)) - 1
        registers["present_position"] = min(max(round(measured.ticks), 0), self._last_tick)
        registers["present_velocity"] = clamp(round(measured.velocity / speed.scale), most)
        load = table["present_load"].scale
        registers["present_load"] = clamp(round(measured.pwm_share / load), MOST_LOAD)
        registers["present_input_voltage"] = min(max(round(measured.voltage * 10.0), 0), 255)
        registers["present_temperature"] = min(max(round(measured.temperature), 0), 255)
        registers["moving"] = int(self.has_profile)

    # Configuration ------------------------------------------------------------------------------

    def _reload(self, _value: int) -> None:
        self._reload_limits()
        self._motor_command = None

    def _is_locked(self) -> bool:
        """Return whether its EEPROM cannot be written; Feetech's can be under torque."""
        if self.table.keeps_by_lock is not None:
            return False
        has_lock = "eeprom_lock" in self.registers and bool(self.registers["eeprom_lock"])
        return has_lock or bool(self.registers["torque_enable"])

    def _keep(self) -> None:
        """Copy the registers that are kept without power, unless a lock keeps the older ones."""
        lock = self.table.keeps_by_lock
        if lock is None or not self.registers[lock]:
            self._kept = bytes(self.registers.memory)

    def _handle_reset(self, _params: bytes) -> int:
        self.registers.reset(i for i in self.table if i.eeprom and i.writable)
        self._keep()
        self.reboot()
        return ErrorNumber.NONE

    def _restart(self) -> None:
        registers = self.registers
        for item in self.table:
            if item.eeprom:
                registers.memory[item.address : item.end] = self._kept[item.address : item.end]
        registers.reset_ram()
        if "goal_pwm" in registers:
            registers["goal_pwm"] = registers["pwm_limit"]
        self.alarms, self._is_shut_down = 0, False
        self._heat = 0.0
        self._reload_limits()
        self._write_measured()
        registers["goal_position"] = registers["present_position"]
        self._target = self._goal
        self._motor_command = None
