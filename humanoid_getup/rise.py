"""The main job: measure a fallen robot, plan its rise, play it, judge the stand."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from drivers import Command, Ending, GuardLimits, RunReport, SafetyGuard, State, Twin, run
from humanoid_getup.ground import lowest_point
from humanoid_getup.motion import Motion
from humanoid_getup.player import MotionPlayer
from humanoid_getup.rise_plan import RisePlan
from humanoid_getup.rising import RisePlanner
from humanoid_getup.stage import Stage, place
from humanoid_getup.standing import HOLD_TIME
from humanoid_getup.watch import Watch, Watched
from robots import Posture, Robot, rotation

REST_TIME = 0.8  # s without motion, limp, before the posture is measured
REST_SPEED = 0.1  # rad/s of any joint or the torso, a few steps of the sensors
MAX_SETTLE = 10.0  # s
MAX_DROP = 0.3  # m over the ground that a start may hang
SINKING = 0.0005  # m that a resting robot presses into the ground
HOLD = HOLD_TIME + 1.5  # s after the motion; a robot may sway before its stand begins
MAX_INTRUSION = 0.005  # m of the ground that a start may reach into


class StartError(ValueError):
    """A start posture cannot be risen from."""


@dataclass(frozen=True, kw_only=True)
class Rise:
    """How one rise went, from the lying posture to the judged stand."""

    robot: Robot
    start_class: str
    plan: RisePlan
    run: RunReport | None
    """None when there was nothing to play."""
    watched: Watched | None

    @property
    def stood(self) -> bool:
        """Tell whether the robot ended in a held stand."""
        finished = self.run is not None and self.run.ending is Ending.DONE
        return finished and self.watched is not None and self.watched.stand.stood

    @property
    def reason(self) -> str:
        """Return in one line why the rise ended as it did."""
        if self.run is None or self.watched is None:
            return self.plan.reason
        if self.stood:
            return "held stand"
        if self.run.ending is not Ending.DONE:
            return self.run.reason
        return f"fell: held {self.watched.stand.hold_time:.1f} s, needed {HOLD_TIME:.1f} s"

    def record(self) -> dict[str, Any]:
        """Return the figures of the rise under report.json's keys."""
        watched, plan = self.watched, self.plan
        connection = plan.connection
        record: dict[str, Any] = {
            "start_class": self.start_class,
            "planned": plan.planned,
            "stood": self.stood,
            "reason": self.reason,
            "stand_time_s": watched.stand.start_time if watched and self.stood else None,
            "hold_s": watched.stand.hold_time if watched else 0.0,
            "plan_s": plan.plan_s,
            "filter_s": plan.filter_s,
            "rehearsals": plan.rehearsals,
            "rehearsal_rounds": plan.rounds,
            "robust": None if math.isnan(plan.robust) else plan.robust,
            "connection": connection.motion.name if connection else None,
            "strategy": connection.motion.strategy if connection else None,
            "attempts": 1 if self.run else 0,
            "period_s": self.run.period if self.run else None,
            "overruns": self.run.overruns if self.run else 0,
            "clips": self.run.clips.total if self.run else 0,
            "clips_by_joint": self.run.clips.describe(self.robot) if self.run else [],
        }
        if watched:
            record |= {
                "peak_torque_nm": watched.peak_torque,
                "peak_velocity_rad_s": watched.peak_velocity,
                "torque_use": watched.torque_use,
                "rms_torque_nm": watched.rms_torque,
                "self_collisions": watched.self_collisions,
                "ground_penetrations": watched.ground_penetrations,
                "limit_violations": watched.limit_violations,
            }
        return record


def rise(
    twin: Twin,
    planner: RisePlanner,
    start: Posture,
    start_class: str,
    rng: np.random.Generator,
    *,
    realtime: bool = False,
) -> Rise:
    """Get a twin up from a posture: settle, measure, plan, play, judge.

    Raises:
        StartError: if the start reaches into the ground.
    """
    check_start(planner.stage, start)
    limit = planner.options.torque_limit
    guard = SafetyGuard(twin, GuardLimits.of(twin.robot, torque_limit=limit))
    twin.place(start)
    measured = estimate_posture(planner.stage, settle(guard))
    plan = planner.plan(measured, rng)
    if plan.motion is None:
        return Rise(robot=twin.robot, start_class=start_class, plan=plan, run=None, watched=None)
    report, watched = play(guard, twin, plan.motion, limit, realtime=realtime)
    return Rise(robot=twin.robot, start_class=start_class, plan=plan, run=report, watched=watched)


def play(
    guard: SafetyGuard,
    twin: Twin,
    motion: Motion,
    torque_limit: float | None,
    *,
    realtime: bool = False,
) -> tuple[RunReport, Watched]:
    """Play a motion on a twin through loop and guard and watch how it ends.

    Raises:
        KeyboardInterrupt: once the robot is limp, if somebody interrupted.
    """
    player = MotionPlayer(twin.robot, motion, hold=HOLD, torque_limit=torque_limit)
    watch = Watch(twin, torque_limit)
    longest = motion.duration + HOLD + 5.0
    report = run(player, guard, max_time=longest, realtime=realtime, on_cycle=watch)
    if report.ending is Ending.INTERRUPTED:
        raise KeyboardInterrupt
    return report, watch.conclude()


def check_start(stage: Stage, start: Posture) -> None:
    """Refuse a start that reaches into the ground or hangs high over it.

    Raises:
        StartError: saying how far.
    """
    lowest = lowest_point(stage.model, place(stage.robot, stage.model, start))
    if lowest > MAX_DROP:
        raise StartError(
            f"start posture hangs {lowest:.3g} m over the ground, allowed {MAX_DROP} m: "
            f"lower its position z by {lowest:.3g} m"
        )
    if lowest < -MAX_INTRUSION:
        raise StartError(
            f"start posture reaches {-lowest * 1000:.1f} mm into the ground, allowed "
            f"{MAX_INTRUSION * 1000:.0f} mm: raise its position z by {-lowest:.4f} m"
        )


def settle(guard: SafetyGuard) -> State:
    """Let the robot lie limp until it is still; return the last measurement.

    Raises:
        StartError: if it does not come to rest.
    """
    still, wanted = 0, round(REST_TIME / guard.period)
    with guard:
        for _ in range(round(MAX_SETTLE / guard.period)):
            guard.write(Command.limp(guard.robot.n))
            state = guard.read()
            speed = max(np.abs(state.joint_vel).max(), np.abs(state.gyro).max())
            still = still + 1 if speed < REST_SPEED else 0
            if still == wanted:
                return state
    raise StartError(
        f"the robot does not come to rest: {speed:.2f} rad/s after {MAX_SETTLE:g} s, "
        f"allowed {REST_SPEED} rad/s for {REST_TIME:g} s"
    )


def estimate_posture(stage: Stage, state: State) -> Posture:
    """Estimate where a lying robot is: it touches the ground; place and heading are free.

    Angles, IMU orientation and the way the IMU sits in the torso give the rest.
    """
    robot: Robot = stage.robot
    joint_pos = np.clip(state.joint_pos, robot.lower, robot.upper)
    imu_in_torso = stage.model.site(robot.imu_site).quat
    orientation = rotation.multiply(state.orientation, rotation.inverse(imu_in_torso))
    raised = Posture(
        position=np.array([0.0, 0.0, 1.0]), orientation=orientation, joint_pos=joint_pos
    )
    lowest = lowest_point(stage.model, place(robot, stage.model, raised))
    return Posture(
        position=np.array([0.0, 0.0, 1.0 - lowest - SINKING]),
        orientation=orientation,
        joint_pos=joint_pos,
    )
