"""Collisions of a posture with the ground, an obstacle or the robot itself."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np

from humanoid_getup.scenes.scene import Scene
from robots import Posture, Robot
from robots.ground import GROUND
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True)
class Tolerances:
    """How deep geoms may penetrate each other before it counts as a collision.

    A robot at rest sinks into what it lies on: contacts are soft. The penetrations of the
    start and the goal are permitted on top, geom pair by geom pair, up to ``resting``.
    """

    ground: float = 0.003
    """[m]"""
    body: float = 0.001
    """Of the robot into itself and into obstacles [m]."""
    resting: float = 0.006
    """Largest penetration of a start or goal [m]."""
    limit: float = 0.05
    """Furthest that a start or goal may be beyond a joint limit [rad]."""
    max_lift: float = 0.10
    """Furthest that a limb may push the robot up from its planned height [m]."""


class CollisionChecker:
    """The FAILURE test of [Lin12], section 4.2.2, on the compiled scene.

    Departure from the paper: a robot on a floor that turns over or presses a limb
    down is lifted by that limb. So a posture that reaches into the ground at its planned
    height is raised until it rests on it, by ``max_lift`` at most.
    """

    def __init__(self, robot: Robot, scene: Scene, tolerances: Tolerances | None = None) -> None:
        self.robot, self.scene = robot, scene
        self.tolerances = tolerances or Tolerances()
        self.checks = 0
        """Postures checked so far."""
        self._model = scene.compile(robot)
        self._data = mujoco.MjData(self._model)
        layout = robot.layout(self._model)
        root = layout.root_qpos + np.arange(7)
        self._address = np.concatenate([root, layout.qpos])
        self._qpos = self._data.qpos
        self._ground = self._model.geom(GROUND).id
        self._obstacles = [self._model.geom(obstacle.name).id for obstacle in scene.obstacles]
        self.reset()

    def reset(self) -> None:
        """Forget the permitted penetrations, and tighten all constraints."""
        count = self._model.ngeom
        self._rest = np.full((count, count), self.tolerances.body)
        self._rest[self._ground, :] = self._rest[:, self._ground] = self.tolerances.ground
        self.loosen(0.0)

    def loosen(self, looseness: float) -> None:
        """Lower the ground, shrink the obstacles and let the robot sink into itself.

        At 0 the constraints are strict. At 1 there are none: the ground is a standing robot's
        height lower, the obstacles have no radius, and limbs pass through each other.
        """
        self.looseness = looseness
        drop = looseness * self.robot.standing_neck_height
        self._allowed = self._rest + drop
        self._limit = self._allowed.copy()
        self._limit[self._ground, :] += self.tolerances.max_lift
        self._limit[:, self._ground] += self.tolerances.max_lift
        for geom, obstacle in zip(self._obstacles, self.scene.obstacles, strict=True):
            size = obstacle.sweep((1.0 - looseness) * obstacle.radius)
            self._model.geom_size[geom, : len(size)] = size

    def allow(self, posture: Posture) -> str:
        """Permit every posture the penetrations of this one, which is at rest.

        Returns:
            Why the posture itself is not valid; empty if it is.
        """
        problems = self._check_limits(posture)
        for (a, b), depth in self._depths(posture).items():
            if depth > self.tolerances.resting:
                problems.append(
                    f"{self._name(a)} is {1e3 * depth:.1f} mm inside {self._name(b)}, "
                    f"expected at most {1e3 * self.tolerances.resting:.1f} mm"
                )
            else:
                # A quarter of a millimeter on top: the neighbors must pass too.
                depth = max(self._rest[a, b], depth + 0.25e-3)
                self._rest[a, b] = self._rest[b, a] = depth
        self.loosen(self.looseness)
        return "; ".join(problems)

    def is_free(self, configuration: Array) -> bool:
        """Return whether a posture collides with nothing, raised onto the ground if need be.

        It is given as position, orientation and joint angles in a row, (7 + n,).
        """
        self._place(configuration)
        if self._data.ncon == 0:
            return True
        contact = self._data.contact
        pair = contact.geom
        if (contact.dist + self._limit[pair[:, 0], pair[:, 1]]).min() < 0.0:
            return False
        return len(self._obstacles) == 0 or self._is_free_when_lifted(configuration)

    def lift(self, configuration: Array) -> float:
        """Compute how far a posture (7 + n,) must be raised to rest on the ground [m]."""
        self._place(configuration)
        contact = self._data.contact
        depth = -contact.dist - self._allowed[contact.geom[:, 0], contact.geom[:, 1]]
        grounded = np.any(contact.geom == self._ground, axis=1)
        return float(np.max(depth[grounded], initial=0.0))

    def _is_free_when_lifted(self, configuration: Array) -> bool:
        raised = configuration.copy()
        raised[2] += self.lift(configuration)
        self._place(raised)
        contact = self._data.contact
        # The lift leaves the deepest point at its permitted depth, but for rounding.
        slack = self._allowed[contact.geom[:, 0], contact.geom[:, 1]] + 1e-9
        return bool(np.all(contact.dist + slack >= 0.0))

    def _place(self, configuration: Array) -> None:
        self._qpos[self._address] = configuration
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_collision(self._model, self._data)
        self.checks += 1

    def _depths(self, posture: Posture) -> dict[tuple[int, int], float]:
        """Measure the penetration of each pair of geoms in contact [m], the world's geom last."""
        self._place(_to_configuration(posture))
        depths: dict[tuple[int, int], float] = {}
        contact = self._data.contact
        for (a, b), distance in zip(contact.geom.tolist(), contact.dist, strict=True):
            pair = (b, a) if self._model.geom_bodyid[a] == 0 else (a, b)
            depths[pair] = max(depths.get(pair, -np.inf), -float(distance))
        return depths

    def _check_limits(self, posture: Posture) -> list[str]:
        slack = self.tolerances.limit
        return [
            f"joint '{joint.name}' is {angle:+.3f} rad, "
            f"expected [{joint.lower:+.3f}, {joint.upper:+.3f}] rad"
            for joint, angle in zip(self.robot.joints, posture.joint_pos, strict=True)
            if not joint.lower - slack <= angle <= joint.upper + slack
        ]

    def _name(self, geom: int) -> str:
        name = self._model.geom(geom).name
        return f"'{name}'" if name else f"geom {geom}"


def _to_configuration(posture: Posture) -> Array:
    return np.concatenate([posture.position, posture.orientation, posture.joint_pos])
