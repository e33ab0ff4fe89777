"""Stage: the robot, its ghost and the scene in 3-D, and what is drawn around them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import mujoco
import numpy as np
from mjviser import ViserMujocoScene
from mjviser.conversions import merge_geoms
from scipy.spatial import ConvexHull

from humanoid_getup.reporting.film_strip import paint
from robots.body.shapes import find_hull
from robots.quaternion import Array

if TYPE_CHECKING:
    import viser

    from humanoid_getup.simulation.world import World

GHOST = "ghost/"
"""Prefix of the ghost's names."""
HIDDEN = 5  # group of geoms that are not seen
GRAVITY = 9.81  # m/s²
ARROW = 1.2  # standing neck heights, of a force as large as the robot's weight
GHOST_COLOR, GHOST_OPACITY = (90, 140, 245), 0.35
ABOVE = 0.002  # m over its contacts at which the balance is drawn
COM_RADIUS = 0.02  # of the standing neck height
BALANCED, FALLING = (40, 160, 70), (220, 50, 40)
"""Color of a center of mass over the support polygon, and beside it."""


def build_model(world: World) -> mujoco.MjModel:
    """Compile the world of a robot with its ghost.

    The positions of the ghost follow those of the robot, in the same order: (2 * nq,).
    """
    spec = world.scene.build(world.robot)
    _remove_sensors(spec)
    frame = spec.worldbody.add_frame()
    frame.attach_body(_make_ghost(world).body(world.robot.torso), GHOST, "")
    model = spec.compile()
    expected = [*_list_joints(world.model), *(GHOST + name for name in _list_joints(world.model))]
    if _list_joints(model) != expected:
        raise RuntimeError(f"joints of the stage are {_list_joints(model)}, expected {expected}")
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
    weight = world.model.body_subtreemass[world.robot.layout(world.model).torso] * GRAVITY
    length = ARROW * world.robot.standing_neck_height  # MuJoCo divides by the mean mass of a body
    model.vis.map.force = length / weight * model.stat.meanmass
    return model


def _make_ghost(world: World) -> mujoco.MjSpec:
    ghost = world.robot.read_model()
    _remove_sensors(ghost)
    for element in [*ghost.actuators, *ghost.equalities, *ghost.tendons, *ghost.sites]:
        ghost.delete(element)
    for element in [*ghost.pairs, *ghost.excludes, *ghost.lights, *ghost.cameras]:
        ghost.delete(element)
    for geom in ghost.geoms:
        geom.contype = geom.conaffinity = 0
        if geom.rgba[3] == 0.0:
            geom.group = HIDDEN
        geom.material, geom.rgba = "", (0.0, 0.0, 0.0, 0.0)  # `Ghost` draws it
    return ghost


def _remove_sensors(spec: mujoco.MjSpec) -> None:
    for sensor in spec.sensors:
        spec.delete(sensor)


def _list_joints(model: mujoco.MjModel) -> list[str]:
    return [model.joint(number).name for number in range(model.njnt)]


class Ghost:
    """Draws the bodies of a stage's ghost; batched meshes, as of the robot, are opaque."""

    def __init__(self, server: viser.ViserServer, model: mujoco.MjModel) -> None:
        self._frame = server.scene.add_frame("/ghost", show_axes=False, visible=False)
        self._bodies: dict[int, viser.MeshHandle] = {}
        for body in range(model.nbody):
            geoms = np.flatnonzero((model.geom_bodyid == body) & (model.geom_group < 3)).tolist()
            if not model.body(body).name.startswith(GHOST) or not geoms:
                continue
            mesh = merge_geoms(model, geoms)
            self._bodies[body] = server.scene.add_mesh_simple(
                f"/ghost/{body}",
                mesh.vertices,
                mesh.faces,
                color=GHOST_COLOR,
                opacity=GHOST_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )

    def show(self, data: mujoco.MjData) -> None:
        """Show it where the bodies of the stage are."""
        self._frame.visible = True
        for body, handle in self._bodies.items():
            handle.position, handle.wxyz = data.xpos[body], data.xquat[body]

    def hide(self) -> None:
        """Hide it."""
        self._frame.visible = False


@dataclass(frozen=True, kw_only=True)
class Picture:
    """What is shown on the stage, in the positions and velocities of its world."""

    qpos: Array
    """MuJoCo positions of the robot, (nq,)."""
    ghost: Array | None = None
    """The same of the ghost; None without one."""
    velocity: Array | None = None
    """MuJoCo velocities of the robot, (nv,); None at rest."""
    joint_torque: Array | None = None
    """Torques at the joints [N·m], (n,), which the contact forces balance."""


class Stage:
    """Shows MuJoCo positions of a world, with contacts and the center of mass over its support.

    Calls from several threads have to take turns.
    """

    def __init__(self, server: viser.ViserServer, world: World) -> None:
        """Draw the scene, with the robot where its model puts it and without a ghost."""
        self.world = world
        self.shows_balance = True
        self._model = paint(world.robot, build_model(world))
        self._data = mujoco.MjData(self._model)
        self.view = ViserMujocoScene(server, self._model, num_envs=1)
        """The scene of mjviser, with its own controls."""
        self.view.camera_tracking_enabled = False
        self.view.show_contact_points = self.view.show_contact_forces = True
        self._ghost = Ghost(server, self._model)
        self._com = server.scene.add_icosphere(
            "/balance/com", COM_RADIUS * world.robot.standing_neck_height, color=BALANCED
        )
        self._support = server.scene.add_line_segments(
            "/balance/support",
            np.zeros((1, 2, 3)),
            BALANCED,
            thickness=3.0,
            thickness_units="screen",
        )

    def show(self, picture: Picture) -> None:
        """Show the robot, and its ghost if there is one."""
        data, ghost = self._data, picture.ghost
        data.qpos[:] = np.concatenate([picture.qpos, picture.qpos if ghost is None else ghost])
        data.qvel[:] = data.qfrc_applied[:] = 0.0
        if picture.velocity is not None:
            data.qvel[: self.world.model.nv] = picture.velocity
        if picture.joint_torque is not None:
            dof = self.world.robot.layout(self._model).dof
            data.qfrc_applied[dof] = picture.joint_torque
        mujoco.mj_forward(self._model, data)
        self._draw_balance()
        if ghost is None:
            self._ghost.hide()
        else:
            self._ghost.show(data)
        self.view.update_from_mjdata(data)

    def _draw_balance(self) -> None:
        """Draw the center of mass on the ground, and the hull of the contacts with the world."""
        com = self._data.subtree_com[self.world.robot.layout(self._model).torso]
        points = self._find_supports()
        points = points[np.isfinite(points).all(axis=1)]
        hull = find_hull(points[:, :2]) if len(points) > 2 else None
        height = float(points[:, 2].max(initial=0.0)) + ABOVE
        self._com.visible = self.shows_balance
        self._support.visible = self.shows_balance and hull is not None
        self._com.position = np.array([*com[:2], height])
        self._com.color = BALANCED if hull is not None and contains(hull, com[:2]) else FALLING
        if hull is not None:
            outline = hull.points[hull.vertices]
            corners = np.column_stack([outline, np.full(len(outline), height)])
            self._support.points = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)

    def _find_supports(self) -> Array:
        """Return the contact points of the robot with the world [m], (m, 3)."""
        contact = self._data.contact
        root = self._model.body_weldid[self._model.geom_bodyid[contact.geom]]  # (ncon, 2)
        return contact.pos[np.any(root == 0, axis=1)]


def contains(hull: ConvexHull, point: Array) -> bool:
    """Return whether a point (2,) lies within a hull."""
    return bool(np.all(hull.equations[:, :2] @ point + hull.equations[:, 2] <= 0.0))
