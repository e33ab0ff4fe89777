"""Tracking: references with the virtual actuator added, eased where servos press for too long."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from humanoid_getup.experiments.judging.torque import LONG_SATURATION, SATURATED, limit_torque
from humanoid_getup.experiments.rollouts import Feedback
from humanoid_getup.filtering.candidate import NO_SLOWDOWN, Candidate, Reference
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, TorqueLimit
from robots.quaternion import Array

FADE_CYCLES = 40  # in which the virtual actuator fades out before the targets stand still
LONGEST_STRETCH = 2.5  # of its own duration that a motion may last
FIRST_HOLD = 1.0  # s of stand that a rollout must show to be checked
SUPPORT_FORCE_SHARE = 0.5  # of the robot's weight, the largest desired force
STIFFNESS_RATE = 4.0  # rad/s, natural frequency of the virtual spring and damper
DAMPING_RATIO = 0.7


@dataclass(frozen=True, kw_only=True)
class LimbMap:
    """Limb, body and mass that each joint moves."""

    limb: np.ndarray
    """Limb of each joint, shape (n,)."""
    body: np.ndarray
    """Body that each joint moves, shape (n,)."""
    mass_share: Array
    """Share of the robot's mass in the subtree of each joint, shape (n,)."""
    mass: float
    """Mass of the robot [kg]."""

    @staticmethod
    def of(world: World) -> LimbMap:
        """Read the map from a world's model."""
        model, robot = world.model, world.robot

        def find_limb(body: int) -> int:
            while body not in roots:
                body = int(model.body_parentid[body])
            return roots.index(body)

        body = np.array([int(model.joint(name).bodyid[0]) for name in robot.joint_names])
        roots = [model.body(name).id for name in world.limbs]
        limb = np.array([find_limb(b) for b in body])
        mass = float(model.body_subtreemass[model.body(robot.torso).id])
        return LimbMap(
            limb=limb, body=body, mass_share=model.body_subtreemass[body] / mass, mass=mass
        )


def compute_force(
    com: Array, com_velocity: Array, reference: Array, reference_velocity: Array, mass: float
) -> Array:
    """Compute the desired force on the center of mass [N], (..., 3).

    It is a spring and damper to the reference, limited to half of the weight.
    """
    spring = STIFFNESS_RATE**2 * (reference - com)
    damper = 2.0 * DAMPING_RATIO * STIFFNESS_RATE * (reference_velocity - com_velocity)
    force = mass * (spring + damper)
    largest = SUPPORT_FORCE_SHARE * mass * 9.81
    size = np.linalg.norm(force, axis=-1, keepdims=True)
    return force * np.minimum(1.0, largest / np.maximum(size, 1e-9))


def compute_torque(state: Feedback, force: Array, limbs: LimbMap) -> Array:
    """Convert forces on the centers of mass [N], (N, 3), to joint torques [N·m], (N, n).

    With its contact point p fixed to the world and the torso's attitude kept, turning
    joint j (axis a, anchor o, the subtree below it of mass share m and center c) by dq moves
    the center of mass by
    ``(m a x (c - o) - a x (p - o)) dq``: that is the column of the Jacobian J, and the
    torques are J^T f, section 4.3 of [Lin12]. Limbs that touch the world share the force;
    the joints of the others get none, and no external force ever acts.
    """
    point = state.limb_point[:, limbs.limb]  # (N, n, 3)
    below = state.com[:, limbs.body]  # (N, n, 3)
    shift = limbs.mass_share[:, None] * _cross(state.axis, below - state.anchor)
    jacobian = shift - _cross(state.axis, point - state.anchor)
    supports = state.limb_touch.sum(axis=1, keepdims=True)
    share = state.limb_touch[:, limbs.limb] / np.maximum(supports, 1)  # (N, n)
    return share * np.einsum("nji,ni->nj", jacobian, force)


def _cross(a: Array, b: Array) -> Array:
    """Compute cross products (..., 3); twice as fast as ``np.cross`` on small arrays."""
    y, z = [1, 2, 0], [2, 0, 1]
    return a[..., y] * b[..., z] - a[..., z] * b[..., y]


YIELDS_AFTER = 0.6 * LONG_SATURATION  # s; with some time left for other worlds
PRESSING = 0.85  # share of its torque with which a servo that yields still presses


class Yielding:
    """Eases the targets of servos that have pressed with all their torque for too long.

    A limb that is caught under the body would otherwise press until the overload protection of its
    servos trips. A servo that yields presses with less, until its target is within its reach again.
    """

    def __init__(self, robot: Robot, limit: TorqueLimit, count: int) -> None:
        """Prepare for some robots under a torque limit.

        A servo saturates at rest where neither its limit nor its own stall torque is below what the
        supply would allow.
        """
        limit, supply = limit.on(robot), robot.supply_voltage / robot.nominal_voltage
        self._stall = robot.find_stall(robot.supply_voltage)
        saturates = limit_torque(robot, limit.value) >= SATURATED * self._stall
        self._robot = robot
        self._trips = robot.trips & saturates & (robot.strength > 0.0)
        self._gain = robot.position_gain * (1.0 if limit.by == "current" else supply)
        self._after = round(YIELDS_AFTER / robot.control_period)
        self._pressed = np.zeros((count, robot.n), dtype=int)
        self._yields = np.zeros((count, robot.n), dtype=bool)

    def ease(self, target: Array, sent: Array, joint_pos: Array) -> Array:
        """Compute what to add to targets (N, n), after others were sent, at joint angles [rad].

        It is 0 for robots none of whose servos yields.
        """
        robot = self._robot
        presses = self._trips & (self._ask(sent, joint_pos) >= SATURATED)
        self._pressed = np.where(presses, self._pressed + 1, 0)
        asked = self._ask(target, joint_pos)
        began = self._pressed >= self._after
        self._yields = self._trips & (self._yields | began) & (asked > PRESSING)
        if not self._yields.any():
            return np.zeros_like(target)
        share = np.where(self._yields, PRESSING / np.maximum(asked, PRESSING), 1.0)
        lead = robot.transmission.to_actuator(target - joint_pos)
        return robot.transmission.to_joint((share - 1.0) * lead)

    def _ask(self, target: Array, joint_pos: Array) -> Array:
        """Compute the torques that targets ask of servos at rest, as shares of their own."""
        lead = self._robot.transmission.to_actuator(target - joint_pos)
        return np.abs(self._gain * lead) / self._stall


class Tracker:
    """Sends references with the virtual actuator added, within the limits of the guard.

    Time along a reference, its phase, is counted in control periods. It stands for the time on
    the clock, except where a candidate slows down.
    """

    def __init__(
        self,
        world: World,
        start: Posture,
        references: list[Reference],
        candidates: list[Candidate],
        limit: TorqueLimit,
    ) -> None:
        """Prepare to track."""
        robot = world.robot
        self._limbs, self._robot, self._ground = LimbMap.of(world), robot, world.scene.ground
        self._torso = robot.layout(world.model).torso
        self._period = robot.control_period
        self._rows = np.arange(len(references))
        self._count = np.array([len(r.target) for r in references])
        length = int(self._count.max())
        target = np.array([hold_last(r.target, length) for r in references])
        com = np.array([hold_last(r.com, length) for r in references])
        velocity = np.gradient(com, self._period, axis=1)
        # Targets (n), center of mass (3) and its velocity (3), (N, T, n + 6).
        self._reference = np.concatenate([target, com, velocity], axis=2)
        self._joined = np.array([r.joined for r in references])
        self._begins = np.array([r.begins for r in references])
        self._assistance = np.array([[c.assistance] for c in candidates])
        self._yielding = Yielding(robot, limit, len(candidates))
        slowdown = [c.slowdown or NO_SLOWDOWN for c in candidates]
        self._tolerance, self._band, self._slowest = np.array(
            [(p.tolerance, p.band, p.slowest) for p in slowdown]
        ).T
        self._slows_down = any(c.slowdown for c in candidates)
        self._phase = np.zeros(len(references))
        self._anchor = np.zeros(len(references), dtype=int)
        self._last = np.tile(start.joint_pos, (len(references), 1))
        self._eased = np.zeros_like(self._last)
        self._last_com: Array | None = None
        self._shift = np.zeros((len(references), 3))
        self.moving = np.zeros(len(references), dtype=int)
        """Cycles before the targets of each rollout stand still; 0 while they move, (N,)."""
        self.joined = self._joined.copy()
        """Cycles before the motion of each rollout is joined, (N,)."""

    def __call__(self, state: Feedback) -> Array | None:
        """Return the targets of a control period, (N, n); ``None`` at the end."""
        if state.step > 0:
            self._proceed(state)
        if self._is_over(state.step):
            return None
        com = state.com[:, self._torso]
        velocity = np.zeros_like(com)
        if self._last_com is not None:
            velocity = (com - self._last_com) / self._period
        self._last_com = com.copy()
        planned = self._at_phase()
        torque = self._assist(state, com, velocity, planned[:, -6:-3], planned[:, -3:])
        target = planned[:, :-6] + self._robot.compute_lead(torque)
        if state.step > 0:
            eased = self._yielding.ease(target, self._last, state.joint_pos)
            tracks = (self._phase >= self._begins) & (self.moving == 0)
            self._eased = np.where(tracks[:, None], eased, self._eased)
        target = target + self._eased
        self._last = self._robot.limit_target(target, self._last)
        return self._last

    def _proceed(self, state: Feedback) -> None:
        """Advance along the references, more slowly if a joint lags behind its target."""
        rate = np.ones(len(self._phase))
        if self._slows_down:
            behind = np.abs(self._last - state.joint_pos) * self._robot.strength
            lag = behind.max(axis=1)
            slowed = np.clip(1.0 - (lag - self._tolerance) / self._band, self._slowest, 1.0)
            rate = np.where(self._phase >= self._begins, slowed, 1.0)
        late = state.step >= LONGEST_STRETCH * self._count
        self._phase = np.where(late, self._phase, np.minimum(self._phase + rate, self._count))
        ended = late | (self._phase >= self._count)
        self.moving[ended & (self.moving == 0)] = state.step

    def _is_over(self, step: int) -> bool:
        hold = round(FIRST_HOLD / self._period)
        return bool(np.all(self.moving > 0)) and step >= self.moving.max() + hold

    def _at_phase(self) -> Array:
        """Interpolate the references at their phases, (N, n + 6)."""
        phase = np.minimum(self._phase, self._count - 1)
        before = phase.astype(int)
        if not self._slows_down:
            return self._reference[self._rows, before]
        after = np.minimum(before + 1, self._count - 1)
        share = (phase - before)[:, None]
        reference = self._reference
        return (1.0 - share) * reference[self._rows, before] + share * reference[self._rows, after]

    def _assist(
        self, state: Feedback, com: Array, velocity: Array, planned: Array, speed: Array
    ) -> Array:
        # Where the path or the motion begins, the reference is shifted over the ground to the
        # robot.
        passed = (self._phase >= self._begins).astype(int) + (self._phase >= self._joined)
        anchored = passed > self._anchor
        self._anchor = passed
        self._shift[anchored, :2] = (com - planned)[anchored, :2]
        reference = planned + self._shift
        reference[:, 2] += self._ground.height(com[:, 0], com[:, 1])
        force = compute_force(com, velocity, reference, speed, self._limbs.mass)
        left = np.clip((self._count - 1 - self._phase) / FADE_CYCLES, 0.0, 1.0)
        moving = (self._phase >= self._begins) & (self.moving == 0)
        active = (moving * left)[:, None]
        return active * self._assistance * compute_torque(state, force, self._limbs)
