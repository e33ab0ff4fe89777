"""Random moves: where the servos' targets go from a resting posture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Self

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.posture_chains.resting_state import PostureMove, RestingState
from robots import Posture, Robot, quaternion
from robots.body.drawn_postures import Prop, draw_crouches, draw_props
from robots.body.limbs import LEGS, Limbs
from robots.body.squats import fit_stance, list_squats
from robots.body.statics import Statics
from robots.quaternion import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class BalancedPostures:
    """Postures on flat soles, or hands as well, and the targets with which servos hold them."""

    postures: tuple[Posture, ...]
    """On the ground z = 0, their soles level."""
    targets: Array
    """(K, n) [rad]"""

    @classmethod
    def at(cls, robot: Robot, joint_pos: Sequence[Array], statics: Statics) -> Self:
        """Set a robot at each of K joint angles (n,) [rad] on its soles."""
        return cls.of_props(robot, [Prop(joint_pos=angles) for angles in joint_pos], statics)

    @classmethod
    def of_props(cls, robot: Robot, props: Sequence[Prop], statics: Statics) -> Self:
        """Set a robot on its soles and hands."""
        targets = [statics.find_targets(each.joint_pos, each.hands, each.share) for each in props]
        return cls(
            postures=tuple(statics.make_posture(each.joint_pos) for each in props),
            targets=np.array(targets).reshape(-1, robot.n),
        )

    def __len__(self) -> int:
        return len(self.postures)


DURATIONS, DURATION_SHARES = (0.35, 0.6, 1.0), (0.45, 0.35, 0.2)  # s for OP3
SPEED_SHARE, MOST_SPEED = 0.8, 4.8  # of the servos' speed, and rad/s; of targets on average
SPREADS = (0.2, 0.5, 1.0)  # rad, standard deviation of a random change of joints
PAIRED, SINGLE = (0.15, 0.3, 0.6), (0.1, 0.25, 0.5)  # shares of joints that change
HOMEWARD = (0.3, 0.6, 1.0)  # shares of the way to the stance
EVEN = 0.5  # probability that both legs move to a squat alike
ARMS_TOO = 0.3  # probability that arms and head move to the squat's, too
SYMMETRIC = 0.6  # probability that a random posture is symmetric
KEPT = 0.4  # probability that a limb does not go towards the stance
PAIRED_LIMBS = 0.7  # probability that its partner goes with a limb that does
SQUAT_SPREAD = 0.08  # rad
CROUCHES, PROPS, NEAR = 120, 90, 16  # that are drawn for a robot, and those near to a posture
ALL_CROUCH = 0.5  # probability that arms and head move to the crouch's, too
BOTH_FOLD = 0.75  # probability that both legs fold alike, rather than one
ANYWHERE = (0.2, 0.7)  # of the way from the stance to a random posture


class RandomMoves:
    """Draws targets to move to, of several kinds; each kind with a share of its own."""

    def __init__(
        self,
        robot: Robot,
        rng: np.random.Generator | None,
        footing: Array = quaternion.IDENTITY,
    ) -> None:
        """Prepare for a robot; without a generator, one that is not to come to its feet.

        Its soles have an orientation ``footing`` (4,) when it stands.

        Raises:
            ValueError: if its legs cannot stand so.
        """
        self._robot = robot
        statics = Statics(robot, footing)
        up = statics.up
        self._speed = np.minimum(SPEED_SHARE * robot.max_velocity, MOST_SPEED)
        limbs = Limbs(robot)
        self._groups = _group(limbs)
        self._legs = np.array(sorted(k for name in LEGS for k in limbs.all[name].joints))
        self._limbs = np.array(sorted(k for limb in limbs.all.values() for k in limb.joints))
        limbs.look(robot.standing.joint_pos)
        self._bending = [np.array(limbs.leg(name).list_pitch()) for name in LEGS]
        self.standing, self.stance = robot.standing, robot.standing.joint_pos
        """The robot in its stance, and the targets that hold it there [rad], (n,)."""
        if up[0]:
            fitted = fit_stance(limbs, up)
            if fitted is None:
                raise ValueError("the legs cannot stand on such soles")
            self.standing, self.stance = statics.make_posture(fitted), statics.find_targets(fitted)
        squats = [] if rng is None else list_squats(limbs, statics)
        self.squats = BalancedPostures.at(robot, [squat.joint_pos for squat in squats], statics)
        """Balanced squats from high to deep, Q of them."""
        self.squat_necks = np.array([squat.neck_share for squat in squats])
        """Heights of their necks as shares of that of the stance, (Q,)."""
        crouches = [] if rng is None else list(draw_crouches(limbs, CROUCHES, rng, up))
        self.crouches = BalancedPostures.at(robot, crouches, statics)
        """Other balanced postures on flat soles."""
        props = [] if rng is None else draw_props(limbs, PROPS, rng, up)
        self.props = BalancedPostures.of_props(robot, props, statics)
        """Postures on flat soles and both hands."""
        kinds: dict[str, tuple[float, Callable[[Array, np.random.Generator], Array]]] = {
            "mirrored joints": (0.30, self._change_pairs),
            "joints": (0.12, self._change_joints),
            "limb": (0.13, self._move_limb),
            "limbs": (0.13, partial(self._move_limb, paired=True)),
            "folded legs": (0.15 if all(map(len, self._bending)) else 0.0, self._fold_legs),
            "homeward": (0.12, self._go_homeward),
            "squat": (0.10 if squats else 0.0, self._squat),
            "crouch": (0.12 if len(self.crouches) else 0.0, self._crouch),
            "prop": (0.10 if len(self.props) else 0.0, self._prop),
            "anywhere": (0.08, self._go_anywhere),
        }
        self.kinds, self._draw = tuple(kinds), [draw for _, draw in kinds.values()]
        share = np.array([share for share, _ in kinds.values()])
        self.shares = share / share.sum()

    def draw_all(
        self, states: Sequence[RestingState], scale: float, rng: np.random.Generator
    ) -> list[PostureMove]:
        """Draw a move from each state, all of one duration, which is scaled."""
        duration = float(rng.choice(DURATIONS, p=DURATION_SHARES)) * scale
        reach, moves = self._speed * duration, []
        for state in states:
            drawn, kind = self.draw(state.target, rng)
            drawn = state.target + np.clip(drawn - state.target, -reach, reach)
            moves.append(PostureMove(knots=drawn[None], duration=duration, kind=kind))
        return moves

    def rise(self, higher: Array, duration: float) -> PostureMove:
        """Make the move to the stance through targets of higher squats (k, n), high to deep."""
        knots = np.vstack([higher[::-1], self.stance])
        kind = "squats" if len(higher) else "stance"
        return PostureMove(knots=knots, duration=duration, kind=kind)

    def least_duration(self, before: Array, after: Array) -> float:
        """Return the shortest time between targets (n,) [s]."""
        return float((np.abs(after - before) / self._speed).max())

    def aim(self, before: Array, after: Array, time: float, kind: str) -> PostureMove:
        """Make the move between targets (n,) in a time [s], or in the shortest possible."""
        duration = max(self.least_duration(before, after), time)
        return PostureMove(knots=after[None], duration=duration, kind=kind)

    def draw(self, target: Array, rng: np.random.Generator) -> tuple[Array, str]:
        """Draw targets (n,) to go to from those that are held, and name the kind of move."""
        kind = int(rng.choice(len(self.kinds), p=self.shares))
        drawn = self._draw[kind](target, rng)
        return np.clip(drawn, self._robot.lower, self._robot.upper), self.kinds[kind]

    def _change_pairs(self, target: Array, rng: np.random.Generator) -> Array:
        change = self._change(PAIRED, rng)
        return target + (change + self._robot.mirror_joints(change)) / np.sqrt(2.0)

    def _change_joints(self, target: Array, rng: np.random.Generator) -> Array:
        return target + self._change(SINGLE, rng)

    def _change(self, shares: tuple[float, ...], rng: np.random.Generator) -> Array:
        chosen = rng.random(self._robot.n) < rng.choice(shares)
        return chosen * rng.normal(scale=rng.choice(SPREADS), size=self._robot.n)

    def _move_limb(self, target: Array, rng: np.random.Generator, *, paired: bool = False) -> Array:
        group = self._groups[int(rng.integers(len(self._groups)))]
        moved = target.copy()
        moved[group] = self._draw_anywhere(rng)[group]
        return self._mirror(moved, group) if paired else moved

    def _mirror(self, moved: Array, group: NDArray[np.int_]) -> Array:
        """Move the partners of joints likewise."""
        partner = self._robot.mirror_index[group]
        moved[partner] = self._robot.mirror_joints(moved)[partner]
        return moved

    def _fold_legs(self, target: Array, rng: np.random.Generator) -> Array:
        """Bend legs within their plane: hip, knee and ankle anywhere, all else as in the stance."""
        bent, moved = self.stance.copy(), target.copy()
        leg = self._bending[int(rng.integers(len(self._bending)))]
        bent[leg] = self._draw_anywhere(rng)[leg]
        group = next(group for group in self._groups if leg[0] in group)
        moved[group] = bent[group]
        return self._mirror(moved, group) if rng.random() < BOTH_FOLD else moved

    def _go_homeward(self, target: Array, rng: np.random.Generator) -> Array:
        share, moved = rng.choice(HOMEWARD), target.copy()
        home = target + share * (self.stance - target)
        for group in self._groups:
            if rng.random() >= KEPT:
                moved[group] = home[group]
                if rng.random() < PAIRED_LIMBS:
                    partner = self._robot.mirror_index[group]
                    moved[partner] = home[partner]
        return moved

    def _squat(self, target: Array, rng: np.random.Generator) -> Array:
        squat = self.squats.targets[int(rng.integers(len(self.squats)))]
        moved, legs = target.copy(), self._legs
        moved[legs] = squat[legs] + rng.normal(scale=SQUAT_SPREAD, size=len(legs))
        if rng.random() < EVEN:
            moved[legs] = self._robot.symmetrize(moved)[legs]
        if rng.random() < ARMS_TOO:
            others = np.setdiff1d(np.arange(self._robot.n), legs)
            moved[others] = squat[others]
        return moved

    def _crouch(self, target: Array, rng: np.random.Generator) -> Array:
        """Move the legs to a crouch near their angles; often all else, too."""
        legs = self._legs
        crouch = _draw_near(self.crouches.targets, target, legs, rng)
        if rng.random() < ALL_CROUCH:
            return crouch
        moved = target.copy()
        moved[legs] = crouch[legs]
        return moved

    def _prop(self, target: Array, rng: np.random.Generator) -> Array:
        """Move arms and legs to a prop near their angles."""
        return _draw_near(self.props.targets, target, self._limbs, rng)

    def _go_anywhere(self, _: Array, rng: np.random.Generator) -> Array:
        home, drawn = self.stance, self._draw_anywhere(rng)
        if rng.random() < SYMMETRIC:
            left = np.arange(self._robot.n) <= self._robot.mirror_index
            drawn = np.where(left, drawn, self._robot.mirror_joints(drawn))
        return home + rng.uniform(*ANYWHERE) * (drawn - home)

    def _draw_anywhere(self, rng: np.random.Generator) -> Array:
        return rng.uniform(self._robot.lower, self._robot.upper)


def _draw_near(
    postures: Array, target: Array, joints: NDArray[np.int_], rng: np.random.Generator
) -> Array:
    """Draw one of the postures (K, n) whose joints are nearest to those of targets (n,)."""
    far = np.abs(postures[:, joints] - target[joints]).max(axis=1)
    near = np.argsort(far, kind="stable")[:NEAR]
    return postures[int(rng.choice(near))].copy()


def _group(limbs: Limbs) -> list[np.ndarray]:
    """Group joints by limb; all others are one group."""
    groups = [np.array(limb.joints) for limb in limbs.all.values()]
    others = np.setdiff1d(np.arange(limbs.robot.n), np.concatenate(groups))
    return [*groups, others] if len(others) else groups
