"""A rebuilt model, which hinge of the tree is which in it, and its sites: soles, neck and IMU."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import mujoco
import numpy as np

from robots import quaternion
from robots.body.joint_view import JointView
from robots.body.sides import MirrorPairs
from robots.body.soles import Sole, add_sole_site, find_lowest, find_sole
from robots.model_import.anatomy import Anatomy
from robots.model_import.body_plan import BodyPlan
from robots.model_import.rebuild import Rebuilder
from robots.model_import.source import ModelImportError
from robots.quaternion import Array
from robots.storage.files import describe
from robots.storage.model_files import MODEL_ERRORS
from robots.storage.validation import shown


class RebuiltModel:
    """The robot's own model and its n hinges, in the model's order, as it grows.

    What is added to `spec` is in `model` after `compile`.
    """

    def __init__(
        self,
        path: Path,
        name: str,
        anatomy: Anatomy,
        builder: Rebuilder,
        *,
        fixed: Collection[str],
        passive: Collection[str] = (),
    ) -> None:
        """Build the model of a file's robot, without the hinges that are fixed.

        Those that are passive are in the model, but are none of its n joints.
        """
        self.path, self.anatomy, self.builder = path, anatomy, builder
        self.spec = builder.build(name)
        hinges = anatomy.tree.hinges
        self.passive = tuple(hinge.name for hinge in hinges if hinge.name in passive)
        others = {*fixed, *self.passive}
        self._kept = [k for k, hinge in enumerate(hinges) if hinge.name not in others]
        self.compile()
        self.joint_names = tuple(hinges[k].name for k in self._kept)

    def compile(self) -> None:
        """Compile the specification as it is now."""
        try:
            self.model = self.spec.compile()
        except MODEL_ERRORS as error:
            raise ModelImportError(f"{self.path}: {describe(error)}") from error

    def find(self, hinges: Iterable[int]) -> tuple[int, ...]:
        """Find hinges of the tree in the model, except those that were fixed."""
        place = {k: i for i, k in enumerate(self._kept)}
        return tuple(place[k] for k in hinges if k in place)

    def describe(self, soles: tuple[str, str]) -> BodyPlan:
        """Return the plan of the body; a joint whose counterpart is fixed mirrors itself."""
        anatomy = self.anatomy
        left_leg, right_leg = (self.find(leg) for leg in anatomy.legs)
        arms = [(self.find(left), self.find(right)) for left, right in anatomy.arms]
        mirrors = [self.find([int(anatomy.mirror.index[k])]) for k in self._kept]
        index = [mirror[0] if mirror else i for i, mirror in enumerate(mirrors)]
        return BodyPlan(
            model=self.model,
            mirror=MirrorPairs(np.array(index), anatomy.mirror.sign[self._kept], ()),
            legs=(left_leg, right_leg),
            arms=tuple((left, right) for left, right in arms if left and right),
            head=self.find(anatomy.head),
            soles=soles,
            passive=self.passive,
        )

    def start_angles(self) -> Array:
        """Return the tree's pose within the ranges [rad], (n,)."""
        tree, model = self.anatomy.tree, self.model
        addresses = [tree.model.jnt_qposadr[tree.hinges[k].id] for k in self._kept]
        angles = np.array([tree.data.qpos[address] for address in addresses])
        lower, upper = model.jnt_range[[model.joint(name).id for name in self.joint_names]].T
        return np.clip(angles, lower, upper)

    @property
    def view(self) -> JointView:
        """View the joints of the model as it is now."""
        ids = [self.model.joint(name).id for name in self.joint_names]
        return JointView(self.model, ids, self.passive)

    def look(self) -> mujoco.MjData:
        """Compute the kinematics in the tree's pose."""
        view = self.view
        view.look(self.start_angles())
        return view.data


SOLES = ("l_sole", "r_sole")
NECK, IMU = "neck", "imu"
MARK = [0.005, 0.0, 0.0]  # m, the size of a site
LEAST_SOLE = 0.0025  # area of a sole over the height squared; OP3's is 0.037
LEVEL = 0.03  # share of the height by which the lowest points of a foot and its toes differ


class SitePlacer:
    """Finds the places of the sites and adds them."""

    def __init__(self, rebuilt: RebuiltModel, guesses: list[str], flat: Mapping[str, str]) -> None:
        """Prepare to add sites, and guesses to confirm; shapes that were left out are by body."""
        self._path, self._anatomy, self._builder = rebuilt.path, rebuilt.anatomy, rebuilt.builder
        self._rebuilt, self._guesses, self._flat = rebuilt, guesses, flat

    def add_sites(self) -> None:
        """Add the sites of soles, neck and IMU to the rebuilt model, in the tree's pose."""
        data = self._rebuilt.look()
        self._spec, self._model = self._rebuilt.spec, data.model
        found = [self._find_sole(leg, data) for leg in self._anatomy.legs]
        for sole, name in zip(found, SOLES, strict=True):
            add_sole_site(self._spec, self._model.body(sole.body).name, sole, name)
        torso = self._model.body(1)
        neck, where = self._find_neck(data)
        self._spec.body(torso.name).add_site(name=NECK, pos=neck.tolist(), size=MARK)
        self._guesses.append(
            f"site {NECK}: at {where}; move it in model.xml if that is not the neck's base"
        )
        self._add_imu()

    def _add_imu(self) -> None:
        """Add the IMU's site: at the model's own one on the torso, else at the torso's origin."""
        tree, torso = self._anatomy.tree, self._spec.body(self._model.body(1).name)
        for name, position, frame in self._list_imus():
            axes = self._anatomy.axes.T @ frame
            orientation = quaternion.from_matrix(axes)
            position = self._anatomy.axes.T @ (position - tree.data.xpos[tree.root])
            torso.add_site(name=IMU, pos=position.tolist(), quat=orientation.tolist(), size=MARK)
            self._guesses.append(f"site {IMU}: the model's {name}")
            return
        torso.add_site(name=IMU, size=MARK)
        self._guesses.append(
            f"site {IMU}: at the origin of {torso.name}, its axes those of the torso; place it in "
            "model.xml"
        )

    def _list_imus(self) -> Iterator[tuple[str, Array, Array]]:
        """List elements of the torso that are named as an IMU, with place and axes in the world."""
        tree = self._anatomy.tree
        model, data = tree.model, tree.data
        for site in range(model.nsite):
            body, name = int(model.site_bodyid[site]), model.site(site).name
            is_held = body in tree.bodies and self._builder.holder(body) == tree.root
            if is_held and _names_an_imu(name):
                yield f"site {name}", data.site_xpos[site], data.site_xmat[site].reshape(3, 3)
        for body in tree.bodies[1:]:
            name = model.body(body).name
            if self._builder.holder(body) == tree.root and _names_an_imu(name):
                yield f"link {name}", data.xpos[body], data.xmat[body].reshape(3, 3)

    def _find_sole(self, leg: Sequence[int], data: mujoco.MjData) -> Sole:
        """Find the largest sole among the last links of a leg: of foot and toes, the foot's."""
        tree, height = self._anatomy.tree, self._anatomy.height
        bodies = [int(self._model.body(self._builder.carrier(k)).id) for k in leg[-2:]]
        lowest = [find_lowest(self._model, data, body) for body in bodies]
        level = [b for b, z in zip(bodies, lowest, strict=True) if z < min(lowest) + LEVEL * height]
        found = [find_sole(self._model, data, body, LEAST_SOLE * height**2) for body in level]
        soles = [sole for sole in found if sole is not None]
        if soles:
            return max(soles, key=lambda sole: sole.area)
        names = [tree.model.body(body).name for k in leg[-2:] for body in tree.link(k)]
        left_out = (f"; link {shown(n)}: {self._flat[n]}" for n in names if n in self._flat)
        raise ModelImportError(
            f"{self._path}: the leg that ends in joint {shown(tree.hinges[leg[-1]].name)} has "
            "no flat face that looks down, expected a sole: feet that are points or lines "
            f"cannot stand{''.join(left_out)}"
        )

    def _find_neck(self, data: mujoco.MjData) -> tuple[Array, str]:
        """Return the position of the neck in the torso's frame, and its description."""
        head = self._list_joints(self._anatomy.head)
        shoulders = self._list_joints([left[0] for left, _ in self._anatomy.arms])
        if head:
            anchor = data.xanchor[head[0]].copy()
            anchor[1] = 0.0
            return anchor, f"joint {self._model.joint(head[0]).name}"
        if shoulders:
            anchors = data.xanchor[shoulders]
            top = anchors[np.argmax(anchors[:, 2])].copy()
            top[1] = 0.0
            return top, "the middle of the shoulders"
        return np.array([0.0, 0.0, float(data.xipos[1, 2])]), "the torso's center of mass"

    def _list_joints(self, hinges: Sequence[int]) -> list[int]:
        """List the joints of the rebuilt model that are these hinges of the tree."""
        names = [self._anatomy.tree.hinges[k].name for k in hinges]
        kept = {self._model.joint(j).name: j for j in range(self._model.njnt)}
        return [kept[name] for name in names if name in kept]


def _names_an_imu(name: str) -> bool:
    return any(word in name.lower() for word in ("imu", "gyro"))
