"""Names of joints in other projects, and the joints of a robot that they mean."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

from humanoid_getup.policy.foreign.description import ForeignPolicyError
from robots import Robot

SIDES = {"left": "l", "right": "r"}
EMPTY = ("joint", "dof", "motor", "act", "actuator", "")  # words that tell nothing


def map_joints(
    names: Sequence[str], robot: Robot, renamed: Mapping[str, str] | None = None
) -> dict[str, int]:
    """Find the joints of a robot that names mean: the same ones, but for words for the sides.

    Args:
        names: Names of joints elsewhere.
        robot: Robot whose joints they mean.
        renamed: Names of the robot's joints by those elsewhere, which count more.

    Raises:
        ForeignPolicyError: naming every joint that the robot does not have, or has once for two
            names.
    """
    renamed, own = renamed or {}, robot.joint_names
    if strange := [name for name in renamed.values() if name not in own]:
        raise ForeignPolicyError(
            f"--rename names {', '.join(strange)}, expected joints of robot '{robot.name}': "
            f"{', '.join(own)}"
        )
    known = {_simplify(name): name for name in own} | {(name,): name for name in own}
    found = {
        name: renamed.get(name) or known.get((name,)) or known.get(_simplify(name))
        for name in names
    }
    problems = []
    if lacking := [name for name, joint in found.items() if joint is None]:
        problems.append(
            f"robot '{robot.name}' has no {', '.join(lacking)}, expected {', '.join(own)}; "
            "--rename THEIRS=OURS,... says which are the same"
        )
    joints = [joint for joint in found.values() if joint is not None]
    if len(found) < len(names) or len(set(joints)) < len(joints):
        twice = sorted({joint for joint in joints if joints.count(joint) > 1})
        problems.append(f"two names mean one joint: {', '.join(twice or names)}")
    if problems:
        raise ForeignPolicyError("; ".join(problems))
    return {name: own.index(joint) for name, joint in found.items() if joint is not None}


def _simplify(name: str) -> tuple[str, ...]:
    """Return the words of a name behind that of a model: lower case, sides as letters in front."""
    plain = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name.rpartition("/")[2]).lower()
    words = [SIDES.get(word, word) for word in re.split(r"[_\-. ]+", plain)]
    kept = [word for word in words if word not in EMPTY]
    return tuple(sorted(kept, key=lambda word: word not in SIDES.values()))
