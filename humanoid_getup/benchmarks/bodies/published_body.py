"""Bodies that others published, with the success of their own policies there.

The figures are those of analysis/special.csv and analysis/loo.csv of the repository: one number a
training seed, each the share of 100 episodes. Heights are those of its standup_env.py.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

REPOSITORY = "github.com/utra-robosoccer/unified-humanoid-getup"
COMMIT = "2d64e11"
PAPER = "Spraggett, Learning to Get Up Across Morphologies, arXiv 2512.12230, 2025"
EPISODES = 100
"""Of each training seed."""
PACKAGE = "unified_humanoid_get_up_env"
STARTS_FILE = "standup_initial_configurations.pkl"
HEAD, FEET = "camera", ("left_foot", "right_foot")
"""Sites of the models whose heights are compared."""


@dataclass(frozen=True, kw_only=True)
class PublishedBody:
    """A body, and the shares of episodes in which its makers' policies stood."""

    name: str
    head_height: float
    """Of the standing robot, above the middle of its feet [m]."""
    specialists: tuple[float, ...]
    """Of policies trained on it, by training seed."""
    unseen: tuple[float, ...]
    """Of policies trained on the six other bodies, by training seed."""

    def find_model(self, folder: Path) -> Path:
        """Return its model file in a copy of the repository."""
        return folder / PACKAGE / "mujoco_simulator" / "model" / f"{self.name}.xml"

    def find_starts(self, folder: Path) -> Path:
        """Return its start states in a copy of the repository."""
        return folder / PACKAGE / "env" / self.name / STARTS_FILE


PUBLISHED = (
    PublishedBody(
        name="bez1",
        head_height=0.4808,
        specialists=(0.38, 0.97, 0.00, 0.95, 0.96, 0.00, 0.95, 0.96, 0.96, 0.94),
        unseen=(0.58, 0.19, 0.23, 0.06, 0.12, 0.13, 0.06, 0.18, 0.03, 0.43),
    ),
    PublishedBody(
        name="bez2",
        head_height=0.54,
        specialists=(0.98, 0.98, 0.97, 0.98, 0.98, 0.98, 0.98, 0.98, 0.97, 0.98),
        unseen=(0.51, 0.03, 0.10, 0.14, 0.49, 0.26, 0.39, 0.49, 0.56, 0.44),
    ),
    PublishedBody(
        name="bez3",
        head_height=0.62,
        specialists=(0.95, 0.95, 0.94, 0.94, 0.95, 0.95, 0.95, 0.95, 0.95, 0.94),
        unseen=(0.05, 0.17, 0.65, 0.13, 0.21, 0.17, 0.16, 0.03, 0.06, 0.10),
    ),
    PublishedBody(
        name="nugus",
        head_height=0.8087,
        specialists=(0.00, 0.00, 0.00, 0.00, 0.00, 0.00, 0.01, 0.92, 0.00, 0.00),
        unseen=(0.22, 0.18, 0.75, 0.58, 0.14, 0.34, 0.49, 0.32, 0.03, 0.32),
    ),
    PublishedBody(
        name="op3_rot",
        head_height=0.492,
        specialists=(0.93, 0.90, 0.92, 0.92, 0.91, 0.93, 0.90, 0.90, 0.92, 0.91),
        unseen=(0.08, 0.40, 0.39, 0.14, 0.27, 0.54, 0.42, 0.62, 0.38, 0.29),
    ),
    PublishedBody(
        name="sigmaban",
        head_height=0.67,
        specialists=(1.00, 1.00, 1.00, 1.00, 1.00, 0.60, 0.97, 1.00, 1.00, 1.00),
        unseen=(0.71, 0.49, 0.32, 0.32, 0.44, 0.28, 0.43, 0.44, 0.20, 0.56),
    ),
    PublishedBody(
        name="wolfgang",
        head_height=0.7673,
        specialists=(0.92, 0.92, 0.93, 0.93, 0.93, 0.90, 0.93, 0.93, 0.93, 0.93),
        unseen=(0.92, 0.86, 0.58, 0.75, 0.30, 0.86, 0.87, 0.92, 0.51, 0.68),
    ),
)
"""The bodies of the repository."""
