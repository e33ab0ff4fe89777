"""Motion: the trajectory on which a servo's position or velocity follows its goal."""

from __future__ import annotations

from drivers.virtual.profile import (
    Shape,
    Trajectory,
    approach,
    plan_by_time,
    plan_by_velocity,
)
from drivers.virtual.registers import Registers
from robots.servo import RAD_PER_TICK

TIME_BASED = 4  # bit of drive_mode
MOST = 0x7FFFFFFF  # counts that a register of four bytes holds


class Motion:
    """Follow goals by the profile registers, and show the trajectory in its registers."""

    def __init__(self, registers: Registers) -> None:
        self._registers = registers
        table = registers.table
        self._speed_scale = table["profile_velocity"].scale  # rad/s
        self._acceleration_scale = table["profile_acceleration"].scale  # rad/s²
        self.position = 0.0
        """Where the trajectory is [ticks, as registers show them]."""
        self.speed = 0.0
        """Where the ramp of velocity mode is [rad/s]."""
        self.running = False
        """True while the goal is not reached yet."""
        self.shape = Shape.STEP
        self._velocity = 0.0  # ticks/s
        self._trajectory: Trajectory | None = None
        self._goal_speed, self._acceleration = 0.0, 0.0

    def halt(self, position: float) -> None:
        """Stay at a position [ticks], with no velocity."""
        self.position, self._velocity = position, 0.0
        self.speed = self._goal_speed = 0.0
        self._trajectory, self.running, self.shape = None, False, Shape.STEP
        self._show()

    def aim(self, now: float, goal: float) -> None:
        """Set out for a position [ticks] by the profile registers."""
        velocity, acceleration = self._profile()
        if not velocity:  # the usual case: no profile
            self.halt(goal)
            return
        if self._is_time_based():
            self._trajectory = plan_by_time(
                now, self.position, self._velocity, goal, velocity * 1e-3, acceleration * 1e-3
            )
        else:
            self._trajectory = plan_by_velocity(
                now,
                self.position,
                self._velocity,
                goal,
                velocity * self._speed_scale / RAD_PER_TICK,
                acceleration * self._acceleration_scale / RAD_PER_TICK,
            )
        self.shape = self._trajectory.shape
        self.running = self._trajectory.end > now
        if not self.running:
            self.halt(goal)
        self._show()

    def aim_speed(self, goal: float) -> None:
        """Set out for a velocity [rad/s]; only the profile's acceleration counts."""
        _, acceleration = self._profile()
        self._goal_speed = goal
        if not acceleration:
            self.speed = goal
        elif self._is_time_based():
            self._acceleration = abs(goal - self.speed) / (acceleration * 1e-3)
        else:
            self._acceleration = acceleration * self._acceleration_scale
        self.running = self.speed != goal
        self._show()

    def advance(self, now: float, duration: float) -> None:
        """Go on along the trajectory; of use while ``running``."""
        if self._trajectory is not None:
            self.position, self._velocity = self._trajectory.at(now)
            self.running = now < self._trajectory.end
        else:
            self.speed = approach(self.speed, self._goal_speed, self._acceleration * duration)
            self.running = self.speed != self._goal_speed
        self._show()

    def _profile(self) -> tuple[int, int]:
        return self._registers["profile_velocity"], self._registers["profile_acceleration"]

    def _is_time_based(self) -> bool:
        return bool(self._registers["drive_mode"] & TIME_BASED)

    def _show(self) -> None:
        speed = self._velocity * RAD_PER_TICK or self.speed
        speed_counts, position = round(speed / self._speed_scale), round(self.position)
        self._registers["velocity_trajectory"] = max(-MOST, min(MOST, speed_counts))
        self._registers["position_trajectory"] = max(-MOST, min(MOST, position))
