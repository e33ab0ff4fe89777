"""The OP3 with the shapes of a mesh model: a second body on which rises are tried.

The MuJoCo Menagerie's OP3 has convex collision meshes instead of boxes and capsules, on the same
links with the same masses. It is not part of this package: benchmarks that use it are given a
folder with its `op3.xml` and `assets/`.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, fields
from pathlib import Path

import mujoco

from robots import Robot

MODEL_FILE = "op3.xml"


@dataclass(frozen=True, kw_only=True)
class VariantRobot(Robot):
    """A robot whose model is changed in one respect."""

    change: Callable[[mujoco.MjSpec], object]
    """Changes the model that the robot's description builds."""

    def spec(self) -> mujoco.MjSpec:
        """Build the robot's model and change it."""
        spec = super().spec()
        self.change(spec)
        return spec


def vary(robot: Robot, change: Callable[[mujoco.MjSpec], object]) -> VariantRobot:
    """Make a variant of a robot."""
    own = {field.name: getattr(robot, field.name) for field in fields(robot)}
    return VariantRobot(**own, change=change)


def with_meshes(robot: Robot, folder: Path, links: Collection[str] | None = None) -> VariantRobot:
    """Give links of a robot their shapes in the mesh model of a folder; ``None`` for all links."""
    return vary(robot, lambda spec: exchange_shapes(spec, folder, links))


def exchange_shapes(
    spec: mujoco.MjSpec, folder: Path, links: Collection[str] | None = None
) -> None:
    """Replace the shapes of links by those of the mesh model; friction and stiffness stay."""
    other = mujoco.MjSpec.from_file(str(folder / MODEL_FILE))
    for mesh in other.meshes:
        file = (folder / other.meshdir / mesh.file).resolve()
        spec.add_mesh(name=mesh.name, file=str(file), scale=mesh.scale)
    for link in other.bodies:
        if link.name == "world" or (links is not None and link.name not in links):
            continue
        own = spec.body(link.name)
        for geom in own.geoms:
            spec.delete(geom)
        for shape in link.geoms:
            own.add_geom(
                type=shape.type,
                meshname=shape.meshname,
                pos=shape.pos,
                quat=shape.quat,
                size=shape.size,
            )
