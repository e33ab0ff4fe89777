"""Pose tab: the start of a rise, sampled, posed by hand or loaded."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from humanoid_getup.experiments.starts.falls import Fall
from humanoid_getup.progress.callback import Cancel
from humanoid_getup.studio.button_row import add_button_row
from humanoid_getup.studio.drag_gizmo import DragGizmo
from humanoid_getup.studio.fall_list import FallList
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.plain_text import name_side
from humanoid_getup.studio.pose_robot import (
    drop_robot,
    measure_pose,
    mirror_pose,
    put_down,
    stand,
    turn_joint,
)
from robots import Posture, load_posture
from robots.description.posture_file import format_posture
from robots.kinematics import read_posture
from robots.storage.files import write_atomically

if TYPE_CHECKING:
    import viser

SLIDER_STEP = 0.5  # degrees
FIRM = 0.001  # m of overlap that is told
SUFFIX = ".json"
OTHER = "The scene shows something else: *Take over* starts a rise from there."
MIRRORED = "A joint or limb that is moved moves that of the other side as well."


class PoseTab:
    """Elements that pose the robot."""

    def __init__(self, page: Page) -> None:
        """Add the elements where the caller is adding them."""
        self._page, gui = page, page.gui
        self._state = gui.add_markdown("")
        self._figures = ""
        shown = {"Show start": self._show_start, "Take over": self._take_over}
        add_button_row(page, "Start posture", shown)
        self._drops = page.run_latest(self._settle, self._show_settled)
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
        figures = measure_pose(self._page.world, posture)
        side = name_side(figures.side)
        parts = [f"Start: **{side}**, torso tilted by {math.degrees(figures.tilt):.0f}°"]
        if figures.overlap > FIRM:
            parts.append(f"{1000 * figures.overlap:.0f} mm inside the ground or an obstacle")
        if figures.self_overlap > FIRM:
            parts.append(f"{1000 * figures.self_overlap:.0f} mm inside itself")
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
        return drop_robot(self._page.world, posture)

    def _show_settled(self, fall: Fall) -> None:
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
        path = self._page.folders.resolve(self._file.value)
        if path.suffix != SUFFIX:
            raise ValueError(f"posture file {path.name}: expected a name that ends with {SUFFIX}")
        write_atomically(path, format_posture(self._page.start, self._page.world.robot))
        self._page.say(f"Saved {self._page.folders.name(path)}.")
