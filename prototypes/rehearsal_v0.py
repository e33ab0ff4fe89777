"""Rehearsals: targets replayed in many disturbed worlds, each ended once its outcome is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.evaluation.standing import HOLD_TIME, StanceMeter, is_upright
from humanoid_getup.motions.motion import hold_last
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World, count_substeps
from robots import quaternion
from robots.quaternion import Array

Bools = NDArray[np.bool_]

CHUNK = 25  # control periods between two looks at the worlds
HELD = HOLD_TIME + 0.3  # s of stand that is a held one
REST_TIME = 0.6  # s of stand at rest after which nothing can change any more
REST_SPEED = 0.03  # rad/s and m/s, of every degree of freedom at rest
LAST_CALL = 1.5  # s after the last target within which a stand must begin
DOWN_NECK, DOWN_TILT = 0.6, math.radians(60.0)  # of a robot that fell after its last target
RECORDED = ("qpos", "qvel", "site_xpos", "sensordata", "actuator_force")


@dataclass(frozen=True, kw_only=True, eq=False)
class Rehearsed:
    """How N rehearsals ended."""

    stood: Bools
    """Whether it ended in a held stand, (N,)."""
    stand_time: Array
    """Start to the first moment of that stand [s], (N,); nan if it did not stand."""
    progress: Array
    """How near it came to a stand, from 0 to 1, (N,)."""
    peak_torque: Array
    """Largest torque of any servo [N·m], (N,)."""
    rms_torque: Array
    """Over time and servos [N·m], (N,)."""
    impact: Array
    """Largest change of the neck's velocity within a control period [m/s], (N,)."""
    overlap: Array
    """Greatest depth of self-penetration [m], (N,)."""
    simulated: float
    """Simulated time, all of them together [s]."""


class Rehearsal:
    """Plays targets in N worlds, and drops a world as soon as its outcome is known.

    A robot that is at rest in a stand, with targets that do not move any more, stays there: its
    hold need not be simulated. One that lies after its last target has fallen.
    """

    def __init__(self, world: World, n: int, *, threads: int = 0) -> None:
        self.world, self.sim = world, VecSim(world, n, threads=threads)
        self.sim.bind("qvel")
        self._steps = count_substeps(world.model, world.robot.control_period)
        self._meter = StanceMeter(world.robot, world.model, world.scene.ground)
        self._neck = world.model.site(world.robot.neck_site).id
        self._overlap = int(world.model.sensor("overlap").adr[0])

    def play(
        self,
        starts: Array,
        targets: Sequence[Array],
        parameters: DomainParameters,
        *,
        give_up: bool = False,
        ids: NDArray[np.int_] | None = None,
    ) -> Rehearsed:
        """Play targets [rad], N of (T_i, n), from MuJoCo positions (N, nq), at rest.

        With ``give_up`` all end as soon as the first one, the nominal one, has failed.
        """
        sim, n = self.sim, len(targets)
        ids = np.arange(n) if ids is None else ids
        sim.set_parameters(ids, parameters)
        sim.place(ids, starts)
        tally = _Tally(self, targets)
        while len(going := np.flatnonzero(tally.going)):
            rows = [hold_last(targets[i][tally.cycle : tally.cycle + CHUNK], CHUNK)
                    if tally.cycle < len(targets[i]) else np.repeat(targets[i][-1:], CHUNK, axis=0)
                    for i in going]
            record = sim.advance(np.array(rows), self._steps, RECORDED, ids[going])
            tally.add(going, record, sim.diverged[ids[going]])
            if give_up and tally.failed[0]:
                break
        return tally.conclude()


class _Tally:
    """What is known of N rehearsals so far."""

    def __init__(self, owner: Rehearsal, targets: Sequence[Array]) -> None:
        n = len(targets)
        self._owner, self._robot = owner, owner.world.robot
        self._period = self._robot.control_period
        self._length = np.array([len(t) for t in targets])
        self.cycle = 0
        self.going = np.ones(n, dtype=bool)
        self.failed = np.zeros(n, dtype=bool)
        self.stood = np.zeros(n, dtype=bool)
        self.upright_since = np.full(n, -1)
        self.best = np.zeros(n)
        self.last = np.zeros(n)
        self.square = np.zeros(n)
        self.peak, self.impact, self.overlap = np.zeros(n), np.zeros(n), np.zeros(n)
        self.cycles = np.zeros(n, dtype=int)

    def add(self, going: NDArray[np.int_], record: dict[str, Array], diverged: Bools) -> None:
        """Read a chunk of the worlds that go on; decide which of them are over."""
        world, robot, period = self._owner.world, self._robot, self._period
        contact = record["sensordata"]
        foreign = world.find_non_foot_contact(contact)
        stance = self._owner._meter.measure(record["qpos"], record["site_xpos"], foreign)
        upright = is_upright(stance, robot)
        height = np.clip(stance.neck_height / robot.standing_neck_height, 0.0, 1.0)
        quality = height * np.clip(np.cos(stance.tilt), 0.0, 1.0) * np.where(foreign, 0.8, 1.0)
        self.last[going] = quality.mean(axis=1)
        self.best[going] = np.maximum(self.best[going], quality.mean(axis=1))
        torque = record["actuator_force"]
        self.square[going] += np.sum(np.mean(torque**2, axis=2), axis=1)
        self.peak[going] = np.maximum(self.peak[going], np.abs(torque).max(axis=(1, 2)))
        neck = record["site_xpos"][:, :, self._owner._neck]
        jolt = np.diff(neck, n=2, axis=1) / period
        self.impact[going] = np.maximum(
            self.impact[going], np.linalg.norm(jolt, axis=2).max(axis=1)
        )
        self.overlap[going] = np.maximum(
            self.overlap[going], -contact[..., self._owner._overlap].min(axis=1)
        )
        self.cycles[going] += CHUNK
        since = self.upright_since[going]
        broken = ~upright
        last_broken = CHUNK - 1 - np.argmax(broken[:, ::-1], axis=1)
        any_broken = broken.any(axis=1)
        fresh = self.cycle + last_broken + 1
        since = np.where(any_broken, fresh, np.where(since < 0, self.cycle, since))
        self.upright_since[going] = since
        self.cycle += CHUNK
        held = (self.cycle - since) * period
        speed = np.abs(record["qvel"]).max(axis=2)
        still = speed[:, -CHUNK:].max(axis=1) < REST_SPEED
        past = (self.cycle - self._length[going]) * period  # s after the last target
        stood = (past > 0) & ((held >= HELD) | ((held >= REST_TIME) & (past >= REST_TIME) & still))
        tilt, neck_share = stance.tilt[:, -1], height[:, -1]
        down = (past > 0.2) & ((neck_share < DOWN_NECK) | (tilt > DOWN_TILT))
        late = (since - self._length[going]) * period > LAST_CALL
        failed = ~stood & (down | late | diverged)
        self.stood[going], self.failed[going] = stood, failed
        self.going[going] = ~(stood | failed)

    def conclude(self) -> Rehearsed:
        """Return the outcomes; a world that was given up did not stand."""
        progress = 0.6 * self.last + 0.4 * self.best
        return Rehearsed(
            stood=self.stood,
            stand_time=np.where(self.stood, (self.upright_since + 1) * self._period, np.nan),
            progress=np.where(self.stood, 1.0, progress),
            peak_torque=self.peak,
            rms_torque=np.sqrt(self.square / np.maximum(self.cycles, 1)),
            impact=self.impact,
            overlap=self.overlap,
            simulated=float(self.cycles.sum()) * self._period,
        )
