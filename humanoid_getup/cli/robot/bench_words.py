"""Servos on a bench as a command line names them: `--servos` and `--load`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from difflib import get_close_matches

from drivers.dynamixel.control_table import table_named, table_names, types_of
from humanoid_getup.commands.errors import refusing
from robots import Joint
from robots.bench import BARE, Load, ServoBench, make_bench, make_bench_joint
from robots.description.bench_table import MAX_ARM, MAX_MASS
from robots.description.servo_catalog import servo_models


def build_bench(words: Sequence[str], load: str | None) -> ServoBench:
    """Build the bench whose servos and load a command gives.

    Raises:
        BadInputError: if a model or an id is unknown, an id is given twice, or the load is none.
    """
    with refusing():
        servos = list_bench_servos(words)
        hanging = BARE if load is None else parse_load(load)
        table = table_named(servos[0].servo.model.name)
        shipped = table.bauds[table["baud_rate"].default or 0]
        return make_bench(servos, baud=shipped, loads=[hanging] * len(servos))


def list_bench_servos(words: Sequence[str]) -> list[Joint]:
    """List the servos that words name: MODEL:ID, or the ID of another one of the same model.

    Raises:
        ValueError: if a word names none, or an id is given twice.
    """
    joints: list[Joint] = []
    model = ""
    for word in words:
        before, colon, number = word.rpartition(":")
        model = _find_type(before) if colon else model
        if model not in servo_models():
            raise ValueError(
                f"--servos has '{word}', expected MODEL:ID with a model of {_list_near(model)}"
            )
        figures = servo_models()[model]
        if not number.isdecimal() or int(number) > figures.max_id:
            raise ValueError(f"--servos has '{word}', expected an id from 0 to {figures.max_id}")
        joints.append(make_bench_joint(figures, int(number)))
    ids = [joint.servo.id for joint in joints]
    if twice := [i for i in ids if ids.count(i) > 1]:
        raise ValueError(f"--servos has the id {twice[0]} twice, expected each once")
    return joints


def _list_near(name: str) -> str:
    """List the models whose names are nearest to one, or all if none is near."""
    return ", ".join(get_close_matches(name.upper(), servo_models(), n=3) or servo_models())


def _find_type(name: str) -> str:
    """Return the type of a name, or the first with the control table of a model of that name."""
    known = servo_models()
    if name in known or name not in table_names():
        return name
    return next((each for each in types_of(table_named(name)) if each in known), name)


def parse_load(text: str) -> Load:
    """Read a load written as KG:M.

    Raises:
        ValueError: if it is none.
    """
    try:
        mass, arm = map(float, text.split(":"))
    except ValueError:
        mass, arm = math.nan, math.nan
    if not (0.0 <= mass <= MAX_MASS and 0.0 < arm <= MAX_ARM):
        raise ValueError(
            f"--load is '{text}', expected KG:M, a mass of 0 to {MAX_MASS:g} kg and its distance "
            f"from the horn, up to {MAX_ARM:g} m, such as 0.2:0.1"
        )
    return Load(mass=mass, arm=arm)
