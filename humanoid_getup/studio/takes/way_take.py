"""Take of the way to a state of a search, and of a motion that was found."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from humanoid_getup.experiments.judging.standing import MIN_NECK_SHARE
from humanoid_getup.studio.takes.rise_take import place_motion
from humanoid_getup.studio.takes.take import Mark, Plot, Take
from robots import quaternion
from robots.kinematics import place_postures
from robots.quaternion import Array
from robots.smooth_step import smooth_step

if TYPE_CHECKING:
    from humanoid_getup.motions.motion import Motion
    from humanoid_getup.simulation.world import World
    from humanoid_getup.studio.search_map import MappedState
    from robots import Posture

MOVE_TIME = 0.6  # s in which a move is shown
SAMPLES = 20  # of a move
ON_LEVEL = "Recorded on level ground: the ground and the obstacles that are drawn were not there."
BETWEEN = "Between resting postures the robot is interpolated, not simulated."


def place_way(world: World, searched: World, state: MappedState, spot: Posture) -> Array:
    """Compute MuJoCo positions along the way of a state, which is put at a spot, (moves + 1, nq).

    Args:
        world: World in which it is shown.
        searched: World of the search.
        state: State.
        spot: Posture in whose place the robot is, once it has reached the state.
    """
    layout = world.robot.layout(searched.model)
    root = state.qpos[:, layout.root_position].copy()
    root[:, :2] += spot.position[:2] - root[state.row, :2]
    attitude, joint_pos = state.qpos[:, layout.root_orientation], state.qpos[:, layout.qpos]
    return place_postures(world.robot, world.model, root, attitude, joint_pos)


def make_way_take(world: World, state: MappedState, way: Array) -> Take:
    """Make the take of the way of a state, MuJoCo positions (moves + 1, nq)."""
    time, at = _spread(state.moves)
    return Take(
        name=f"{state.side}, {state.moves} moves",
        time=time,
        qpos=_blend(world, way, at),
        plots=(
            Plot(
                title="Neck height, share of standing",
                curves={"neck": np.interp(at, np.arange(state.moves + 1.0), state.neck)},
                limit=MIN_NECK_SHARE,
            ),
        ),
        marks=tuple(
            Mark(time=number * MOVE_TIME, text=f"move {number}, {kind}")
            for number, kind in enumerate(state.kinds, start=1)
        ),
        facts=(str(state), BETWEEN),
    )


def make_motion_take(world: World, motion: Motion, start: Array) -> Take:
    """Make the take of a motion as it was recorded; it begins where positions (nq,) are."""
    share = motion.provenance.get("disturbed_success")
    facts = [f"From {motion.start_class}: {motion.strategy}"]
    facts += [] if share is None else [f"Stands in {float(share):.0%} of disturbed worlds"]
    facts += [] if world.scene.is_flat else [ON_LEVEL]
    stand = motion.stand_time
    return Take(
        name=motion.name,
        time=motion.time,
        qpos=place_motion(world, motion, motion.time - motion.time[0], start),
        marks=() if stand is None else (Mark(time=float(motion.time[0]) + stand, text="stands"),),
        facts=tuple(facts),
    )


def _spread(moves: int) -> tuple[Array, Array]:
    """Return the times of samples [s], and where along the moves they are, (T,) each."""
    share = np.linspace(0.0, moves, moves * SAMPLES + 1)
    done = np.floor(share)
    return share * MOVE_TIME, done + smooth_step(share - done)


def _blend(world: World, way: Array, at: Array) -> Array:
    """Interpolate positions (moves + 1, nq) at places along the moves (T,), (T, nq)."""
    before = np.minimum(at.astype(int), max(len(way) - 2, 0))
    after, part = np.minimum(before + 1, len(way) - 1), (at - before)[:, None]
    root = world.robot.layout(world.model).root_orientation
    qpos = (1.0 - part) * way[before] + part * way[after]
    qpos[:, root] = quaternion.slerp(way[before][:, root], way[after][:, root], part[:, 0])
    return qpos
