"""After the stand: hold, way down or hand-over of a robot, with their results."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Literal

import msgspec

from drivers import Command, Ending, RunReport
from drivers.errors import UnreleasedError
from humanoid_getup.execution.session import Phase
from humanoid_getup.experiments.judging.outcome import Outcome
from humanoid_getup.playback.monitors import Abort
from robots import Robot
from robots.quaternion import Array
from robots.servo import LimitMode


class HeldJoint(msgspec.Struct, frozen=True, kw_only=True):
    """State in which the servo of a joint is handed over."""

    target_rad: float
    torque_limit_nm: float
    position_p_gain: float
    pwm_limit: float


class HandOverFigures(msgspec.Struct, frozen=True, kw_only=True):
    """State in which servos are handed over, under report.json's keys."""

    summary: str
    watchdog: Literal["off"] = "off"
    limit_by: LimitMode
    joints: dict[str, HeldJoint]


@dataclass(frozen=True, kw_only=True)
class AfterFigures:
    """Results after a stand, under report.json's keys; None for steps that did not begin."""

    succeeded: bool
    reason: str
    held_s: float
    way_down_s: float | None
    head_impact_m_s: float | None = None
    torso_impact_m_s: float | None = None
    peak_torque_nm: float | None = None
    hand_over: HandOverFigures | None


@dataclass(frozen=True, kw_only=True)
class HandOver:
    """State of a robot that is handed over under torque to another program."""

    robot: Robot
    command: Command
    """Last command sent to the servos; no watchdog stops them afterwards."""
    limit_by: LimitMode
    """What the torque limits act on, which determines the operating mode of the servos."""

    @property
    def p_gain(self) -> Array:
        """Return the present position P gains of the servos, (n,)."""
        return self.robot.p_gain * self.command.gain_scale

    def __str__(self) -> str:
        """Describe the state of the servos in one line."""
        command = self.command
        return (
            f"servos hold their targets, at most {command.torque_limit.max():.2f} N·m by "
            f"{self.limit_by}, position gain {self.p_gain.min():.0f}, "
            "watchdog off"
        )

    def figures(self) -> HandOverFigures:
        """Return the figures under report.json's keys."""
        command, joints = self.command, enumerate(self.robot.joint_names)
        return HandOverFigures(
            summary=str(self),
            limit_by=self.limit_by,
            joints={
                name: HeldJoint(
                    target_rad=float(command.joint_pos[i]),
                    torque_limit_nm=float(command.torque_limit[i]),
                    position_p_gain=float(self.p_gain[i]),
                    pwm_limit=float(command.pwm_limit[i]),
                )
                for i, name in joints
            },
        )


@contextmanager
def naming_hand_over(find: Callable[[], HandOver | None]) -> Iterator[None]:
    """Name the robot that was handed over under torque, if a block is interrupted or fails."""
    try:
        yield
    except KeyboardInterrupt:
        if (left := find()) is None:
            raise
        raise KeyboardInterrupt(str(left)) from None
    except Exception as error:
        if (left := find()) is not None:
            error.add_note(f"handed over: {left}")
        raise


@dataclass(frozen=True, kw_only=True)
class Step:
    """One step after the stand: holding, following a pilot, or sitting and lying down."""

    run: RunReport
    abort: Abort | None = None
    """Reason of the supervisor's abort, if any."""
    outcome: Outcome | None = None
    """None for a step that is not judged."""
    succeeded: bool = True
    """Whether the judge accepted its end."""

    @property
    def ran(self) -> bool:
        """Return whether it came to its end."""
        return self.run.ending is Ending.DONE and self.abort is None

    @property
    def is_done(self) -> bool:
        """Return whether it came to its end, and ended as it should."""
        return self.ran and self.succeeded

    @property
    def reason(self) -> str:
        """Return in one line why it failed."""
        if self.abort is not None:
            return f"aborted after {self.abort.time:.1f} s: {self.abort}"
        if self.run.ending is not Ending.DONE:
            return self.run.reason
        return "the judge does not accept its end"


@dataclass(frozen=True, kw_only=True)
class AfterStand:
    """What a robot did after its stand; its torque is off, unless it was handed over."""

    refusal: str | None = None
    """Reason why nothing was started, or why it did not end as requested."""
    refused_by_fault: bool = False
    """Whether the reason is a hardware fault."""
    hold: Step | None = None
    """The hold; None if it was not requested."""
    followed: Step | None = None
    """The time under the pilot of the session; None if it has none."""
    way_down: Step | None = None
    """The way down; None if it did not begin."""
    hand_over: HandOver | None = None
    release: UnreleasedError | None = None
    """The joints that did not confirm that their torque is off; None if all did."""

    @property
    def unreleased(self) -> tuple[str, ...]:
        """Return the joints that did not confirm that their torque is off."""
        return self.release.joints if self.release else ()

    @property
    def succeeded(self) -> bool:
        """Return whether every step succeeded."""
        return self.refusal is None and self.release is None and self._find_failure() is None

    @property
    def interrupted(self) -> bool:
        """Return whether an interrupt ended the hold."""
        return self.hold is not None and self.hold.run.ending is Ending.INTERRUPTED

    @property
    def by_fault(self) -> bool:
        """Return whether the guard or the hardware ended it."""
        failure = self._find_failure()
        by_fault = self.refused_by_fault or self.release is not None
        return by_fault or (failure is not None and failure.run.ending is Ending.FAULT)

    @property
    def reason(self) -> str:
        """Return the result in one line."""
        off = str(self.release) if self.release else "torque off"
        if self.refusal is not None:
            return f"{self.refusal}; {off}" if self.release else self.refusal
        failure = self._find_failure()
        if failure is not None:
            what = "sitting and lying down"
            if failure is self.hold:
                what = "holding the stand"
            elif failure is self.followed:
                what = Phase.FOLLOWING.value
            went_on = failure is self.hold and self.way_down is not None
            end = "it sat and lay down" if went_on and not self.release else off
            return f"{what} failed: {failure.reason}; {end}"
        parts = [self._describe_hold(self.hold)] if self.hold else []
        if self.followed:
            parts.append(f"followed its pilot for {self.followed.run.duration:.1f} s")
        parts += ["sat and lay down"] if self.way_down else []
        if self.hand_over:
            parts.append("handed over under torque")
        else:
            parts.append(off if self.way_down or self.release else "torque off where it stood")
        return ", ".join(parts)

    @staticmethod
    def _describe_hold(hold: Step) -> str:
        return f"held for {hold.run.duration:.1f} s" if hold.run.duration else "released at once"

    def figures(self) -> AfterFigures:
        """Return the figures under report.json's keys."""
        down = self.way_down
        make = partial(
            AfterFigures,
            succeeded=self.succeeded,
            reason=self.reason,
            held_s=self.hold.run.duration if self.hold else 0.0,
            way_down_s=down and down.run.duration,
            hand_over=self.hand_over and self.hand_over.figures(),
        )
        return down.outcome.figures(make) if down and down.outcome else make()

    def _find_failure(self) -> Step | None:
        steps = (step for step in (self.hold, self.followed, self.way_down) if step is not None)
        return next((step for step in steps if not step.is_done), None)
