"""A command as servos understand it: ticks, gains and PWM limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.dynamixel.bus import DynamixelBus, SyncWriter
from drivers.dynamixel.control_table import table_named
from drivers.dynamixel.protocol2 import bulk_write
from drivers.dynamixel.servo_states import ServoStates
from drivers.servo_units import ServoUnits
from drivers.state import Command, Integers, check_command
from robots import Joint, Robot
from robots.quaternion import Array
from robots.servo import DEFAULT_P_GAIN, PWM_FULL_SCALE, TICKS_PER_TURN, count_pwm

FAR = 100.0  # rad, beyond any servo; only keeps absurd targets within whole numbers
# Every so many cycles gains and limits are sent again, should a servo have missed them.
REFRESH = 64
FRESH = 2.5  # periods; an older position is no place to begin from


@dataclass(frozen=True, eq=False)
class RegisterCommands:
    """What each servo is to hold, in joint order, each of shape (n,)."""

    goal: Integers
    """[ticks]"""
    p_gain: Integers
    """Register value."""
    pwm: Integers
    """Goal PWM [counts]."""
    torque: NDArray[np.bool_]
    """Whether it shall have torque."""


class Translator:
    """Turns commands into orders, and orders back into what was really sent."""

    def __init__(self, robot: Robot) -> None:
        self._units = ServoUnits(robot)
        self._n = robot.n
        self._stall = np.array([joint.servo.model.stall_torque for joint in robot.joints])
        self.pwm_limit = np.full(robot.n, PWM_FULL_SCALE)
        """What each servo's PWM limit allows [counts]."""

    def to_orders(self, command: Command) -> RegisterCommands:
        """Convert a command; nothing in it is rounded beyond what it allows.

        Raises:
            CommandError: if it holds what no servo can be told.
        """
        check_command(command, self._n)
        target = np.minimum(np.maximum(command.joint_pos, -FAR), FAR)
        goal = self._units.to_ticks(self._units.round_goal(target))
        allowed = np.minimum(command.torque_limit / self._stall, command.pwm_limit)
        pwm = np.minimum(count_pwm(allowed), self.pwm_limit).astype(int)
        gain = np.rint(DEFAULT_P_GAIN * np.minimum(np.maximum(command.gain_scale, 0.0), 1.0))
        return RegisterCommands(
            goal=np.minimum(np.maximum(goal, 0), TICKS_PER_TURN - 1),
            p_gain=gain.astype(int),
            pwm=pwm,
            torque=pwm > 0,
        )

    def to_command(self, orders: RegisterCommands, asked: Command) -> Command:
        """Tell what orders mean."""
        share = orders.pwm / PWM_FULL_SCALE
        torque: Array = share * self._stall
        return Command(
            joint_pos=self._units.to_rad(orders.goal),
            gain_scale=orders.p_gain / DEFAULT_P_GAIN,
            torque_limit=np.where(orders.torque, np.minimum(torque, asked.torque_limit), 0.0),
            pwm_limit=np.minimum(share, asked.pwm_limit),
        )


class LastWritten:
    """What servos were last told of one register: only news are sent, and each of them twice."""

    def __init__(self, n: int) -> None:
        self._sent = np.full(n, -1)
        self._again = np.zeros(n, dtype=bool)

    def find_due(self, values: Integers) -> NDArray[np.bool_]:
        """Return who has to be told; it counts as done."""
        changed = values != self._sent
        due = changed | self._again
        self._again = changed
        self._sent = values
        return due

    def forget(self) -> None:
        """Forget what was told: somebody has restarted."""
        self._sent = np.full(len(self._sent), -1)


class CommandWriter:
    """Sends orders to the servos of one bus, in the order that is safe.

    Torque goes off first. Where it comes on, gain and limit are set before, the goal is the
    present position, and the watchdog begins anew. The goals of all come last, limp ones
    included: they end the cycle, and they are what feeds the watchdogs.
    """

    def __init__(
        self, bus: DynamixelBus, joints: list[Joint], rows: np.ndarray, watchdog: int
    ) -> None:
        """Prepare to write.

        Args:
            bus: Where the servos are.
            joints: The joints on it.
            rows: Their places in the robot's joint order.
            watchdog: Register value of the bus watchdog under torque.
        """
        self._bus, self._rows, self._watchdog = bus, rows, watchdog
        self._ids = [joint.servo.id for joint in joints]
        table = table_named(joints[0].servo.model.name)

        def writer(name: str) -> SyncWriter:
            kind = {1: "u1", 2: "<i2", 4: "<i4"}[table[name].size]
            return SyncWriter(table[name].address, kind, self._ids)

        self._goal_address = table["goal_position"].address
        self._goal, self._torque = writer("goal_position"), writer("torque_enable")
        self._p_gain, self._pwm = writer("position_p_gain"), writer("goal_pwm")
        self._dog = writer("bus_watchdog")
        self._return_level = writer("status_return_level")
        self._shadows = LastWritten(len(rows)), LastWritten(len(rows))
        self._all = np.ones(len(rows), dtype=bool)
        self._zeros = np.zeros(len(rows), dtype=int)
        self._cycle = 0

    def write(self, orders: RegisterCommands, bank: ServoStates, fresh: NDArray[np.bool_]) -> None:
        """Send orders.

        Args:
            orders: For all joints of the robot; ``torque`` already says what may be.
            bank: What is known of the servos; its torque flags are brought up to date.
            fresh: Whose position is new enough to begin from, shape (n,).
        """
        rows, send = self._rows, self._bus.send
        self._cycle += 1
        wanted = orders.torque[rows]
        was_on = bank.is_on[rows]
        off = ~wanted & (was_on | bank.must_release[rows])
        if off.any():
            self._switch_off(off, bank)
        on = wanted & fresh[rows] & (~was_on | bank.must_seed[rows])
        goes_on = bool(on.any())
        shadows, writers = self._shadows, (self._p_gain, self._pwm)
        for i, values in enumerate((orders.p_gain[rows], orders.pwm[rows])):
            due = shadows[i].find_due(values)
            if self._cycle % REFRESH == i * REFRESH // 2:
                due = self._all
            if goes_on:
                due = due | on  # whatever they were told before, they may have forgotten it
            if due.any():
                send(writers[i].encode_some(due, values))
        if goes_on:
            self._switch_on(on, bank)
        present = np.minimum(np.maximum(bank.ticks[rows], 0), TICKS_PER_TURN - 1)
        send(self._goal.encode(np.where(bank.is_on[rows], orders.goal[rows], present)))

    def forget(self) -> None:
        """Tell gains and limits anew: a servo has been set up again."""
        for shadow in self._shadows:
            shadow.forget()

    def release_all(self) -> None:
        """Take the torque from everybody, whatever they had."""
        self._bus.send(self._torque.encode(self._zeros))

    def disarm_all(self) -> None:
        """Take everybody's watchdog off."""
        self._bus.send(self._dog.encode(self._zeros))

    def ask_for_answers(self, level: int) -> None:
        """Set everybody's status return level."""
        self._bus.send(self._return_level.encode(np.full(len(self._rows), level)))

    def _switch_off(self, off: NDArray[np.bool_], bank: ServoStates) -> None:
        self._bus.send(self._torque.encode_some(off, self._zeros))
        chosen = self._rows[off]
        bank.is_on[chosen] = bank.must_release[chosen] = bank.must_seed[chosen] = False

    def _switch_on(self, on: NDArray[np.bool_], bank: ServoStates) -> None:
        send, chosen = self._bus.send, self._rows[on]
        # A watchdog that has tripped locks the goals until it is cleared.
        send(self._dog.encode_some(on, self._zeros))
        present = np.minimum(np.maximum(bank.ticks[chosen], 0), TICKS_PER_TURN - 1)
        ids = [self._ids[i] for i in np.flatnonzero(on)]
        # Not a sync write: on a virtual bus in lock-step that would end the cycle.
        seeds = [int(ticks).to_bytes(4, "little", signed=True) for ticks in present]
        address = self._goal_address
        send(bulk_write({i: (address, seed) for i, seed in zip(ids, seeds, strict=True)}))
        send(self._dog.encode_some(on, np.full(len(on), self._watchdog)))
        send(self._torque.encode_some(on, np.ones(len(on), dtype=int)))
        bank.is_on[chosen] = True
        bank.must_seed[chosen] = bank.must_release[chosen] = False
        bank.doubts[chosen] = 0
