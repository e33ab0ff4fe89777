"""Reduction of ties without a known drive: motors are welded, outputs and followers stay."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from robots.body.parts import list_way_up
from robots.model_import.source import ActuatorFigures, ModelSource
from robots.model_import.ties import Tie, describe_separate
from robots.model_import.tree import KinematicTree

LIGHT = 0.1  # share of what the output moves, below which a hinge is only its motor's


@dataclass(frozen=True)
class Follower:
    """A hinge without motor that follows another one, as in a parallelogram."""

    joint: str
    leader: str
    ratio: float
    """Turns of the joint per turn of its leader."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """The joints that remain after a reduction of ties."""

    motors: tuple[str, ...]
    """Joints that only turn a motor's shaft, to be welded."""
    actuators: dict[str, ActuatorFigures]
    """Limits of actuators at the remaining joints, by name."""
    followers: tuple[Follower, ...] = ()
    """Joints that remain without servo."""


def reduce_ties(source: ModelSource, tree: KinematicTree, notes: list[str]) -> Reduction:
    """Choose the output of each tie, with its motors' torque and speed there."""
    hinges = {hinge.name: hinge for hinge in tree.hinges}
    motors, followers = list[str](), list[Follower]()
    actuators = dict(source.actuators)
    loops = [loop for bodies in source.loops if (loop := _open_loop(tree, bodies, notes))]
    for tie in (*source.ties, *loops):
        if not set(tie.joints) <= hinges.keys():
            continue
        mass = [float(tree.model.body_subtreemass[hinges[j].body]) for j in tie.joints]
        output = max(range(len(mass)), key=mass.__getitem__)
        drives = [k for k in range(len(mass)) if mass[k] < LIGHT * mass[output]]
        if not drives and tie in source.ties and (follower := _find_follower(tie, source)):
            followers.append(follower)
            continue
        _describe(tie, output, drives, notes)
        motors += [tie.joints[k] for k in drives]
        name = tie.joints[output]
        if name not in source.actuators:
            known = [k for k in drives if tie.joints[k] in source.actuators]
            if known:
                actuators[name] = _combine(tie, output, known, source)
    return Reduction(
        tuple(dict.fromkeys(motors)), actuators, tuple(_sort_out(followers, motors, notes))
    )


def _sort_out(
    followers: Sequence[Follower], motors: Sequence[str], notes: list[str]
) -> Iterator[Follower]:
    known = set(motors)
    for each in followers:
        if {each.joint, each.leader} & {*motors}:
            notes.append(describe_separate((each.joint, each.leader)))
        elif each.joint not in known:
            known.add(each.joint)
            notes.append(
                f"joint {each.joint} follows {each.leader} ({each.ratio:.3g} turns to one) and has "
                "no servo"
            )
            yield each


def _find_follower(tie: Tie, source: ModelSource) -> Follower | None:
    """Find the joint without actuator of a pair whose other one has one."""
    driven = [k for k, joint in enumerate(tie.joints) if joint in source.actuators]
    if len(tie.joints) != 2 or len(driven) != 1:
        return None
    leader, follower = driven[0], 1 - driven[0]
    ratio = -tie.shares[leader] / tie.shares[follower]
    return Follower(tie.joints[follower], tie.joints[leader], ratio)


def _open_loop(tree: KinematicTree, bodies: tuple[int, int], notes: list[str]) -> Tie | None:
    """Open a closed loop; its hinges are assumed to be those of a parallelogram."""
    moved = {*list_way_up(tree.model, bodies[0])} ^ {*list_way_up(tree.model, bodies[1])}
    loop = [hinge.name for hinge in tree.hinges if hinge.body in moved]
    names = [tree.model.body(body).name for body in bodies]
    notes.append(
        f"the closed loop that joins {names[0]} and {names[1]} is open: its joints turn alike, as "
        "in a parallelogram; if the loop is another one, the robot moves differently here"
    )
    return Tie(tuple(sorted(loop)), (1.0,) * len(loop)) if len(loop) > 1 else None


def _describe(tie: Tie, output: int, drives: Sequence[int], notes: list[str]) -> None:
    name = tie.joints[output]
    if drives:
        driven = ", ".join(
            f"{tie.joints[k]} ({abs(tie.shares[output] / tie.shares[k]):.3g} turns to one)"
            for k in drives
        )
        notes.append(f"joint {name} is driven by {driven}, welded here: its servo turns the output")
    else:
        notes.append(describe_separate(tie.joints))


def _combine(tie: Tie, output: int, drives: Sequence[int], source: ModelSource) -> ActuatorFigures:
    """Convert the limits of motors to the output; the weakest motor limits it."""
    gears = [abs(tie.shares[output] / tie.shares[k]) for k in drives]
    figures = [source.actuators[tie.joints[k]] for k in drives]
    rows = list(zip(figures, gears, strict=True))
    efforts = [f.effort * gear for f, gear in rows if f.effort is not None]
    speeds = [f.speed / gear for f, gear in rows if f.speed is not None]
    return ActuatorFigures(effort=min(efforts, default=None), speed=min(speeds, default=None))
