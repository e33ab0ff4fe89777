"""Options of `getup motions discover`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from tyro.conf import Positional

from humanoid_getup.cli.checks import at_least
from humanoid_getup.cli.options.shared import Count, PolicyName, RobotOption, Seed


@dataclass(frozen=True, kw_only=True)
class DiscoverMotions(RobotOption):
    """Make motions from what a learned policy does: its rises are played without it, as smooth as
    they bear, in disturbed worlds; the best of each strategy is kept."""

    policy: Positional[PolicyName]
    robot: str = ""
    """Name of a robot, or a folder with a robot.toml; default: the policy file's robot."""
    rises: Annotated[int, at_least(2)] = 48
    """Rises from each side: supine, prone and left."""
    most: Count = 3
    """Motions from each side, of different strategies."""
    seed: Seed = 0
