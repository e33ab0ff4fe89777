"""The action space: how a policy's action becomes joint targets.

Training and robot call the same functions, on a thousand robots or on one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from robots import Robot
from robots.quaternion import Array
from robots.storage.validation import Names, on_axes, positive, whole

STEP_TIME = 0.048  # s of a policy step, about; a slower rate explores, a faster one shakes
CYCLES = 6  # control cycles of that time at a period of 8 ms
SPEED_SHARE = 0.95  # of the servo's no-load speed, so that whole ticks stay within the guard's
LEAD = 0.6  # rad; full voltage at the servo's position gain needs 0.22
EAGERNESS = 2.0  # half an action already commands full speed, for bold exploration
# rad of tilt, and rad of a joint from home, from which on rates are not scaled down
CALM_TILT, CALM_AWAY = 0.5, 0.5
CALMEST = 0.15  # scale of a rate for a standing robot: enough to balance, too slow to shake
APART_SHARE = 0.5  # of the scale, for numbers that move both sides oppositely
HOMING_SHARE = 0.4  # of the servo's speed, for joints that return home by themselves


class ActionMode(StrEnum):
    """The angle that an action is added to."""

    ABSOLUTE = "absolute"
    """The home angle."""
    OFFSET = "offset"
    """The measured angle."""
    RATE = "rate"
    """The last target."""


@dataclass(frozen=True, kw_only=True)
class StanceScaling:
    """Scales rates down as a robot comes to stand.

    A policy that explores by rates must counteract its own exploration, with a gain that
    shakes a standing robot because sensors and servos are delayed. A fallen robot needs full
    speed; an upright one with its joints near home a small share of it.
    """

    tilt: Annotated[float, positive(10.0, "rad")]
    """Tilt of the torso from which on rates are not scaled down [rad]."""
    away: Annotated[float, positive(10.0, "rad")]
    """Angle of a joint from home from which on its rate is not scaled down [rad]."""
    least: Annotated[float, positive(1.0)]
    """Smallest scale."""

    def share(self, gravity: Array, offset: Array) -> Array:
        """Compute the scale of each joint's rate, (..., n).

        It depends on the direction of gravity in the torso, (..., 3), and on the offsets of the
        measured angles from home [rad], (..., n).
        """
        tilt = np.arccos(_clip(-gravity[..., 2:], -1.0, 1.0))
        far = np.maximum(tilt / self.tilt, np.abs(offset) / self.away)
        return _clip(far, self.least, 1.0)


Vector = Annotated[Array, on_axes(1)]
Matrix = Annotated[Array, on_axes(2)]


@dataclass(frozen=True, kw_only=True, eq=False)
class ActionSpec:
    """How a policy's actions, numbers from -1 to 1, become joint targets once a policy step."""

    mode: str
    """An `ActionMode`."""
    names: Names
    """Names of the numbers."""
    directions: Matrix
    """How each number moves the joints, as a share of ``scale``, shape (k, n)."""
    scale: Vector
    """Change of an angle by a share of one [rad], shape (n,)."""
    reach: Vector
    """Largest change of a target in a policy step [rad], shape (n,)."""
    lead: Annotated[float, positive(10.0, "rad")]
    """Largest distance of a target from the measured angle [rad]; limits torque and wind-up."""
    pwm_limit: Annotated[float, positive(1.0)]
    """Largest share of the supply at the motors; it limits torque more at higher speed."""
    home: Vector
    """Standing joint angles [rad], shape (n,); observations count joint angles from here."""
    homing: Vector
    """How far a joint returns home by itself in a policy step [rad], shape (n,)."""
    calm: StanceScaling
    """Scaling of rates near the stance; used in mode RATE only."""
    cycles: Annotated[int, whole(1, 1000)] = CYCLES
    """Control cycles in a policy step."""
    holds: bool = False
    """Whether targets turn as fast as the servos do and are then held; otherwise they move evenly
    until the end of the policy step."""
    gain_share: tuple[float, ...] = ()
    """Share of each servo's position gain, n numbers; () for all of it."""

    @property
    def size(self) -> int:
        """Return the size of an action."""
        return len(self.names)

    @property
    def hold_reach(self) -> Array | None:
        """Return the reach of targets that are held [rad], (n,); ``None`` for even ones."""
        return self.reach if self.holds else None

    @cached_property
    def moved(self) -> NDArray[np.bool_]:
        """Return which joints actions move, shape (n,)."""
        return np.any(self.directions != 0.0, axis=0)

    def mirror_sign(self, robot: Robot) -> Array:
        """Return each number's sign when left and right are exchanged, shape (k,)."""
        mirrored = robot.mirror_joints(self.directions)
        even = np.isclose(mirrored, self.directions).all(axis=1)
        odd = np.isclose(mirrored, -self.directions).all(axis=1)
        crooked = [self.names[row] for row in np.flatnonzero(~(even | odd))]
        if crooked:
            raise ValueError(f"actions without a mirror image: {', '.join(crooked)}")
        return np.where(even, 1.0, -1.0)


def build_action_spec(
    robot: Robot,
    together: tuple[str, ...],
    apart: tuple[str, ...] = (),
    homing: tuple[str, ...] = (),
    pwm_limit: float = 1.0,
) -> ActionSpec:
    """Build rate actions in which mirrored joints move together, and apart.

    A 20 Hz rate is integrated into real motion, whereas a slow servo would average out noise
    on targets; moving both sides alike halves the search space. Joints that no number moves
    return home by themselves.

    Args:
        together: One joint of each mirrored pair with a number that moves both sides alike.
        apart: One joint of each pair with a number that moves both sides oppositely.
        homing: One joint of each pair that returns home by itself although a number moves it.
        pwm_limit: Largest share of the supply that the motors get.
    """
    moves = [(name, "together", 1.0, 1.0) for name in together]
    moves += [(name, "apart", APART_SHARE, -1.0) for name in apart]
    directions = np.zeros((len(moves), robot.n))
    for row, (name, _, share, sign) in zip(directions, moves, strict=True):
        joint = robot.joint_names.index(name)
        # Entry j of a mirrored vector is the sign of j times the entry of its mirror joint.
        other = int(robot.mirror_index[joint])
        row[joint] = share
        row[other] = share * sign * robot.mirror_sign[other]
    spec = build_posture_spec(robot, pwm_limit)
    held = np.any(directions != 0.0, axis=0)
    for name in homing:
        joint = robot.joint_names.index(name)
        held[[joint, robot.mirror_index[joint]]] = False
    return replace(
        spec,
        mode=ActionMode.RATE,
        names=tuple(f"{name} {how}" for name, how, _, _ in moves),
        directions=directions,
        scale=EAGERNESS * spec.reach,
        homing=np.where(held, 0.0, HOMING_SHARE * spec.reach),
    )


def build_posture_spec(robot: Robot, pwm_limit: float = 1.0) -> ActionSpec:
    """Build actions that are postures: each joint's angle from home, as a share of its range."""
    # The policy step is nearest to 48 ms.
    cycles = max(1, round(STEP_TIME / robot.control_period))
    reach = robot.max_velocity * robot.control_period * cycles * SPEED_SHARE
    home = robot.standing.joint_pos
    return ActionSpec(
        mode=ActionMode.ABSOLUTE,
        names=robot.joint_names,
        directions=np.eye(robot.n),
        scale=np.maximum(robot.upper - home, home - robot.lower),
        reach=reach,
        lead=LEAD,
        pwm_limit=pwm_limit,
        home=home,
        homing=np.zeros(robot.n),
        calm=StanceScaling(tilt=CALM_TILT, away=CALM_AWAY, least=CALMEST),
        cycles=cycles,
    )


def choose_actions(robot: Robot, wide: bool, pwm_limit: float = 1.0) -> ActionSpec:
    """Build the action space of a policy that gets this robot up.

    With ``wide``, mirrored joints may also move oppositely, and limbs spread.
    """
    rising, spreading = robot.rising_joints, robot.spreading_joints
    if not wide:
        return build_action_spec(robot, rising, pwm_limit=pwm_limit)
    both = (*rising, *spreading)
    return build_action_spec(robot, both, both, homing=spreading, pwm_limit=pwm_limit)


def next_target(
    robot: Robot, spec: ActionSpec, target: Array, measured: Array, gravity: Array, action: Array
) -> Array:
    """Compute the joint targets at the end of a policy step [rad], (..., n).

    They follow from the last targets and the measured angles [rad], (..., n), the direction of
    gravity in the torso, (..., 3), and the action's numbers, clipped to [-1, 1], (..., k).
    """
    share = _clip(_clip(action, -1.0, 1.0) @ spec.directions, -1.0, 1.0)
    if spec.mode == ActionMode.RATE:
        share = share * spec.calm.share(gravity, measured - spec.home)
    towards_home = target + _clip(spec.home - target, -spec.homing, spec.homing)
    origin = {
        ActionMode.ABSOLUTE: spec.home,
        ActionMode.OFFSET: measured,
        ActionMode.RATE: towards_home,
    }[ActionMode(spec.mode)]
    wanted = np.where(spec.moved, origin + share * spec.scale, towards_home)
    wanted = _clip(wanted, measured - spec.lead, measured + spec.lead)
    wanted = _clip(wanted, robot.lower, robot.upper)
    return target + _clip(wanted - target, -spec.reach, spec.reach)


def between(
    target: Array,
    following: Array,
    cycle: int | NDArray[np.int_],
    cycles: int,
    reach: Array | None = None,
) -> Array:
    """Compute the targets of a control cycle of a policy step [rad].

    In ``cycles`` cycles, counted from 0, they move from those at its beginning to those at its
    end; an array of cycles is broadcast. With a reach [rad], the most that they move in the step,
    they are there as early as that allows, and are held.
    """
    share = (cycle + 1) / cycles
    if reach is None:
        return target + share * (following - target)
    return target + _clip(following - target, -share * reach, share * reach)


def _clip(values: Array, lower: Array | float, upper: Array | float) -> Array:
    """Clip values to a range, in half the time of np.clip for twenty joints."""
    return np.minimum(np.maximum(values, lower), upper)
