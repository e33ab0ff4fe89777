"""OP3's stored motions as parameters of a test."""

from collections.abc import Iterable

import pytest

from humanoid_getup.motions.motion import MIRRORED_SUFFIX, Motion
from humanoid_getup.motions.motion_database import load_database
from robots import load_robot

MOTIONS: dict[str, Motion] = {
    motion.name: motion for motion in load_database(load_robot("op3")).motions
}
OWN = [name for name in MOTIONS if not name.endswith(MIRRORED_SUFFIX)]


def one_of_each_kind(names: Iterable[str]) -> list:
    """Give a test one motion of each start class and end; the others are slow tests."""
    seen, parameters = set(), []
    for name in names:
        kind = (MOTIONS[name].start_class, MOTIONS[name].end_class)
        parameters.append(pytest.param(name, marks=pytest.mark.slow if kind in seen else ()))
        seen.add(kind)
    assert parameters
    return parameters
