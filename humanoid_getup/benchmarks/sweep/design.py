"""A design of a sweep: body, servos, torque limit, scene and the way to get up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from robots import Body, Robot, TorqueLimit, load_robot
from robots.description.other_servos import use_servos
from robots.servo import LimitMode

OWN = ""
"""Body or servos as the robot has them."""


@dataclass(frozen=True, kw_only=True)
class Design:
    """One design, and where and how it gets up."""

    body: str = OWN
    """Factors on lengths, as `Body.parse` reads them."""
    servo: str = OWN
    """Type of all servos."""
    torque_limit: float | None = None
    """[N·m]; None for stall torque."""
    scene: str = "flat"
    way: str = "plan"
    digest: str = ""
    """Checksum of the files of scene and policy, of which their names say nothing."""

    @property
    def name(self) -> str:
        """Return its name in tables: all that is not the robot's own."""
        limit = "" if self.torque_limit is None else f"{self.torque_limit!r} N·m"
        return ", ".join(filter(None, (self.body, self.servo, limit, self.scene, self.way)))


def list_designs(
    bodies: Sequence[str],
    servos: Sequence[str],
    torque_limits: Sequence[float | None],
    scenes: Sequence[str],
    ways: Sequence[str],
) -> list[Design]:
    """List all designs, those of one body together."""
    return [
        Design(body=body, servo=servo, torque_limit=limit, scene=scene, way=way)
        for body, servo, limit, scene, way in product(bodies, servos, torque_limits, scenes, ways)
    ]


def build_robot(robot: str, design: Design) -> Robot:
    """Build the robot of a design.

    Raises:
        ValueError: if it cannot have that body or those servos.
    """
    built = load_robot(robot, Body.parse(design.body))
    return use_servos(built, design.servo) if design.servo else built


def build_world(robot: str, design: Design, seed: int) -> World:
    """Build the robot of a design into its scene.

    Raises:
        ValueError: if it cannot be built, or there is no such scene.
    """
    built = build_robot(robot, design)
    return World(built, load_scene(design.scene, built, seed))


def limit_torque(design: Design, by: LimitMode | None, robot: Robot) -> TorqueLimit:
    """Return the torque limit of a design.

    Raises:
        ValueError: if its servos cannot have it.
    """
    return TorqueLimit(design.torque_limit, by).on(robot)
