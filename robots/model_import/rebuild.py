"""Rebuilds a robot's model from a tree; its torso's axes are forward, left and up."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import mujoco
import numpy as np

from robots import quaternion
from robots.body.shapes import list_solid, read_shapes
from robots.description.model_checks import HINGE
from robots.model_import.anatomy import Anatomy
from robots.model_import.ties import Follower
from robots.model_import.tree import KinematicTree, name_joint
from robots.quaternion import Array

BEYOND = 2.0  # times the reach of a link's shapes, where all of its mass had to be
WIDEST = 0.4  # of the robot's height, up to which a small link's inertia may be a placeholder


def find_excess(inertia: Array, mass: float, points: Array, height: float) -> float:
    """Find how many times an inertia (3, 3) [kg·m²] is that of a box about a link's shapes.

    The points (p, 3) that span them are from the center of mass. It is 0 for one that can be, and
    that of a small link may be larger than its shapes permit, if not than the robot's height does.
    """
    largest = float(np.linalg.eigvalsh(inertia).max())
    reach = float(np.linalg.norm(points, axis=1).max(initial=0.0))
    if not reach or largest <= mass * max(BEYOND * reach, WIDEST * height) ** 2:
        return 0.0
    return largest / float(compute_box_inertia(mass, points).max())


def compute_box_inertia(mass: float, points: Array) -> Array:
    """Compute the inertia of a uniform box that holds points, (3, 3) [kg·m²]."""
    sides = np.square(np.ptp(points, axis=0))
    return mass / 12.0 * np.diag(sides.sum() - sides)


TIMESTEP = 0.002  # s
FRICTION = 0.8
STIFF_CONTACT = (0.004, 1.0)  # solref of hard plastic: s, damping ratio
LEAST_MASS = 1e-4  # kg; lighter moving bodies make a simulation unstable
LEAST_INERTIA = 1e-7  # kg·m²
LEAST_TURN = 1e-4  # rad
FULL_TURN = np.pi  # rad either way, of a joint without range


class Rebuilder:
    """Builds the model of a robot from the tree found in another model."""

    def __init__(
        self,
        anatomy: Anatomy,
        *,
        keep_hulls: bool,
        fixed: Collection[str],
        followers: Collection[Follower] = (),
        notes: list[str],
    ) -> None:
        """Prepare to build; some hinges are fixed at the angles of the tree's pose.

        Meshes become convex hulls, if kept, or boxes and capsules.
        """
        self._tree: KinematicTree = anatomy.tree
        self._model = anatomy.tree.model
        self._keep_hulls, self._fixed, self._notes = keep_hulls, set(fixed), notes
        self._height, self._followers = anatomy.height, followers
        self._boundless: list[str] = []
        self._points: dict[int, list[Array]] = {}
        self._excess: dict[str, float] = {}
        self._solid = {self.holder(b) for b in self._tree.bodies if list_solid(self._model, b)}
        root = self._tree.data.xmat[self._tree.root].reshape(3, 3)
        self._turn = quaternion.from_matrix(anatomy.axes.T @ root)
        if quaternion.angle_between(self._turn, quaternion.IDENTITY) < LEAST_TURN:
            self._turn = quaternion.IDENTITY
        else:
            notes.append("the torso's frame is turned so that x points forward and z up")

    def build(self, name: str) -> mujoco.MjSpec:
        """Build the model; it has no sites yet."""
        spec = mujoco.MjSpec()
        spec.modelname = name
        spec.option.timestep = TIMESTEP
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.compiler.degree = False
        spec.default.geom.friction = np.array([FRICTION, 0.005, 0.0001])
        spec.default.geom.solref = np.array(STIFF_CONTACT)
        built: dict[int, mujoco.MjsBody] = {}
        for body in self._tree.bodies:
            holder = self.holder(body)
            if body == self._tree.root:
                built[body] = spec.worldbody.add_body(name=self.name(body))
                built[body].add_freejoint(name="root")
            elif holder == body:
                above = int(self._model.body_parentid[body])
                built[body] = built[self.holder(above)].add_body(name=self.name(body))
                pose = self._place_in(above, *self._pose(body))
                built[body].pos, built[body].quat = pose
                self._add_joints(built[body], body)
            self._add_shapes(spec, built[holder], body)
        for body, target in built.items():
            self._add_mass(target, body)
        self._copy_excludes(spec)
        self._add_followers(spec)
        if self._boundless:
            listed = ", ".join(self._boundless)
            self._notes.append(
                f"-180 to 180 deg for joints without range, or of equal ends: {listed}"
            )
        if self._excess:
            self._notes.append(
                f"inertias up to {max(self._excess.values()):.0f} times those of boxes of their "
                f"size are replaced by these: {', '.join(self._excess)}"
            )
        return spec

    def name(self, body: int) -> str:
        """Return the name of a body, which may have none in its model."""
        return self._model.body(body).name or f"body_{body}"

    def holder(self, body: int) -> int:
        """Return the body to which another is welded, or itself if it has hinges."""
        model, fixed = self._model, self._fixed
        while body != self._tree.root and fixed.issuperset(
            name_joint(model, joint) for joint in self._hinges(body)
        ):
            body = int(model.body_parentid[body])
        return body

    def carrier(self, hinge: int) -> str:
        """Return the name of the rebuilt body that one of the tree's hinges moves."""
        return self.name(self.holder(self._tree.hinges[hinge].body))

    def _pose(self, body: int) -> tuple[Array, Array]:
        """Return the pose of a body in its parent, bent by the hinges that are fixed."""
        position, orientation = self._model.body_pos[body], self._model.body_quat[body]
        for joint in self._hinges(body):
            if name_joint(self._model, joint) in self._fixed:
                position, orientation = self._bend(joint, position, orientation)
        return position, orientation

    def _place_in(self, body: int, position: Array, orientation: Array) -> tuple[Array, Array]:
        """Convert a pose in a body's old frame to that of its holder; the root's is turned."""
        holder = self.holder(body)
        while body != holder:
            origin, turn = self._pose(body)
            position = origin + quaternion.rotate(turn, position)
            orientation = quaternion.multiply(turn, orientation)
            body = int(self._model.body_parentid[body])
        if holder != self._tree.root:
            return position, orientation
        return (
            quaternion.rotate(self._turn, position),
            quaternion.multiply(self._turn, orientation),
        )

    def _bend(self, joint: int, position: Array, orientation: Array) -> tuple[Array, Array]:
        """Turn a body about a hinge that is fixed in the tree's pose."""
        data, model = self._tree.data, self._model
        address = model.jnt_qposadr[joint]
        angle = data.qpos[address] - model.qpos0[address]
        turn = quaternion.from_axis_angle(model.jnt_axis[joint], angle)
        anchor = model.jnt_pos[joint]
        moved = anchor - quaternion.rotate(turn, anchor)
        return (
            position + quaternion.rotate(orientation, moved),
            quaternion.multiply(orientation, turn),
        )

    def _hinges(self, body: int) -> list[int]:
        first = int(self._model.body_jntadr[body])
        joints = range(first, first + int(self._model.body_jntnum[body]))
        return [joint for joint in joints if self._model.jnt_type[joint] == HINGE]

    def _add_joints(self, target: mujoco.MjsBody, body: int) -> None:
        model = self._model
        for joint in self._hinges(body):
            name = name_joint(model, joint)
            if name in self._fixed:
                continue
            lower, upper = model.jnt_range[joint]
            if not model.jnt_limited[joint] or lower >= upper:
                lower, upper = -FULL_TURN, FULL_TURN
                self._boundless.append(name)
            target.add_joint(
                name=name,
                type=HINGE,
                pos=model.jnt_pos[joint],
                axis=model.jnt_axis[joint],
                range=[float(lower), float(upper)],
                limited=mujoco.mjtLimited.mjLIMITED_TRUE,
                ref=float(model.qpos0[model.jnt_qposadr[joint]]),
            )

    def _add_mass(self, target: mujoco.MjsBody, body: int) -> None:
        model = self._model
        held = [b for b in self._tree.bodies if self.holder(b) == body and model.body_mass[b] > 0.0]
        mass = sum((float(model.body_mass[b]) for b in held), 0.0)
        poses = [self._place_in(b, model.body_ipos[b], model.body_iquat[b]) for b in held]
        shares = [float(model.body_mass[b]) / mass for b in held]
        center = sum((s * pose[0] for s, pose in zip(shares, poses, strict=True)), np.zeros(3))
        inertia = np.zeros((3, 3))
        for b, (position, orientation) in zip(held, poses, strict=True):
            axes = quaternion.rotate(orientation, np.eye(3)).T
            inertia += axes @ np.diag(model.body_inertia[b]) @ axes.T
            away = position - center
            inertia += model.body_mass[b] * (away @ away * np.eye(3) - np.outer(away, away))
        points = np.concatenate([np.zeros((0, 3)), *self._points.get(body, ())]) - center
        if excess := find_excess(inertia, mass, points, self._height):
            inertia = compute_box_inertia(mass, points)
            self._excess[self.name(body)] = excess
        moments, axes = np.linalg.eigh(inertia)
        axes[:, 0] *= np.sign(np.linalg.det(axes))
        target.explicitinertial = True
        target.mass, target.ipos = max(mass, LEAST_MASS), center
        target.iquat = quaternion.from_matrix(axes)
        target.inertia = np.maximum(moments, LEAST_INERTIA)

    def _add_shapes(self, spec: mujoco.MjSpec, target: mujoco.MjsBody, body: int) -> None:
        shapes = read_shapes(
            self._model, body, keep_hulls=self._keep_hulls, solid=self.holder(body) in self._solid
        )
        for number, shape in enumerate(shapes):
            own = self.name(body)
            name = own if len(shapes) == 1 else f"{own}_{number}"
            position, orientation = self._place_in(body, shape.position, shape.orientation)
            placed = replace(shape, position=position, orientation=orientation)
            self._points.setdefault(self.holder(body), []).append(placed.sample())
            geom = target.add_geom(
                name=name,
                type=shape.kind,
                size=shape.size,
                pos=position.tolist(),
                quat=orientation.tolist(),
            )
            if shape.points is not None:
                spec.add_mesh(name=name, uservert=shape.points.ravel().tolist())
                geom.meshname = name
                # MuJoCo moves a mesh to its center of mass by itself.

    def _add_followers(self, spec: mujoco.MjSpec) -> None:
        """Add the equalities by which hinges follow others, from where both are at zero."""
        for each in self._followers:
            equality = spec.add_equality(
                type=mujoco.mjtEq.mjEQ_JOINT,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                name1=each.joint,
                name2=each.leader,
            )
            equality.data[:5] = [0.0, each.ratio, 0.0, 0.0, 0.0]
            equality.solref = np.array(STIFF_CONTACT)

    def _copy_excludes(self, spec: mujoco.MjSpec) -> None:
        model, inside = self._model, set(self._tree.bodies)
        for signature in model.exclude_signature:
            pair = {int(signature) >> 16, int(signature) & 0xFFFF}
            names = sorted({self.name(self.holder(body)) for body in pair if body in inside})
            if len(names) == 2:
                spec.add_exclude(bodyname1=names[0], bodyname2=names[1])
