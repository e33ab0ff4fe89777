"""Made-up moves and resting states of a robot of one joint."""

from typing import Any

import numpy as np

from humanoid_getup.posture_chains.resting_state import PostureMove, RestingState


def make_move(*knots: float, duration: float = 1.0) -> PostureMove:
    return PostureMove(knots=np.array([[k] for k in knots]), duration=duration, kind="test")


def make_state(progress: float, **fields: Any) -> RestingState:
    made: dict[str, Any] = {
        "qpos": np.full(8, progress),
        "target": np.array([progress]),
        "cell": (0,),
        "place": np.zeros(6),
    }
    return RestingState(progress=progress, **(made | fields))
