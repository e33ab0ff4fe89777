"""State colors: the colors of a search's states on their map, and the key to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from robots.quaternion import Array

if TYPE_CHECKING:
    from humanoid_getup.studio.search_map import MappedState

Color = tuple[int, int, int]
SCALE: tuple[Color, ...] = ((253, 210, 60), (240, 120, 60), (170, 50, 120), (60, 15, 110))
"""From no move to the most."""
SIDES: tuple[Color, ...] = (
    (47, 111, 222),
    (217, 130, 43),
    (44, 160, 44),
    (148, 103, 189),
    (120, 120, 120),
)
ROWS = 5
"""Number of rows of a key, at most."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StateColors:
    """Colors of states, and what they mean."""

    colors: Array
    """From 0 to 255, (S, 3)."""
    key: tuple[tuple[Color, str], ...]


def color_by_moves(states: Sequence[MappedState]) -> StateColors:
    """Color states by the number of moves of their ways."""
    moves = np.array([state.moves for state in states])
    most = max(int(moves.max(initial=0)), 1)
    shown = np.unique(np.linspace(0, most, ROWS).round())
    texts = [f"{number:.0f} moves" for number in shown]
    return StateColors(
        colors=_blend(moves / most),
        key=tuple(zip(map(_to_color, _blend(shown / most)), texts, strict=True)),
    )


def color_by_side(states: Sequence[MappedState], sides: Sequence[str]) -> StateColors:
    """Color states by their sides, of which there are some; at most as many as colors."""
    color = dict(zip(sides, SIDES, strict=False))
    present = {state.side for state in states}
    return StateColors(
        colors=np.array([color[state.side] for state in states]),
        key=tuple((color[side], side) for side in sides if side in present),
    )


def _blend(share: Array) -> Array:
    """Blend the colors of the scale at shares from 0 to 1, (S,); return them, (S, 3)."""
    at = np.linspace(0.0, 1.0, len(SCALE))
    return np.stack([np.interp(share, at, channel) for channel in np.array(SCALE).T], axis=-1)


def _to_color(channels: Array) -> Color:
    red, green, blue = channels.astype(int).tolist()
    return red, green, blue
