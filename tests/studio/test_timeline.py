"""The slider of the timeline follows a take that plays, and a person who moves it."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
import pytest
from studio_page import open_studio

from humanoid_getup.studio.takes import Take

# The page writes the field in each picture: it is replaced in one step, or the text is added to it.
TYPE = """(input, text) => {
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value").set.call(input, text);
    input.dispatchEvent(new Event("input", {bubbles: true}));
}"""

if TYPE_CHECKING:
    from playwright.sync_api import Browser


def test_a_time_that_is_typed_while_a_take_plays_is_shown(
    browser: "Browser", monkeypatch: pytest.MonkeyPatch
):
    with open_studio(browser) as (studio, window):
        timeline, time = studio.page.timeline, np.linspace(0.0, 600.0, 6001)
        lying = timeline.picture.qpos
        rising = lying + 1e-4 * time[:, None] * (np.arange(len(lying)) == 2)  # its torso, in 60 mm
        take = Take(name="rising", time=time, qpos=rising)
        timeline.load(take)

        def draw(number: int) -> None:
            assert timeline.wait_for(lambda: timeline.pictures >= number, 60.0)

        pool, late = studio.server.gui._thread_executor, list[int]()
        submit = pool.submit

        def submit_late(call: Callable[..., object], *args: object):
            """Let the playback move the slider first, as on a machine that is busy."""
            late.append(timeline.pictures + 5)
            return submit(lambda: (draw(late[0]), call(*args)))

        draw(5)
        with monkeypatch.context() as busy:
            busy.setattr(pool, "submit", submit_late)
            window.find_input("Time [s]").evaluate(TYPE, "300")
            assert timeline.wait_for(
                lambda: np.array_equal(timeline.picture.qpos, rising[take.find(300.0)]), 60.0
            )
        window.see_value("Time [s]", "300")
