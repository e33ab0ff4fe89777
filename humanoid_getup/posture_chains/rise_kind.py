"""Kinds of rises: named by the postures that a robot passes, grouped by the way it takes."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np
import scipy  # which imports its parts when they are used

from humanoid_getup.experiments.falls import classify
from humanoid_getup.motions.motion import FOUND, Motion
from humanoid_getup.motions.trial import Trial
from humanoid_getup.posture_chains.features import StandMeter
from humanoid_getup.simulation.world import World
from robots.body.limbs import ARMS, LEGS, Limbs
from robots.body.parts import leg_length
from robots.quaternion import Array, rotate

SAMPLES = 24  # of each rise, from lying to the stand
SAME_WAY = 0.35  # rad RMS between the joint angles of rises that take the same way
SEEN_TIME = 0.15  # s for which a robot must be in a posture that its kind is named after
LOW, LIFTED = 0.2, 0.4  # leg lengths over the ground: a hand or knee on it, hips above it
ON_SOLES, CROUCHED, BALANCED = 0.66, 0.9, 0.4  # flatness, neck height, offset of a squat
LEANING, SITTING = 0.3, 0.5  # vertical in the torso's frame: forward of all fours, up of a seat
PASSING = "passing"


class KindNamer:
    """Names the postures that one robot passes on its way up."""

    def __init__(self, world: World) -> None:
        self._world, self._meter = world, StandMeter(world)
        self._layout, self._limbs = world.robot.layout(world.model), Limbs(world.robot)
        self._leg = leg_length(world.robot)

    def name(self, qpos: Array, start_class: str) -> str:
        """Name the postures after the start in MuJoCo positions, one a control period, (T, nq)."""
        step = max(round(SEEN_TIME / self._world.robot.control_period / 3.0), 1)
        names = self._list_names(qpos[::step])
        seen = [name for name, run in groupby(names) if len([*run]) >= 3]
        seen = [name for name in seen if name not in (PASSING, start_class)]
        return ", ".join(dict.fromkeys(seen))

    def name_strategy(self, trial: Trial) -> str:
        """Name the strategy of a rise that was found in physics, such as "found, over kneel"."""
        period, stand = self._world.robot.control_period, float(trial.stand.start_time)
        risen = trial.outcome.qpos[: max(round(stand / period), 1)]
        passed = self.name(risen, trial.keyframes.start_class)
        return FOUND + (f", over {passed}" if passed else "")

    def _list_names(self, qpos: Array) -> list[str]:
        """Name each posture in MuJoCo positions, (T, nq)."""
        features = self._meter.measure(qpos)
        on_soles = (features.flatness > ON_SOLES) & (features.offset < BALANCED)
        squats = on_soles & (features.neck < CROUCHED)
        names = []
        for k, row in enumerate(qpos):
            if on_soles[k]:
                names.append("squat" if squats[k] else PASSING)
            else:
                names.append(self._name_down(row, features.up[k]))
        return names

    def _name_down(self, qpos: Array, up: Array) -> str:
        """Name a posture that is not on flat soles; ``up`` is the vertical in its torso's frame."""
        hip, knee, hand = self._measure(qpos)
        if abs(up[0]) > LEANING and hip > LIFTED and hand < LOW:
            return "all fours" if up[0] < 0.0 else "bridge"
        if up[2] > SITTING:
            return "kneel" if knee < LOW and hip > LIFTED else "sit" if hip < LIFTED else PASSING
        return classify(qpos[self._layout.root_orientation]) or PASSING

    def _measure(self, qpos: Array) -> tuple[float, float, float]:
        """Measure the lowest hip, knee and hand over the ground [leg lengths]."""
        limbs, layout = self._limbs, self._layout
        limbs.look(qpos[layout.qpos])
        legs = [limbs.all[name] for name in LEGS]
        hips = [limbs.anchor(leg.start) for leg in legs]
        knees = [limbs.anchor(leg.middle) for leg in legs]
        hands = [limbs.find_end(limbs.all[name]) for name in ARMS if name in limbs.all]
        return self._low(qpos, hips), self._low(qpos, knees), self._low(qpos, hands)

    def _low(self, qpos: Array, points: list[Array]) -> float:
        """Return how high the lowest of some points of the torso's frame is [leg lengths]."""
        if not points:
            return np.inf
        layout = self._layout
        turned = rotate(qpos[layout.root_orientation], np.array(points))
        world = qpos[layout.root_position] + turned
        return float((world[:, 2] - self._world.scene.support(world)).min()) / self._leg


def sample_way(motion: Motion) -> Array:
    """Sample the joint angles of a motion at equal shares of its way up, (SAMPLES, n)."""
    stand = motion.duration if motion.stand_time is None else motion.stand_time
    last = int(np.searchsorted(motion.time, motion.time[0] + stand))
    return sample_rows(motion.joint_pos[: max(last, 1)])


def sample_rows(joint_pos: Array) -> Array:
    """Sample joint angles (T, n) at equal shares of their time, (SAMPLES, n)."""
    return joint_pos[np.linspace(0, len(joint_pos) - 1, SAMPLES).round().astype(int)]


def are_same(way: Array, other: Array) -> bool:
    """Tell whether two rises (SAMPLES, n) take the same way."""
    return bool(np.sqrt(np.mean((way - other) ** 2)) < SAME_WAY)


def label_ways(ways: Sequence[Array]) -> list[int]:
    """Label rises, (SAMPLES, n) each; those with the same label differ little on average."""
    if len(ways) < 2:
        return [1] * len(ways)
    rows = np.array([way.ravel() for way in ways])
    return scipy.cluster.hierarchy.fcluster(
        scipy.cluster.hierarchy.linkage(rows, "average"),
        SAME_WAY * np.sqrt(rows.shape[1]),
        "distance",
    ).tolist()
