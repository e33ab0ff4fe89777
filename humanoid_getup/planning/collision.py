"""Collisions of a posture with the ground, an obstacle or the robot itself."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from numpy.typing import NDArray

from humanoid_getup.motions.motion_database import KeyPosture
from humanoid_getup.scenes.ground import Ground
from humanoid_getup.scenes.obstacle import Crossings
from humanoid_getup.scenes.scene import FLAT_SCENE, Scene
from robots import Posture, Robot
from robots.ground import GROUND
from robots.quaternion import Array

ROUND = (mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_SPHERE)
CORNERS = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))


class FieldDepth:
    """Measures how far points on the robot's geoms are under the ground.

    Contacts with a height field push a body out by the nearest side of a cell, which may be any;
    how far it must be raised, they do not tell.
    """

    def __init__(self, model: mujoco.MjModel, geoms: NDArray[np.intp], ground: Ground) -> None:
        """Take the corners of boxes, and of the boxes about other geoms' axes and ends."""
        self._ground = ground
        points, radii, owners = [], [], []
        for geom in geoms.tolist():
            size = model.geom_aabb[geom, 3:].copy()
            center, radius = model.geom_aabb[geom, :3], 0.0
            if int(model.geom_type[geom]) in ROUND:
                radius = float(model.geom_size[geom, 0])
                size -= radius
            corners = np.unique(center + size * CORNERS, axis=0)
            points.append(corners)
            radii.append(np.full(len(corners), radius))
            owners.append(np.full(len(corners), geom))
        self._points, self._radius = np.concatenate(points), np.concatenate(radii)
        self.geom = np.concatenate(owners)
        """Geom of each point, (P,)."""

    def measure(self, data: mujoco.MjData) -> Array:
        """Measure the depth of each point under the ground [m], (P,); negative above it."""
        turn = data.geom_xmat[self.geom].reshape(-1, 3, 3)
        at = data.geom_xpos[self.geom] + np.einsum("pij,pj->pi", turn, self._points)
        return self._ground.height(at[:, 0], at[:, 1]) - at[:, 2] + self._radius


STEEPEST_SUPPORT = 0.5  # vertical part of the normal of a face that can lift a robot
ROUNDING = 1e-6  # m by which a robot that was raised is as deep as is permitted
FIELD_LIFTS, FIELD_STEP = 6, 0.005  # times that a robot is raised from a field, and by how much
LIMB_DEPTH = 0.15  # m by which limbs may be in each other when the constraints are loosest


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """How deep geoms may penetrate each other before it counts as a collision.

    A robot at rest sinks into what it lies on: contacts are soft. The penetrations of the
    start and the goal are permitted on top, geom pair by geom pair, up to ``resting``. What is
    soft by itself, such as a mattress, may be penetrated by as much more as it sinks.
    """

    world: float = 0.003
    """Of the robot into the ground and into obstacles [m]."""
    body: float = 0.001
    """Of the robot into itself [m]."""
    resting: float = 0.006
    """Largest penetration of a start or goal [m]."""
    limit: float = 0.05
    """Furthest that a start or goal may be beyond a joint limit [rad]."""
    max_lift: float = 0.10
    """Furthest that a limb may push the robot up from its planned height [m]."""


@dataclass(frozen=True, kw_only=True)
class Collision:
    """A part of the robot that is inside another, or inside something in the scene."""

    part: str
    """Name of the robot's geom."""
    into: str
    """Name of the other geom."""
    depth: float
    """[m]"""
    geoms: tuple[int, int]

    def __str__(self) -> str:
        return f"{self.part} is {1e3 * self.depth:.1f} mm inside {self.into}"


class CollisionChecker:
    """The FAILURE test of [Lin12], section 4.2.2, on the compiled scene.

    Departure from the paper: a robot on a floor that turns over or presses a limb
    down is lifted by that limb. So a posture that reaches into the ground, or into the top of an
    obstacle, at its planned height is raised until it rests on it, by ``max_lift`` at most.
    """

    def __init__(self, robot: Robot, scene: Scene, tolerances: Tolerances | None = None) -> None:
        self.robot, self.scene = robot, scene
        self.tolerances = tolerances or Tolerances()
        self.checks = 0
        """Postures checked so far."""
        self._model = scene.compile(robot)
        self._data = mujoco.MjData(self._model)
        names = [self._model.geom(geom).name for geom in range(self._model.ngeom)]
        self._names = [f"'{name}'" if name else f"geom {i}" for i, name in enumerate(names)]
        layout = robot.layout(self._model)
        root = layout.root_qpos + np.arange(7)
        self._address = np.concatenate([root, layout.qpos])
        self._qpos = self._data.qpos
        self.fixed = {0, layout.torso}
        """Bodies that are no limb: world and torso."""
        self.limb_count = int(np.sum(self._model.body_parentid == layout.torso))
        self._obstacles = [self._model.geom(obstacle.name).id for obstacle in scene.obstacles]
        self._crossings = Crossings(self._model)
        self._ground = self._model.geom(GROUND).id
        self._is_world = self._model.body_weldid[self._model.geom_bodyid] == 0
        self._field, self._lifts = None, 2 if self._obstacles else 1
        if not scene.ground.is_plane:
            own = np.flatnonzero(~self._is_world)
            self._field = FieldDepth(self._model, own, scene.ground)
            self._lifts = FIELD_LIFTS
        self.reset()

    @property
    def model(self) -> mujoco.MjModel:
        """Return the compiled scene; its obstacles shrink when the constraints are loosened."""
        return self._model

    def reset(self) -> None:
        """Forget the permitted penetrations, and tighten all constraints."""
        count, world = self._model.ngeom, self._is_world
        sink = np.zeros(count)
        sink[self._ground] = self.scene.surface.deepest_sink
        sink[self._obstacles] = [o.surface.deepest_sink for o in self.scene.obstacles]
        self._sink = sink[:, None] + sink
        self._rest = np.full((count, count), self.tolerances.body)
        self._rest[world, :] = self._rest[:, world] = self.tolerances.world
        self._rest += self._sink
        self.loosen(0.0)

    def loosen(self, looseness: float) -> None:
        """Lower the ground, shrink the obstacles and let the robot sink into itself.

        At 0 the constraints are strict. At 1 the ground is a standing robot's height lower, limbs
        pass through each other, and of obstacles what has no radius is left: a rectangle, a line.
        """
        self.looseness = looseness
        self._allowed = self._rest + looseness * LIMB_DEPTH
        self._allowed[self._is_world, :] = self._rest[self._is_world, :]
        self._allowed[:, self._is_world] = self._rest[:, self._is_world]
        lower = looseness * self.robot.standing_neck_height
        self._allowed[self._ground, :] += lower
        self._allowed[:, self._ground] += lower
        for geom, obstacle in zip(self._obstacles, self.scene.obstacles, strict=True):
            size = obstacle.sweep((1.0 - looseness) * obstacle.radius)
            self._model.geom_size[geom, : len(size)] = size

    def allow(self, posture: Posture) -> str:
        """Permit the penetrations of this posture, which is at rest, in all postures.

        Returns:
            Why the posture itself is not valid; empty if it is.
        """
        problems = self._check_limits(posture)
        for found in self._find_contacts(to_configuration(posture)):
            a, b = found.geoms
            resting = self.tolerances.resting + float(self._sink[a, b])
            if found.depth > resting:
                problems.append(f"{found}, expected at most {1e3 * resting:.1f} mm")
            else:
                # A quarter of a millimeter on top: the neighbors must pass too.
                depth = max(self._rest[a, b], found.depth + 0.25e-3)
                self._rest[a, b] = self._rest[b, a] = depth
        self.loosen(self.looseness)
        return "; ".join(problems)

    def is_free(self, configuration: Array) -> bool:
        """Return whether a posture is free of collisions, if necessary raised to rest on a contact.

        It is given as position, orientation and joint angles in a row, (7 + n,).
        """
        lift, is_free = self._raise(configuration)
        return is_free and lift <= self.tolerances.max_lift

    def lift(self, configuration: Array) -> float:
        """Compute how far a posture (7 + n,) must be raised to rest on what is under it [m]."""
        return self._raise(configuration)[0]

    def find_collisions(self, configuration: Array) -> list[Collision]:
        """Find the collisions of a posture (7 + n,), raised if necessary; the deepest first."""
        lift, is_free = self._raise(configuration)
        if is_free and lift <= self.tolerances.max_lift:
            return []
        raised = configuration.copy()
        raised[2] += min(lift, self.tolerances.max_lift)
        contacts = self._find_contacts(raised)
        deep = [c for c in contacts if c.depth > self._allowed[c.geoms] + 1e-9]
        return sorted(deep, key=lambda c: -c.depth)

    def _raise(self, configuration: Array) -> tuple[float, bool]:
        """Raise a posture until it rests; return by how much, and whether it is free then."""
        lift, raised = 0.0, configuration.copy()
        for _ in range(self._lifts):
            self._place(raised)
            step, may_rise = self._measure_lift(ROUNDING if lift else 0.0)
            lift += step
            if step == 0.0 or not may_rise or lift > self.tolerances.max_lift:
                return lift, may_rise
            raised[2] = configuration[2] + lift
        return lift, self._lifts == 1

    def _measure_lift(self, slack: float) -> tuple[float, bool]:
        """Measure how far the placed robot must be raised, and whether that can free it."""
        if self._obstacles and len(self._crossings.find(self._data)):
            return 0.0, False
        if self._data.ncon == 0:
            return 0.0, True
        excess = self._measure_excess()
        is_deep = excess > slack
        if not is_deep.any():
            return 0.0, True
        if self._field is None:
            excess, up = excess[is_deep], self._measure_support()[is_deep]
            lifts = up >= STEEPEST_SUPPORT
            return float(np.max(excess[lifts] / up[lifts], initial=0.0)), bool(lifts.all())
        under = self._field.measure(self._data) - self._allowed[self._field.geom, self._ground]
        touches_field = (self._data.contact.geom[is_deep] == self._ground).any(axis=1)
        return max(float(under.max()), FIELD_STEP), bool(touches_field.all())

    def _place(self, configuration: Array) -> None:
        self._qpos[self._address] = configuration
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        self.checks += 1

    def _measure_excess(self) -> Array:
        """Measure the depth of each contact beyond its tolerance [m], (ncon,)."""
        contact = self._data.contact
        pair = contact.geom
        return -(contact.dist + self._allowed[pair[:, 0], pair[:, 1]])

    def _measure_support(self) -> Array:
        """Measure the vertical component of each contact's normal on the robot, (ncon,)."""
        contact = self._data.contact
        is_world = self._is_world[contact.geom]
        up = np.where(is_world[:, 0], contact.frame[:, 2], -contact.frame[:, 2])
        return np.where(is_world.any(axis=1), up, -1.0)

    def _find_contacts(self, configuration: Array) -> list[Collision]:
        """Find the pairs of geoms in contact, each with its largest depth, the robot's first."""
        self._place(configuration)
        depths: dict[tuple[int, int], float] = {}
        contact = self._data.contact
        for geoms, distance in zip(contact.geom.tolist(), contact.dist, strict=True):
            pair: tuple[int, int] = tuple(sorted(geoms, key=lambda geom: self._is_world[geom]))
            depths[pair] = max(depths.get(pair, -np.inf), -float(distance))
        for capsule, box in self._crossings.find(self._data).tolist():
            depths[capsule, box] = self._crossings.depth(capsule)
        return [
            Collision(part=self._names[a], into=self._names[b], depth=depth, geoms=(a, b))
            for (a, b), depth in depths.items()
        ]

    def find_limb(self, geom: int) -> int:
        """Return the child of the torso that carries a geom; the torso or the world, if none."""
        body, parent = int(self._model.geom_bodyid[geom]), self._model.body_parentid
        while body not in self.fixed and int(parent[body]) not in self.fixed:
            body = int(parent[body])
        return body

    def find_joints(self, limb: int) -> NDArray[np.intp]:
        """Find the joints of a limb, as indices in the robot's order."""
        layout, model = self.robot.layout(self._model), self._model
        bodies = model.dof_bodyid[layout.dof].tolist()
        return np.array([k for k, body in enumerate(bodies) if self._is_within(body, limb)], int)

    def _is_within(self, body: int, limb: int) -> bool:
        while body > limb:  # a body's number is greater than its parent's
            body = int(self._model.body_parentid[body])
        return body == limb

    def _check_limits(self, posture: Posture) -> list[str]:
        slack = self.tolerances.limit
        return [
            f"joint '{joint.name}' is {angle:+.3f} rad, "
            f"expected [{joint.lower:+.3f}, {joint.upper:+.3f}] rad"
            for joint, angle in zip(self.robot.joints, posture.joint_pos, strict=True)
            if not joint.lower - slack <= angle <= joint.upper + slack
        ]


def to_configuration(posture: Posture) -> Array:
    """Put position, orientation and joint angles of a posture in a row, (7 + n,)."""
    return np.concatenate([posture.position, posture.orientation, posture.joint_pos])


RAISED = np.array([0.0, 0.0, 10.0])  # m, clear of the ground


def check_keys(robot: Robot, keys: Sequence[KeyPosture]) -> None:
    """Check that key postures are within the joint limits and free of self-collision.

    Raises:
        ValueError: naming what is wrong with each posture that is not.
    """
    if not keys:
        return
    checker, problems = CollisionChecker(robot, FLAT_SCENE), list[str]()
    for key in keys:
        checker.reset()
        if key.posture.joint_pos.shape != (robot.n,):
            shape = key.posture.joint_pos.shape
            problems.append(f"posture {key.name}: joint_pos is {shape}, expected ({robot.n},)")
        elif found := checker.allow(replace(key.posture, position=RAISED)):
            problems.append(f"posture {key.name}: {found}")
    if problems:
        raise ValueError("; ".join(problems))
