"""World changes: differences of a rise's world from the one of its plan."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import mujoco
import numpy as np

from humanoid_getup.scenes.ground import Slope
from humanoid_getup.scenes.obstacle import Obstacle
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.scenes.start_region import lay_at
from humanoid_getup.scenes.surface import Surface
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import lowest_point, place
from robots.quaternion import Array

# Where a load is strapped on, in the torso's frame, as shares of the neck's height there: on OP3
# 82 mm behind and above the origin, on the back of the chest.
BACK = np.array([-0.6, 0.0, 0.6])
LOAD_SIZE = 0.02  # m, half an edge of the cube whose inertia the load has
PLATE = 2.0  # m, half an edge of the plate whose edge is a step
LIMB_SPREAD = math.radians(5.0)  # of joints that were moved after planning


@dataclass(frozen=True, kw_only=True)
class WorldChange:
    """Differences from the nominal world; none by default.

    Directions are those of a robot that lies with its head along +x, as `turn_head` lays it.
    """

    load: float = 0.0
    """Mass on the torso's back [kg]; it has no shape of its own."""
    slope: float = 0.0
    """Angle by which the ground rises towards the head [rad]."""
    step: float = 0.0
    """Height of a plate under one half of the robot [m]; its edge goes through the hips."""
    friction: float | None = None
    """Sliding friction of the ground."""
    mass: float = 1.0
    """Factor on the mass of every link."""
    com_shift: float = 0.0
    """Shift of the torso's center of mass at a right angle to the spine [m]."""
    voltage: float | None = None
    """Supply [V]."""
    strength: float = 1.0
    """Factor on torque and gain of one servo."""
    joint: str | None = None
    """The weak servo; ``None`` for a random one."""
    start_angle: float = 0.0
    """Angle by which the robot is turned after planning [rad], and its joints moved by 5 deg
    (standard deviation), before it settles."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SceneWithLoad(Scene):
    """A scene, with a load on the robot's back."""

    load: float = 0.0

    def build(self, robot: Robot) -> mujoco.MjSpec:
        """Add this scene to the robot's model."""
        spec = super().build(robot)
        if self.load:
            _add_load(spec, robot, self.load)
        return spec


def disturb_world(world: World, change: WorldChange, direction: float) -> World:
    """Build the disturbed world.

    Args:
        world: Nominal world, flat.
        change: What differs.
        direction: Direction of the step's plate, and of the center of mass in the torso [rad].
    """
    surface = world.scene.surface
    if change.friction is not None:
        surface = replace(surface, friction=change.friction)
    scene = SceneWithLoad(
        name=f"{world.scene.name}, disturbed",
        ground=Slope(angle=change.slope),
        surface=surface,
        obstacles=(make_plate(change.step, direction, surface),) if change.step else (),
        load=change.load,
    )
    disturbed = World(world.robot, scene)
    model = disturbed.model
    model.body_mass *= change.mass
    model.body_inertia *= change.mass
    torso = model.body(world.robot.torso).id
    model.body_ipos[torso] += change.com_shift * _point(direction)
    mujoco.mj_setConst(model, mujoco.MjData(model))
    return disturbed


def disturb_start(
    world: World, start: Posture, change: WorldChange, rng: np.random.Generator
) -> Posture:
    """Lay a robot, turned by `turn_head`, on disturbed ground, and let it settle.

    Args:
        world: Nominal world.
        start: Posture on flat ground.
        change: What differs.
        rng: Of the axis about which the robot is turned, and of its joints.
    """
    if change.start_angle:
        start = _disturb_posture(world, start, change.start_angle, rng)
    slope = _tilt(change.slope)
    raised = quaternion.rotate(slope, start.position) + np.array([0.0, 0.0, change.step])
    turned = quaternion.multiply(slope, start.orientation)
    return replace(start, position=raised, orientation=turned)


def turn_head(posture: Posture) -> Posture:
    """Turn and move a lying posture: its head points along +x, its root is above the origin."""
    return lay_at(posture, np.zeros(2), 0.0)


def _disturb_posture(
    world: World, start: Posture, angle: float, rng: np.random.Generator
) -> Posture:
    """Turn a robot about a random horizontal axis, move its joints, and put it on the ground."""
    robot, heading = world.robot, rng.uniform(0.0, 2.0 * math.pi)
    turn = quaternion.from_axis_angle(_point(heading), angle)
    joints = start.joint_pos + rng.normal(0.0, LIMB_SPREAD, robot.n)
    turned = replace(
        start,
        orientation=quaternion.multiply(turn, start.orientation),
        joint_pos=np.clip(joints, robot.lower, robot.upper),
    )
    lowest = lowest_point(world.model, place(robot, world.model, turned))
    return replace(turned, position=turned.position - np.array([0.0, 0.0, lowest]))


def _tilt(slope: float) -> Array:
    """Return the orientation of a ground that rises along +x by an angle [rad], (4,)."""
    return quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), -slope)


def _point(direction: float) -> Array:
    """Return the horizontal unit vector of a direction [rad], (3,)."""
    return np.array([math.cos(direction), math.sin(direction), 0.0])


def make_plate(height: float, direction: float, surface: Surface) -> Obstacle:
    """Make a plate on the half of the ground that lies in a direction [rad] from the origin."""
    return Obstacle(
        name="step",
        kind="box",
        half_size=np.array([PLATE, PLATE, 0.5 * height]),
        position=PLATE * _point(direction) + np.array([0.0, 0.0, 0.5 * height]),
        orientation=quaternion.from_yaw(direction),
        surface=surface,
    )


def _add_load(spec: mujoco.MjSpec, robot: Robot, mass: float) -> None:
    neck = float(spec.site(robot.neck_site).pos[2])
    load = spec.body(robot.torso).add_body(name="load")
    load.pos = neck * BACK
    load.mass = mass
    load.inertia = np.full(3, mass * (2.0 * LOAD_SIZE) ** 2 / 6.0)
    load.explicitinertial = True
