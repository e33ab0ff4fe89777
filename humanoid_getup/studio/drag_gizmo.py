"""Drag gizmo: arrows and rings by which a hand, a foot or the torso is dragged in 3-D."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from humanoid_getup.studio.inverse_kinematics import EndPose
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.reach import Drag, Handle, Reach
from robots import Posture
from robots.quaternion import IDENTITY

if TYPE_CHECKING:
    import viser

NONE = "none"
NAME = "/drag"
SIZE = 0.45  # standing neck heights


class DragGizmo:
    """Elements that choose what is dragged, and the gizmo, of which there is one at most.

    Whatever was dragged last is solved next: positions between two solutions are skipped.
    """

    def __init__(self, page: Page, mirrored: viser.GuiInputHandle[bool]) -> None:
        """Add the elements where the caller is adding them.

        Args:
            page: The page.
            mirrored: Whether the other side follows.
        """
        self._page, self._mirrored = page, mirrored
        self._reach = Reach(page.world.robot)
        self._gizmo: viser.TransformControlsHandle | None = None
        self._drag: Drag | None = None
        self._is_new = self._ends = False
        self._choice = page.gui.add_dropdown("Drag", (NONE, *self._reach.handles))
        self._choice.on_update(page.answer(self._choose))
        self._feet_stay = page.gui.add_checkbox("Feet stay", True)
        self._follow_drag = page.answer(self._move)
        page.when_posed.append(self._follow)

    @property
    def shown(self) -> viser.TransformControlsHandle | None:
        """Return the gizmo that is shown."""
        return self._gizmo

    @property
    def is_held(self) -> bool:
        """Return whether it is being dragged."""
        return self._drag is not None

    def _choose(self) -> None:
        """Show the gizmo of the chosen handle."""
        if self._gizmo is not None:
            self._gizmo.remove()
        self._gizmo = self._drag = None
        if self._choice.value == NONE:
            return
        pose = self._locate()
        self._gizmo = self._page.server.scene.add_transform_controls(
            NAME,
            position=pose.position,
            wxyz=pose.orientation,
            scale=SIZE * self._page.world.robot.standing_neck_height,
            disable_rotations=not self._reach.turns(self._handle),
            depth_test=False,
        )
        self._gizmo.on_update(self._note)
        self._page.say(f"Drag the {self._handle.replace('_', ' ')} by its arrows.")

    @property
    def _handle(self) -> Handle:
        return cast(Handle, self._choice.value)

    def _note(self, event: viser.TransformControlsEvent) -> None:
        self._is_new, self._ends = True, self._ends or event.phase == "end"
        self._follow_drag(event)

    def _move(self) -> None:
        """Bring the robot to where the gizmo is now, unless that has been done."""
        if (gizmo := self._gizmo) is None or not self._is_new:
            return
        ends, self._is_new, self._ends = self._ends, False, False
        drag = self._drag or self._begin()
        target = EndPose(position=np.array(gizmo.position), orientation=np.array(gizmo.wxyz))
        posture = drag.finish(target) if ends else drag.to(target)
        self._drag = None if ends else drag
        self._page.pose(posture)

    def _begin(self) -> Drag:
        return Drag(
            self._reach,
            self._page.start,
            self._handle,
            mirrored=self._mirrored.value,
            feet_stay=self._feet_stay.value,
        )

    def _follow(self, _: Posture) -> None:
        """Keep the gizmo at its handle, unless it is held."""
        if self._drag is None:
            self._put_back()

    def _put_back(self) -> None:
        if (gizmo := self._gizmo) is not None:
            pose = self._locate()
            gizmo.position, gizmo.wxyz = pose.position, pose.orientation

    def _locate(self) -> EndPose:
        """Locate the chosen handle; one that does not turn has the axes of the world."""
        pose = self._reach.locate(self._page.start, self._handle)
        return pose if self._reach.turns(self._handle) else replace(pose, orientation=IDENTITY)
