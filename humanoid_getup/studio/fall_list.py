"""Fall list: sampled falls of a class, through which one steps."""

from __future__ import annotations

from dataclasses import replace

from humanoid_getup.experiments.starts.falls import CLASSES, Fall
from humanoid_getup.studio.button_row import add_button_row
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.pose_robot import FallsToSample, sample_starts

MOST_FALLS = 100
CLASS = "The side on which the robot comes to rest."
SEED = "One seed gives the same falls again."
FALLS = "How many are sampled; Previous and Next step through them."


class FallList:
    """Elements that sample falls, and pose the robot in one of them."""

    def __init__(self, page: Page) -> None:
        """Add the elements where the caller is adding them."""
        self._page, gui = page, page.gui
        self._falls: list[Fall] = []
        self._number = self._sampled = 0
        self._side = gui.add_dropdown("Class", CLASSES, hint=CLASS)
        self._seed = gui.add_number("Seed", page.request.seed, min=0, step=1, hint=SEED)
        self._count = gui.add_number("Falls", 1, min=1, max=MOST_FALLS, step=1, hint=FALLS)
        page.add_button("Random fall", self._sample, main=True)
        step = {"Previous": lambda: self._step(-1), "Next": lambda: self._step(1)}
        add_button_row(page, "Step", step)

    def _sample(self) -> None:
        seed = int(self._seed.value)
        request = FallsToSample(
            options=replace(self._page.request, seed=seed),
            side=self._side.value,
            count=int(self._count.value),
        )
        self._page.say("Robots fall …")
        self._page.run(sample_starts, request, lambda falls: self._show_all(falls, seed))

    def _show_all(self, falls: list[Fall], seed: int) -> None:
        self._falls, self._sampled, self._number = falls, seed, 0
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
