"""Start of a rise: wait until the robot is still, and estimate its posture."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from drivers import Command, DriverError, Fault, SafetyGuard, State
from drivers.control_loop import Pacer, prioritized
from drivers.errors import NoImuError
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from robots import Posture
from robots.ground import GROUND
from robots.kinematics import place, torso_orientation

REST_TIME = 0.8  # s without motion, torque off, before the posture is measured
REST_SPEED = 0.1  # rad/s of the torso, a few steps of the sensors
# A limp foot on an edge may tick to and fro without end, by a degree at up to 0.3 rad/s.
REST_ANGLE = REST_SPEED * REST_TIME  # rad by which any joint may move in this time
MAX_SETTLE = 10.0  # s
MAX_DROP = 0.3  # m that a start may be above the ground
SINKING = 0.0005  # m that a resting robot presses into the ground
MAX_INTRUSION = 0.005  # m that a start may reach into the ground


class StartError(ValueError):
    """The robot cannot rise from this start posture."""


class FaultedError(DriverError):
    """The guard found a fault while the robot settled."""

    def __init__(self, fault: Fault) -> None:
        super().__init__(str(fault))
        self.fault = fault


def check_start(world: World, start: Posture) -> None:
    """Check that a start is not in the ground or an obstacle, nor high above them."""
    qpos, clearance = place(world.robot, world.model, start), Clearance(world)
    slack = 0.0
    if not world.scene.is_flat:  # a robot that touches a wall is not to be put on top of it
        allowed = _allow_intrusion(world.scene)
        _check_intrusion(clearance.measure_overlaps(qpos), allowed)
        slack = max(allowed.values())
    resting = clearance.rest_where(qpos, -slack)
    root = world.robot.layout(world.model).root_qpos
    lowest = float(qpos[root + 2] - resting[root + 2]) - slack
    if lowest > MAX_DROP:
        raise StartError(
            f"start posture is {lowest:.3g} m above the ground, expected at most {MAX_DROP} m: "
            f"lower its position z by {lowest:.3g} m"
        )
    if lowest < -MAX_INTRUSION and world.scene.is_flat:
        raise StartError(
            f"start posture reaches {-lowest * 1000:.1f} mm into the ground, expected at most "
            f"{MAX_INTRUSION * 1000:.0f} mm: raise its position z by {-lowest:.4f} m"
        )


def _allow_intrusion(scene: Scene) -> dict[str, float]:
    """Return how deep a start may reach into the ground and each obstacle [m]."""
    sink = {obstacle.name: obstacle.surface.deepest_sink for obstacle in scene.obstacles}
    sink[GROUND] = scene.surface.deepest_sink
    return {name: MAX_INTRUSION + depth for name, depth in sink.items()}


def _check_intrusion(depths: dict[str, float], allowed: dict[str, float]) -> None:
    problems = [
        f"{1000 * depth:.1f} mm into {'the ground' if name == GROUND else f'obstacle {name!r}'}, "
        f"expected at most {1000 * allowed[name]:.0f} mm"
        for name, depth in depths.items()
        if depth > allowed[name]
    ]
    if problems:
        raise StartError(f"start posture reaches {'; '.join(problems)}")


def settle(guard: SafetyGuard, pacer: Pacer | None = None) -> State:
    """Wait, torque off, until the robot is still; return the last measurement.

    Without an IMU, its joints alone tell.

    All times are the backend's own, so it works on a twin that runs faster than real time, too.

    The guard is connected here, and closed afterwards. A backend that does not pace itself needs
    a pacer.

    Raises:
        StartError: if it does not come to rest.
        FaultedError: if the guard finds a fault meanwhile.
    """
    slack = 0.5 * guard.period  # a clock adds up periods: half of one decides
    recent = deque[State]()
    with guard, prioritized(guard, realtime=pacer is not None):
        begin = guard.read().time
        while True:
            guard.write(Command.limp(guard.robot.n))
            if guard.fault is not None:  # such as a clock that stands still
                raise FaultedError(guard.fault)
            if pacer:
                pacer.wait()
            state = guard.read()
            recent.append(state)
            while recent and state.time - recent[0].time > REST_TIME + slack:
                recent.popleft()
            if state.time - recent[0].time > REST_TIME - slack and _is_still(recent):
                return state
            if state.time - begin > MAX_SETTLE - slack:
                break
    angles = np.ptp([s.joint_pos for s in recent], axis=0)
    worst = guard.robot.joint_names[int(angles.argmax())]
    text = (
        f"the robot does not come to rest: in the last {REST_TIME:g} of {MAX_SETTLE:g} s joint "
        f"'{worst}' moved by {angles.max():.2f} rad, expected at most {REST_ANGLE:.2f} rad"
    )
    if all(s.has_imu for s in recent):
        speed = max(float(np.abs(s.gyro).max()) for s in recent)
        text += f", and the torso turned at up to {speed:.2f} rad/s, expected at most {REST_SPEED} "
        text += "rad/s"
    raise StartError(text)


def _is_still(recent: Iterable[State]) -> bool:
    """Return whether neither the torso turned nor any joint moved in some measurements."""
    if any(np.abs(state.gyro).max(initial=0.0) >= REST_SPEED for state in recent):
        return False
    return bool(np.ptp([state.joint_pos for state in recent], axis=0).max() <= REST_ANGLE)


def estimate_posture(world: World, state: State, placement: Placement | None = None) -> Posture:
    """Estimate the posture of a lying robot from its joint angles and its IMU's orientation.

    It lies on what is under it. Without a placement, its place and the zero of its heading are
    arbitrary, which is enough on flat ground alone.

    Raises:
        NoImuError: if the orientation was not measured.
    """
    robot = world.robot
    if not state.has_imu:
        raise NoImuError(robot.name)
    orientation = torso_orientation(robot, world.model, state.orientation)
    raised = Posture(
        position=np.array([0.0, 0.0, 1.0]),
        orientation=orientation if placement is None else placement.turn(orientation),
        joint_pos=np.clip(state.joint_pos, robot.lower, robot.upper),
    )
    if placement is not None:
        raised = replace(raised, position=np.array([placement.x, placement.y, 1.0]))
    resting = Clearance(world).rest(place(robot, world.model, raised), -SINKING)
    height = float(resting[robot.layout(world.model).root_qpos + 2])
    return replace(raised, position=np.array([*raised.position[:2], height]))
