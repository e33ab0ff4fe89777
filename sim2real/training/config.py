"""Recipes: hyperparameters of the policies that come with a robot, and their file."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import msgspec

from humanoid_getup.policy.action import ActionSpec, build_posture_spec, choose_actions
from humanoid_getup.policy.contract import Fact
from humanoid_getup.progress.ledger import check_recipe as compare_recipes
from humanoid_getup.simulation.physics_engine import PhysicsName
from robots import Robot
from robots.storage.encoding import as_kept
from robots.storage.files import read_bounded
from robots.storage.validation import MAX_TEXT, shown

STEPS = 20  # policy steps of every robot between two updates


@dataclass(frozen=True, kw_only=True)
class StyleRecipe:
    """Hyperparameters of a training with style curves."""

    falls: float = 0.5
    """Share of episodes that start with a settled fall."""
    named: float = 0.5
    """Share of named styles where an episode does not start along a rise; the others
    follow the curves of rises."""
    motions: float = 0.4
    """Share that starts along a rise; the rest starts standing."""
    restarts: float = 0.0
    """Share of episodes that, after a deviation, continue from there on new curves."""
    height_map: bool = False
    """Whether the policy may observe the ground around it."""


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """Hyperparameters of a training."""

    rewards: str
    """Name of the rewards."""
    randomization: str
    """Name of the domain randomization."""
    wide: bool
    """Whether mirrored joints may also move in opposite directions, and limbs spread."""
    iterations: int
    pwm_limit: float = 1.0
    """PWM limit of the motors as a fraction of the supply, in training and in use."""
    robots: int = 512
    hidden: tuple[int, ...] = (256, 128)
    falls: int = 1024
    """Settled falls in the pool, whose mirror images double it; on terrain, falls on each patch,
    and twice as many on the flat one."""
    terrain: bool = False
    """Whether robots leave flat ground as they succeed."""
    backwards: bool = False
    """Whether episodes begin near the end of the robot's rises first, and earlier with success."""
    discount: float = 0.97
    """At 20.8 Hz a horizon of 1.6 s, most of a rise."""
    desired_kl: float = 0.015
    """The learning rate is reduced above twice this divergence and raised below half of it."""
    entropy: float = 0.002
    """A fifth of rsl-rl's default: the lower limit of the deviation keeps a policy exploring."""
    first_std: float = 1.0
    """Initial standard deviation of exploration, for actions from -1 to 1."""
    most_std: float = 1.5
    """Upper limit of the standard deviation.

    Above 0.4, noise alone commands full speed back and forth; below, updates become smaller
    with it, since their divergence is held constant.
    """
    physics_step: float = 0.006
    """[s]; a coarse step shortens training from nights to minutes."""
    lift: float = 0.8
    """Initial upper limit of the assistive force, as a fraction of the robot's weight.

    A training from scratch needs robots that find a stand by chance, with most of their weight
    supported; for an initial policy that rises, 0.3 bridges the change of conditions.
    """

    physics: PhysicsName = "mujoco"
    """Engine that steps physics; mujoco-warp differs from MuJoCo by single precision."""
    learning_rate: float = 1e-3
    """Initial one; it is adapted to the divergence."""
    style: StyleRecipe | None = None
    """``None`` for a policy that follows no style curves."""

    def choose_actions(self, robot: Robot) -> ActionSpec:
        """Build the action space of the policy, PWM limit included."""
        if self.style is not None:
            return build_posture_spec(robot, self.pwm_limit)
        return choose_actions(robot, self.wide, self.pwm_limit)


QUICK = Recipe(rewards="quick", randomization="torque", wide=False, iterations=500)
# A training from a policy that rises keeps its skill by exploring less.
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
FLAT_STYLE = StyleRecipe(falls=0.5, motions=0.4, named=0.4)
# More noise, or larger steps at first, would destroy what it has imitated.
STYLED = Recipe(
    rewards="styled",
    randomization="torque",
    wide=True,
    iterations=1500,
    hidden=(384, 256),
    entropy=0.0,
    first_std=0.2,
    most_std=0.5,
    learning_rate=5e-5,
    desired_kl=0.025,
    lift=0.2,
    style=FLAT_STYLE,
)
RECIPES = {
    "quick": QUICK,
    # For bodies that do not find a stand by chance: stands are near at first, without a force.
    "backwards": replace(QUICK, backwards=True, lift=0.0),
    "robust": ONWARD,
    # At 0.55 of its supply, an XM430 has 2.25 N·m of its 4.1 N·m at standstill, and 0.55 of
    # its speed: slow motions land softly.
    "gentle": replace(
        ONWARD, rewards="gentle", randomization="mild", iterations=400, pwm_limit=0.55
    ),
    # From `robust`: it rises on flat ground already.
    "rough": replace(
        ONWARD,
        iterations=1000,
        falls=512,
        terrain=True,
        first_std=0.3,
        learning_rate=1e-4,
        lift=0.0,
    ),
    "styled-quick": STYLED,
    "styled": replace(
        STYLED,
        iterations=6000,
        falls=512,
        terrain=True,
        lift=0.0,
        desired_kl=0.04,
        style=StyleRecipe(falls=0.5, motions=0.25, named=0.5, restarts=0.5, height_map=True),
    ),
}

RECIPE = "recipe.json"
"""Name of the file in a training's folder."""
FREE = ("recipe.iterations",)  # may differ: a finished training can be continued


@dataclass(frozen=True, kw_only=True)
class TrainingRecord:
    """Content of a training's recipe file."""

    folder: Path = Path()
    """Folder of the training."""
    robot: str
    """Name of the robot."""
    recipe: Recipe
    seed: int
    actions: tuple[str, ...]
    """Name of each component of an action."""
    rewards: dict[str, float] = field(default_factory=dict)
    """Weight of each reward term."""
    parent: dict[str, Fact] | None = None
    """Training of the initial policy: recipe, seed, iterations, checksum; ``None`` for none."""

    @staticmethod
    def load(folder: Path) -> TrainingRecord:
        """Read the recipe file of a training."""
        file = folder / RECIPE
        try:
            content = read_bounded(file, MAX_TEXT)
            record = msgspec.json.decode(content, type=TrainingRecord)
        except (msgspec.MsgspecError, ValueError, RecursionError) as error:
            raise ValueError(f"{file} is not a recipe of a training: {error}") from error
        return replace(record, folder=folder)

    @property
    def provenance(self) -> dict[str, Fact]:
        """Return the provenance of the policy, for its contract."""
        named = [name for name, recipe in RECIPES.items() if recipe == self.recipe]
        facts: dict[str, Fact] = {"recipe": named[0] if named else "own", "seed": self.seed}
        about = {f"recipe.{key}": value for key, value in vars(self.recipe).items()}
        parent = dict(self.parent or {})
        if "policy" not in parent:  # the checkpoint of a training never ships
            parent.pop("sha256", None)
        about |= {f"parent.{key}": value for key, value in parent.items()}
        plain = str | int | float | bool
        return facts | {k: v if isinstance(v, plain) else shown(v) for k, v in about.items()}


def check_recipe(file: Path, requested: Mapping[str, object]) -> None:
    """Check that a recipe file holds the requested recipe; the error names all that differs."""
    try:
        found = _flatten(json.loads(read_bounded(file, MAX_TEXT)))
    except (ValueError, AttributeError, RecursionError) as error:
        raise ValueError(f"{file} is not a recipe of a training: {error}") from error
    wanted = _flatten(as_kept(requested))
    for key in FREE:
        found.pop(key, None)
        wanted.pop(key, None)
    compare_recipes(file, wanted, found, "another folder begins another training")


def _flatten(record: Mapping[str, object], prefix: str = "") -> dict[str, object]:
    """Flatten nested tables; their keys are joined by dots."""
    flat: dict[str, object] = {}
    for key, value in record.items():
        name = f"{prefix}{key}"
        flat |= _flatten(value, f"{name}.") if isinstance(value, dict) else {name: value}
    return flat
