"""Recipes: hyperparameters of the policies that come with a robot, and their file."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from humanoid_getup.policy.action import ActionSpec, choose_actions
from robots import Robot
from robots.files import write_atomically
from robots.validation import shown

STEPS = 20  # policy steps of every robot between two updates


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """How a policy is trained."""

    rewards: str
    randomization: str
    """By name."""
    wide: bool
    """Whether mirrored joints may also move contrary to each other, and limbs spread."""
    iterations: int
    pwm_limit: float = 1.0
    """Largest share of the supply that the motors get, in training and wherever it runs."""
    robots: int = 512
    hidden: tuple[int, ...] = (256, 128)
    falls: int = 1024
    """Settled falls in the pool; their mirror images double it."""
    discount: float = 0.97
    """At 20.8 Hz a horizon of 1.6 s, most of a way up."""
    desired_kl: float = 0.015
    """The step size shrinks above twice this divergence, and grows below half of it."""
    entropy: float = 0.002
    """A fifth of rsl-rl's default: the smallest deviation keeps a policy exploring."""
    first_std: float = 1.0
    most_std: float = 1.5
    """Largest standard deviation of exploration, for actions from -1 to 1.

    Above 0.4 noise alone commands full speed back and forth; below, what is learned in an
    update shrinks with it, since its divergence is held constant.
    """
    physics_step: float = 0.006
    """[s]; a coarse one shortens training from nights to minutes."""
    lift: float = 0.8
    """Assistive force at the beginning, as the largest share of the robot's weight.

    A robot of which most is carried finds standing by chance, which a training from scratch
    needs; for one that begins with a policy that rises, 0.3 bridges the change of conditions.
    """

    def choose_actions(self, robot: Robot) -> ActionSpec:
        """Build the action space of the policy, and its limit on the servos."""
        return choose_actions(robot, self.wide, self.pwm_limit)


# A training that continues from a policy that rises keeps its skill and explores less.
ONWARD = Recipe(
    rewards="robust",
    randomization="all",
    wide=True,
    iterations=1700,
    falls=2048,
    entropy=0.0,
    most_std=0.45,
    lift=0.3,
)
RECIPES = {
    "quick": Recipe(rewards="quick", randomization="torque", wide=False, iterations=500),
    "robust": ONWARD,
    # A servo that may use 0.55 of its supply has 2.25 N·m left of the XM430's 4.1 at
    # standstill, and turns at 0.55 of its speed: slow motions land softly.
    "gentle": replace(
        ONWARD, rewards="gentle", randomization="mild", iterations=400, pwm_limit=0.55
    ),
}

RECIPE = "recipe.json"
"""Name of the file in a training's folder."""
FREE = ("recipe.iterations",)  # may change: a finished training can be continued


class OtherTrainingError(ValueError):
    """A folder holds another training than the requested one."""


def settle_recipe(file: Path, asked: dict[str, Any]) -> None:
    """Write the recipe file; if there is one already, check that it is the same.

    Raises:
        OtherTrainingError: naming all that differs.
    """
    if file.exists():
        check_recipe(file, asked)
    write_atomically(file, json.dumps(asked, indent=1) + "\n")


def check_recipe(file: Path, asked: dict[str, Any]) -> None:
    """Check that a recipe file holds the requested training.

    Raises:
        OtherTrainingError: naming all that differs.
    """
    try:
        found = _flatten(json.loads(file.read_text("utf-8")))
    except (ValueError, AttributeError) as error:
        raise OtherTrainingError(f"{file} is not a recipe of a training: {error}") from error
    wanted = _flatten(json.loads(json.dumps(asked)))
    differences = [
        f"{key} is {shown(found.get(key))} there, expected {shown(wanted.get(key))}"
        for key in sorted(found.keys() | wanted.keys())
        if key not in FREE and found.get(key) != wanted.get(key)
    ]
    if differences:
        raise OtherTrainingError(f"{file.parent} holds another training: {'; '.join(differences)}")


def _flatten(record: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    """Turn tables within tables into one, its keys joined by dots."""
    flat: dict[str, Any] = {}
    for key, value in record.items():
        name = f"{prefix}{key}"
        flat |= _flatten(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return flat
