"""A rebuilt model and the tree that it was built from: which hinge is which."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from pathlib import Path

import mujoco
import numpy as np

from robots.body.body_plan import BodyPlan
from robots.body.joint_view import JointView
from robots.body.mirror_pairs import MirrorPairs
from robots.model_import.anatomy import Anatomy
from robots.model_import.rebuild import Rebuilder
from robots.model_import.source import ModelImportError
from robots.quaternion import Array
from robots.storage.files import describe
from robots.storage.model_files import MODEL_ERRORS


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
        """Compile the specification as it is now.

        Raises:
            ModelImportError: if that fails.
        """
        try:
            self.model = self.spec.compile()
        except MODEL_ERRORS as error:
            raise ModelImportError([f"{self.path}: {describe(error)}"]) from error

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
