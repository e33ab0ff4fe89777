"""Styles: curves for one or several ways of lying, of which a rise follows the nearest.

A style file is TOML, with angles in degrees and durations for a length of legs.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import tomlkit
from msgspec import Meta

from humanoid_getup.style.curves import POINTS, StyleCurves
from humanoid_getup.style.features import angle_distance
from robots import Robot
from robots.arguments import expect
from robots.body.parts import leg_length
from robots.quaternion import Array
from robots.storage.files import readable, write_atomically
from robots.storage.toml_document import Value, commented, plain, rounded, tables_of
from robots.storage.validation import on_axes, positive, read_toml, reading

Lying = Literal["supine", "prone", "left", "right"]
ALIKE = np.radians(5.0)  # by which the beginnings of curves may differ that are nearly alike


@dataclass(frozen=True, kw_only=True, eq=False)
class Style:
    """A named way of rising."""

    name: str
    about: str = ""
    """What it is, in one line."""
    curves: tuple[StyleCurves, ...]
    """One for each way of lying; their mirror images belong to them."""
    followed_from: tuple[Lying, ...] | None = None
    """Ways of lying from which a policy follows it; None if that was not measured."""

    def __post_init__(self) -> None:
        if not self.curves:
            raise ValueError(f"style '{self.name}' has no curves, expected one or more")

    def choose(self, features: Array) -> StyleCurves:
        """Choose the curves, or their mirror image, that begin nearest to measured features (3,).

        Among those that begin nearly alike, the ones that turn the torso least are chosen.
        """
        return self._choices[0][self._find(features)]

    def find(self, features: Array) -> tuple[int, bool]:
        """Find the number of the curves that are chosen, and whether it is their mirror image."""
        number = self._find(features)
        return number % len(self.curves), number >= len(self.curves)

    def _find(self, features: Array) -> int:
        _, begins, turns = self._choices
        distance = angle_distance(begins, features)
        return int(np.argmin(np.where(distance <= distance.min() + ALIKE, turns, np.inf)))

    @cached_property
    def _choices(self) -> tuple[list[StyleCurves], Array, Array]:
        """All curves and mirror images, with their beginnings, (m, 3), and turns, (m,).

        They are kept, because a robot chooses within a control cycle.
        """
        every = [*self.curves, *(curve.mirrored() for curve in self.curves)]
        begins = np.array([curve.values[0] for curve in every])
        return every, begins, np.array([round(curve.turn, 6) for curve in every])


FOLDER = Path(__file__).parent / "named"
SUFFIX = ".toml"
LONGEST = 60.0  # s, of the body that the durations are of
TALLEST = 10.0  # m
DIGITS = 8  # of a duration or length
SHARE_DIGITS, ANGLE_DIGITS = 4, 2  # decimals of a share of standing, and of an angle in degrees

Points = Annotated[Array, on_axes(1)]
Seconds = Annotated[float, positive(LONGEST, "s")]


@dataclass(frozen=True, kw_only=True)
class CurvesTable:
    """Curves in a style file, nine control points each."""

    start: str = ""
    """How the body lies at their beginning; for readers only."""
    neck_height: Points
    side_deg: Points
    front_deg: Points
    duration: Seconds | None = None
    """[s]; the style's own if left out."""


@dataclass(frozen=True, kw_only=True)
class StyleTable:
    """The content of a style file."""

    about: str = ""
    leg_length: Annotated[float, positive(TALLEST, "m")]
    """Leg length of the body to which the durations belong [m]."""
    duration: Seconds | None = None
    """Duration of the curves that have none of their own [s]."""
    followed_from: tuple[Lying, ...] | None = None
    """Ways of lying from which a policy follows it, as measured."""
    curves: Annotated[
        tuple[CurvesTable, ...], Meta(min_length=1, description="one or more tables [[curves]]")
    ]


def list_styles() -> list[str]:
    """List the named styles."""
    return sorted(file.stem for file in FOLDER.glob(f"*{SUFFIX}"))


def load_style(name: str | Path, robot: Robot) -> Style:
    """Load a style by name, or from a TOML file, with durations for a robot.

    Durations of bodies that move alike grow with the square root of the length of their legs.

    Raises:
        ValueError: if there is no such style, its file is wrong, or an argument is of another type.
    """
    expect("style", name, str | Path, f"a name or a {SUFFIX} file")
    expect("robot", robot, Robot, "a Robot, e.g. load_robot('op3')")
    name = str(name)
    if name.endswith(SUFFIX):
        return read_style(Path(name), robot)
    if name not in list_styles():
        raise ValueError(
            f"unknown style '{name}', expected {', '.join(list_styles())} or a {SUFFIX} file"
        )
    return read_style(FOLDER / f"{name}{SUFFIX}", robot)


def load_named(robot: Robot) -> list[Style]:
    """Load all named styles."""
    return [load_style(name, robot) for name in list_styles()]


def rank_styles(styles: Sequence[Style], features: Array) -> list[Style]:
    """Order styles by how they suit a robot that measures features (3,).

    First are those that any policy follows; among them the ones that begin nearest to how the
    robot lies, and then those that turn it least.
    """
    chosen = [style.choose(features) for style in styles]
    distance = np.array([angle_distance(curves.values[0], features) for curves in chosen])
    is_far = distance > distance.min() + ALIKE
    unknown = [style.followed_from == () for style in styles]
    rank = np.lexsort(([curves.turn for curves in chosen], is_far, unknown))
    return [styles[number] for number in rank]


def load_any_style(robot: Robot) -> Style:
    """Load the named styles that a policy follows as one; `Style.choose` chooses its curves."""
    styles = load_named(robot)
    curves = tuple(curve for style in styles if style.followed_from for curve in style.curves)
    return Style(name="any", about="the nearest of all named styles", curves=curves)


def read_style(file: Path, robot: Robot) -> Style:
    """Read a style file, with durations for a robot."""
    curves: list[StyleCurves] = []
    with reading(f"style file {file}") as problems:
        table = read_toml(StyleTable, file, problems)
        factor = 1.0 if problems else _scale(robot, table.leg_length)
        for number, row in enumerate(() if problems else table.curves, start=1):
            try:
                curves.append(_build(row, table.duration, factor))
            except ValueError as error:
                problems.append(f"curves {number}: {error}")
    return Style(
        name=readable(file.stem),
        about=table.about,
        curves=tuple(curves),
        followed_from=table.followed_from,
    )


def write_style(style: Style, robot: Robot, file: Path) -> None:
    """Write a style file with durations for a robot."""
    document = tomlkit.document()
    if style.about:
        document.add("about", tomlkit.item(readable(style.about)))
    length = commented(rounded(leg_length(robot), DIGITS), f"m; of {robot.name}, as the durations")
    document.add("leg_length", length)
    document.add("curves", tables_of(map(_describe, style.curves)))
    write_atomically(file, document.as_string())


def _scale(robot: Robot, length: float) -> float:
    """Return the factor from durations for a length of legs [m] to those for a robot."""
    own = leg_length(robot)
    return 1.0 if length == rounded(own, DIGITS) else math.sqrt(own / length)


def round_curves(curves: StyleCurves) -> StyleCurves:
    """Round curves to the digits of a style file."""
    return replace(
        curves,
        neck_height=np.round(curves.neck_height, SHARE_DIGITS),
        side=np.radians(np.round(np.degrees(curves.side), ANGLE_DIGITS)),
        front=np.radians(np.round(np.degrees(curves.front), ANGLE_DIGITS)),
        duration=float(rounded(curves.duration, DIGITS)),
    )


def _describe(curve: StyleCurves) -> dict[str, Value]:
    head: dict[str, Value] = {"start": curve.start} if curve.start else {}
    return head | {
        "duration": commented(rounded(curve.duration, DIGITS), "s"),
        "neck_height": [plain(value, SHARE_DIGITS) for value in curve.neck_height],
        "side_deg": [plain(value, ANGLE_DIGITS) for value in np.degrees(curve.side)],
        "front_deg": [plain(value, ANGLE_DIGITS) for value in np.degrees(curve.front)],
    }


def _build(row: CurvesTable, duration: float | None, factor: float) -> StyleCurves:
    seconds = duration if row.duration is None else row.duration
    if seconds is None:
        raise ValueError("duration is missing, expected seconds here, or for all curves")
    for key in ("neck_height", "side_deg", "front_deg"):
        values = getattr(row, key)
        if len(values) != POINTS:
            raise ValueError(f"{key} has {len(values)} points, expected {POINTS}")
    return StyleCurves(
        neck_height=row.neck_height,
        side=np.radians(row.side_deg),
        front=np.radians(row.front_deg),
        duration=factor * seconds,
        start=row.start,
    )
