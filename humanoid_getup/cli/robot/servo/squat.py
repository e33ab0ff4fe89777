"""`getup servo squat`: bends and stretches the legs of a robot that is held."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from rich.console import Console

from drivers.dynamixel.diagnostics import name_of
from drivers.errors import SetupError
from drivers.service.servos.guarded_motion import MovedServos, choose_servos
from drivers.service.servos.waypoints import WaypointController, WaypointRun, move_through
from drivers.terminal_keys import StopKey
from humanoid_getup.cli.options.servo import SquatRobot
from humanoid_getup.cli.robot.servo.amperes import describe_current, is_estimated
from humanoid_getup.cli.robot.servo.opening import print_end
from humanoid_getup.cli.shared.console import console_for, phase
from humanoid_getup.cli.shared.exit_codes import DID_IT, DID_NOT_STAND, HARDWARE_FAULT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.prompt import is_confirmed
from humanoid_getup.jobs.inputs import load_robot, name_ports
from humanoid_getup.jobs.pose_robot import Squats
from robots import Robot
from robots.body.overlap import find_overlaps
from robots.kinematics import place_postures
from robots.quaternion import Array

LAG = 8.0  # degrees from its target within which a joint with little torque followed
STEPS = 20  # postures that are looked at on the way from where the robot is to its stance
HELD = "is the robot held upright, its feet free in the air?"


@dataclass(frozen=True, kw_only=True)
class SquatResult:
    """How a robot bent its legs, for JSON."""

    neck_share: float
    """Height of the neck in the squat, over that of the stance."""
    worst_joint: str
    """Joint that was farthest from its target."""
    worst_deg: float
    """How far it was [°]."""
    peak_current_a: float
    current_is_estimated: bool
    """Whether a servo has no sensor for it, only for its load."""
    followed: bool


def squat(command: SquatRobot) -> int:
    """Move a held robot to its stance, into a squat and back; 0 if its joints follow."""
    console, robot = console_for(command), load_robot(command)
    servos = choose_servos(robot, name_ports(robot, command.port), (), command.torque_limit)
    with phase("looking for a squat"):
        bent, _ = Squats(robot).find(0.01 * command.height)
    if not is_confirmed(console, HELD, yes=command.yes):
        console.print("nothing moved")
        return DID_NOT_STAND
    stance = robot.standing.joint_pos
    waypoints = np.array([stance, bent.joint_pos, stance])

    def make(start: Array) -> WaypointController:
        _check_way(robot, start)
        speed = math.radians(command.speed)
        return WaypointController(robot, waypoints, speed=speed, torque_limit=servos.torque_limit)

    guard = servos.make_guard()
    with StopKey(guard.stop):
        done = move_through(guard, make, realtime=True)
    result = _describe(servos, done, bent.neck_share)
    write_json(result, command)
    print_end(done.report, console)
    if not done.is_whole:
        return HARDWARE_FAULT
    _print(servos, result, console)
    return DID_IT if result.followed else DID_NOT_STAND


def _check_way(robot: Robot, start: Array) -> None:
    """Refuse a straight way to the stance on which parts of the robot would collide.

    Raises:
        SetupError: naming the first two that would.
    """
    standing, model = robot.standing, robot.spec().compile()
    shares = np.linspace(0.0, 1.0, STEPS)[:, np.newaxis]
    angles = start + shares * (standing.joint_pos - start)
    rows = place_postures(robot, model, standing.position, standing.orientation, angles)
    usual = find_overlaps(model, rows[-1]).keys()
    for row in rows[1:]:
        if touching := find_overlaps(model, row).keys() - usual:
            first, other = (model.body(body).name for body in min(touching))
            raise SetupError(
                f"{first} and {other} would touch on the way to the stance: bring the robot nearer "
                "to it by hand"
            )


def _describe(servos: MovedServos, done: WaypointRun, neck_share: float) -> SquatResult:
    """Describe a run; joints must have been near their targets in the squat and after it."""
    errors = np.degrees([np.abs(a.wanted - a.reached) for a in done.arrivals])
    errors = errors.reshape(-1, servos.robot.n)
    farthest = errors.max(axis=0, initial=0.0)
    worst = int(farthest.argmax())
    return SquatResult(
        neck_share=neck_share,
        worst_joint=servos.robot.joint_names[worst],
        worst_deg=float(farthest[worst]),
        peak_current_a=float(max((a.current.max() for a in done.arrivals), default=0.0)),
        current_is_estimated=any(map(is_estimated, servos.robot.joints)),
        followed=done.is_whole and bool((farthest < LAG).all()),
    )


def _print(servos: MovedServos, result: SquatResult, console: Console) -> None:
    worst = servos.robot.joints[servos.robot.joint_names.index(result.worst_joint)]
    state = "[bold green]followed[/]" if result.followed else "[bold red]did not follow[/]"
    peak = describe_current(result.peak_current_a, estimated=result.current_is_estimated)
    console.print(
        f"{state}: squat to {100.0 * result.neck_share:.0f} % of the standing height and back; "
        f"{name_of(worst)} was farthest from its target, by {result.worst_deg:.1f}°; up to "
        f"{peak}; torque is off"
    )
