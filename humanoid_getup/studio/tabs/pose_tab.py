"""Pose tab: the start of a rise, sampled, posed by hand or loaded."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from humanoid_getup.jobs.pose_robot import (
    drop_robot,
    measure_pose,
    mirror_pose,
    put_down,
    stand,
    turn_joint,
)
from humanoid_getup.studio.button_row import add_button_row
from humanoid_getup.studio.drag_gizmo import DragGizmo
from humanoid_getup.studio.fall_list import FallList
from humanoid_getup.studio.page import Page
from robots import Posture, load_posture
from robots.description.posture_file import format_posture
from robots.storage.files import write_atomically

if TYPE_CHECKING:
    import viser

SLIDER_STEP = 0.5  # degrees
FIRM = 0.001  # m of overlap that is told
SUFFIX = ".json"
MIRRORED = "A joint or limb that is moved moves that of the other side as well."


class PoseTab:
    """Elements that pose the robot."""

    def __init__(self, page: Page) -> None:
        """Add the elements where the caller is adding them."""
        self._page, gui, answer = page, page.gui, page.answer
        self._state = gui.add_markdown("")
        with gui.add_folder("Fall"):
            FallList(page)
        with gui.add_folder("Posture"):
            self._mirrored = gui.add_checkbox("Mirrored", False, hint=MIRRORED)
            self.gizmo = DragGizmo(page, self._mirrored)
            gui.add_button("Drop and settle").on_click(answer(self._drop))
            row = {"Put down": self._put_down, "Mirror": self._mirror, "Stand": self._stand}
            add_button_row(page, "Set", row)
        with gui.add_folder("File"):
            self._file = gui.add_text("Name", f"posture{SUFFIX}")
            gui.add_button("Load").on_click(answer(self._load))
            gui.add_button("Save").on_click(answer(self._save))
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
        parts = [f"**{figures.side}**, torso tilted by {math.degrees(figures.tilt):.0f}°"]
        if figures.overlap > FIRM:
            parts.append(f"{1000 * figures.overlap:.0f} mm inside the ground or an obstacle")
        if figures.self_overlap > FIRM:
            parts.append(f"{1000 * figures.self_overlap:.0f} mm inside itself")
        self._state.content = ", ".join(parts)
        for slider, angle in zip(self._sliders, posture.joint_pos, strict=True):
            slider.value = math.degrees(angle)

    def _drop(self) -> None:
        fall = drop_robot(self._page.world, self._page.start)
        self._page.pose(fall.posture)
        self._page.say(f"Dropped, it settled {fall.start_class}.")

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
