"""Pose tab: the start of a rise, sampled, posed by hand or loaded."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from humanoid_getup.commands.errors import refusing
from humanoid_getup.experiments.falls import CLASSES, UNCLASSED, Fall, classify, drop_from
from humanoid_getup.progress.callback import Cancel
from humanoid_getup.simulation.clearance import Clearance
from humanoid_getup.studio.inverse_kinematics import EndPose
from humanoid_getup.studio.page import Page, add_button_row
from humanoid_getup.studio.plain_text import name_side
from humanoid_getup.studio.pose_robot import (
    FallsToSample,
    mirror_pose,
    put_down,
    sample_starts,
    stand,
    turn_joint,
)
from humanoid_getup.studio.reach import Drag, Handle, Reach
from robots import Posture, load_posture
from robots.description.posture_file import format_posture
from robots.kinematics import place, read_posture
from robots.quaternion import IDENTITY
from robots.storage.files import write_atomically

if TYPE_CHECKING:
    import viser

NONE = "none"
GIZMO = "/drag"
GIZMO_SIZE = 0.45  # standing neck heights
SLIDER_STEP = 0.5  # degrees
FIRM = 0.001  # m of overlap that is told
SUFFIX = ".json"
OTHER = "The scene shows something else: *Take over* starts a rise from there."
MIRRORED = "A joint or limb that is moved moves that of the other side as well."
MOST_FALLS = 100
CLASS = "The side on which the robot comes to rest."
SEED = "One seed gives the same falls again."
FALLS = "How many are sampled; Previous and Next step through them."


class DragGizmo:
    """Elements that choose what is dragged, and the gizmo, of which there is one at most.

    Whatever was dragged last is solved next: positions between two solutions are skipped.
    """

    def __init__(self, page: Page, mirrored: viser.GuiInputHandle[bool]) -> None:
        """Add the elements where the caller is adding them."""
        self._page, self._mirrored = page, mirrored
        self._reach = Reach(page.world.robot)
        self.shown: viser.TransformControlsHandle | None = None
        """The gizmo that is shown."""
        self._drag: Drag | None = None
        self._is_new = self._ends = False
        self._choice = page.gui.add_dropdown("Drag", (NONE, *self._reach.handles))
        self._choice.on_update(page.answer(self._choose))
        self._feet_stay = page.gui.add_checkbox("Feet stay", True)
        self._follow_drag = page.answer(self._move)
        page.when_posed.append(self._follow)

    @property
    def is_held(self) -> bool:
        """Return whether it is being dragged."""
        return self._drag is not None

    def _choose(self) -> None:
        """Show the gizmo of the chosen handle."""
        if self.shown is not None:
            self.shown.remove()
        self.shown = self._drag = None
        if self._choice.value == NONE:
            return
        pose = self._locate()
        self.shown = gizmo = self._page.server.scene.add_transform_controls(
            GIZMO,
            position=pose.position,
            wxyz=pose.orientation,
            scale=GIZMO_SIZE * self._page.world.robot.standing_neck_height,
            disable_rotations=not self._reach.turns(self._handle),
            depth_test=False,
        )
        gizmo.on_update(self._note)
        self._page.say(f"Drag the {self._handle.replace('_', ' ')} by its arrows.")

    @property
    def _handle(self) -> Handle:
        return cast(Handle, self._choice.value)

    def _note(self, event: viser.TransformControlsEvent) -> None:
        self._is_new, self._ends = True, self._ends or event.phase == "end"
        self._follow_drag(event)

    def _move(self) -> None:
        """Bring the robot to where the gizmo is now, unless that has been done."""
        if (gizmo := self.shown) is None or not self._is_new:
            return
        ends, self._is_new, self._ends = self._ends, False, False
        drag = self._drag or self._begin()
        target = EndPose(position=np.array(gizmo.position), orientation=np.array(gizmo.wxyz))
        posture = drag.finish(target) if ends else drag.to(target)
        self._drag = None if ends else drag
        self._page.pose(posture)

    def _begin(self) -> Drag:
        mirrored, feet_stay = self._mirrored.value, self._feet_stay.value
        start, handle = self._page.start, self._handle
        return Drag(self._reach, start, handle, mirrored=mirrored, feet_stay=feet_stay)

    def _follow(self, _: Posture) -> None:
        """Keep the gizmo at its handle, unless it is held."""
        if self._drag is None and (gizmo := self.shown) is not None:
            pose = self._locate()
            gizmo.position, gizmo.wxyz = pose.position, pose.orientation

    def _locate(self) -> EndPose:
        """Locate the chosen handle; one that does not turn has the axes of the world."""
        pose = self._reach.locate(self._page.start, self._handle)
        return pose if self._reach.turns(self._handle) else replace(pose, orientation=IDENTITY)


class PoseTab:
    """Elements that pose the robot."""

    def __init__(self, page: Page) -> None:
        self._page, gui = page, page.gui
        self._state = gui.add_markdown("")
        self._figures = ""
        shown = {"Show start": self._show_start, "Take over": self._take_over}
        add_button_row(page, "Start posture", shown)
        self._drops = page.add_job(self._settle, self._show_settled, apart=False)
        page.timeline.when_shown.append(self._describe)
        with gui.add_folder("Fall"):
            FallList(page)
        with gui.add_folder("Posture"):
            self._mirrored = gui.add_checkbox("Mirrored", False, hint=MIRRORED)
            self.gizmo = DragGizmo(page, self._mirrored)
            page.add_button("Drop and settle", self._drop)
            row = {"Put down": self._put_down, "Mirror": self._mirror, "Stand": self._stand}
            add_button_row(page, "Set", row)
        with gui.add_folder("File"):
            self._file = gui.add_text("Name", f"posture{SUFFIX}")
            page.add_button("Load", self._load)
            page.add_button("Save", self._save)
        with gui.add_folder("Joints [deg]", expand_by_default=False):
            self._sliders = [self._add_slider(number) for number in range(page.world.robot.n)]
        page.when_posed.append(self._show)
        page.pose(page.start)

    def _add_slider(self, number: int) -> viser.GuiInputHandle[float]:
        joint = self._page.world.robot.joints[number]
        lower, upper = math.degrees(joint.lower), math.degrees(joint.upper)
        slider = self._page.gui.add_slider(joint.name, lower, upper, SLIDER_STEP, lower)
        self._page.on_change(slider, lambda: self._turn(number, slider.value))
        return slider

    def _turn(self, number: int, degrees: float) -> None:
        page, mirrored = self._page, self._mirrored.value
        angle = math.radians(degrees)
        page.pose(turn_joint(page.world.robot, page.start, number, angle, mirrored=mirrored))

    def _show(self, posture: Posture) -> None:
        """Show how the robot lies, and its joint angles."""
        world = self._page.world
        qpos, clearance = place(world.robot, world.model, posture), Clearance(world)
        side = name_side(classify(posture.orientation) or UNCLASSED)
        tilt = math.degrees(np.arccos(np.clip(-posture.gravity_b[2], -1.0, 1.0)))
        parts = [f"Start: **{side}**, torso tilted by {tilt:.0f}°"]
        if (overlap := clearance.measure_overlap(qpos)) > FIRM:
            parts.append(f"{1000 * overlap:.0f} mm inside the ground or an obstacle")
        if (overlap := clearance.measure_self_overlap(qpos)) > FIRM:
            parts.append(f"{1000 * overlap:.0f} mm inside itself")
        self._figures = ", ".join(parts)
        self._describe()
        for slider, angle in zip(self._sliders, posture.joint_pos, strict=True):
            slider.value = math.degrees(angle)

    def _describe(self) -> None:
        """Say how the robot starts, and whether the scene shows something else."""
        shown = "" if self._page.timeline.shows_start else f"\n\n{OTHER}"
        self._state.content = f"{self._figures}.{shown}"

    def _show_start(self) -> None:
        self._page.pose(self._page.start)

    def _take_over(self) -> None:
        """Start from what the scene shows, such as the end of a rise."""
        page = self._page
        if (picture := page.timeline.picture) is None:
            raise ValueError("nothing is shown, expected a posture")
        page.pose(read_posture(page.world.robot, page.world.model, picture.qpos))

    def _drop(self) -> None:
        self._page.say("The robot falls …")
        self._drops.ask(self._page.start)

    def _settle(self, posture: Posture, _: Cancel) -> Fall:
        with refusing():
            return drop_from(self._page.world, posture)

    def _show_settled(self, _: Posture, fall: Fall) -> None:
        self._page.pose(fall.posture)
        self._page.say(f"Dropped, it settled {name_side(fall.start_class)}.")

    def _put_down(self) -> None:
        self._page.pose(put_down(self._page.world, self._page.start))

    def _mirror(self) -> None:
        self._page.pose(mirror_pose(self._page.world, self._page.start))

    def _stand(self) -> None:
        self._page.pose(stand(self._page.world))

    def _load(self) -> None:
        path = self._page.folders.resolve(self._file.value)
        self._page.pose(load_posture(path, self._page.world.robot))
        self._page.say(f"Loaded {self._page.folders.name(path)}.")

    def _save(self) -> None:
        path = self._page.folders.resolve_new("posture file", self._file.value, SUFFIX)
        write_atomically(path, format_posture(self._page.start, self._page.world.robot))
        self._page.say(f"Saved {self._page.folders.name(path)}.")


class FallList:
    """Elements that sample falls, and pose the robot in one of them."""

    def __init__(self, page: Page) -> None:
        self._page, gui = page, page.gui
        self._falls: list[Fall] = []
        self._number = self._sampled = 0
        self._job = page.add_job(sample_starts, self._show_all)
        self._side = gui.add_dropdown("Class", CLASSES, hint=CLASS)
        self._seed = gui.add_number("Seed", page.request.seed, min=0, step=1, hint=SEED)
        self._count = gui.add_number("Falls", 1, min=1, max=MOST_FALLS, step=1, hint=FALLS)
        page.add_button("Random fall", self._sample, main=True)
        step = {"Previous": lambda: self._step(-1), "Next": lambda: self._step(1)}
        add_button_row(page, "Step", step)

    def _sample(self) -> None:
        options = replace(self._page.request, seed=int(self._seed.value))
        self._page.say("Robots fall …")
        self._job.ask((options, self._side.value, int(self._count.value)))

    def _show_all(self, request: FallsToSample, falls: list[Fall]) -> None:
        self._falls, self._sampled, self._number = falls, request[0].seed, 0
        self._show()

    def _step(self, way: int) -> None:
        if not self._falls:
            raise ValueError("no falls yet, expected those of Random fall")
        if len(self._falls) == 1:
            raise ValueError("one fall was sampled, expected more to step through: see Falls")
        self._number = (self._number + way) % len(self._falls)
        self._show()

    def _show(self) -> None:
        fall, count = self._falls[self._number], len(self._falls)
        self._page.pose(fall.posture)
        which = "A fall" if count == 1 else f"Fall {self._number + 1} of {count}"
        self._page.say(f"{which} that settled {fall.start_class}, seed {self._sampled}.")
