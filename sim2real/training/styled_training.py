"""Files of a training with style curves, and the named curves that it follows."""

from __future__ import annotations

import math
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from humanoid_getup.policy.action import ActionSpec
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.style import list_styles, load_style
from robots import Robot
from robots.body.parts import leg_length
from robots.storage.files import atomic_path
from sim2real.environment.action_heads import PriorHead
from sim2real.pose_prior import PosePrior, RiseSet
from sim2real.training.policy_parent import check_decoder, is_policy_file

PRIOR, RISES = "prior.npz", "rises.npz"
"""Files of a pose prior's folder, which a training keeps copies of."""
DURATIONS, LEGS = (2.5, 5.1, 7.6), 0.9  # s that a person of such legs [m] takes in [Frezzato22]


def check_prior(robot: Robot, prior: Path | None, parent: Path | None, folder: Path) -> Path:
    """Find the folder with the prior of a training, and check its content.

    That is the one that is given, or else the parent's, or else the training's own.
    """
    is_folder = parent is not None and not is_policy_file(parent)
    source = prior or (parent if is_folder and parent else folder)
    missing = [name for name in (PRIOR, RISES) if not (source / name).exists()]
    if missing:
        raise ValueError(
            f"{source} has no {missing[0]}, expected --prior with the folder of `getup prior`"
        )
    for name in (PRIOR, RISES):
        _check_kept(source / name, folder / name)
    found = PosePrior.load(source / PRIOR, robot)
    RiseSet.load(source / RISES, robot)
    if parent is not None and not is_folder:
        check_decoder(parent, found)
    elif parent is not None and (parent / PRIOR).read_bytes() != (source / PRIOR).read_bytes():
        raise ValueError(f"{source / PRIOR} is another prior than that of {parent}")
    return source


def keep_prior(prior: Path, folder: Path) -> None:
    """Copy the files of a pose prior into the folder of a training that has none yet."""
    for name in (PRIOR, RISES):
        kept = folder / name
        _check_kept(prior / name, kept)
        if not kept.exists():
            with atomic_path(kept) as partial:
                shutil.copyfile(prior / name, partial)


def _check_kept(file: Path, kept: Path) -> None:
    """Check that a training's copy of a file, if there is one, is the same."""
    if kept.exists() and kept.read_bytes() != file.read_bytes():
        raise ValueError(f"{kept} is another file than {file}")


def load_head(robot: Robot, action: ActionSpec, folder: Path) -> PriorHead:
    """Load the pose prior of a training."""
    return PriorHead(action, PosePrior.load(folder / PRIOR, robot))


def list_named_curves(robot: Robot) -> Iterator[StyleCurves]:
    """List the named styles' curves and their mirror images.

    Their durations are their own, and all but the shortest of the paper's.
    """
    scale = math.sqrt(leg_length(robot) / LEGS)
    for name in list_styles():
        for curve in load_style(name, robot).curves:
            # The shortest is beyond what position servos of a small robot can follow.
            for duration in {curve.duration, *(scale * duration for duration in DURATIONS[1:])}:
                timed = curve.lasting(duration)
                yield timed
                if not np.allclose(timed.side, np.pi / 2):
                    yield timed.mirrored()
