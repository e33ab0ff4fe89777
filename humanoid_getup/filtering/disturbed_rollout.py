"""Disturbed rollouts: targets replayed in many worlds, each ended once its outcome is known."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.experiments.rise_figures import RiseFigures, compute_delta_v
from humanoid_getup.experiments.standing import (
    HOLD_TIME,
    StanceMeter,
    compute_progress,
    compute_uprightness,
    is_upright,
)
from humanoid_getup.experiments.torque import LONG_SATURATION, LongestRun, find_saturation
from humanoid_getup.simulation.domain_parameters import DomainParameters
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.simulation.world import World, count_substeps
from robots.quaternion import Array

Bools = NDArray[np.bool_]

CHUNK = 25  # control periods between two looks at the worlds
HELD = HOLD_TIME + 0.3  # s of stand that is a held one
REST_TIME = 0.6  # s of stand at rest after which nothing can change any more
REST_SPEED = 0.03  # rad/s and m/s, of every degree of freedom at rest
LAST_CALL = 1.5  # s after the last target within which a stand must begin
DOWN_NECK, DOWN_TILT = 0.6, math.radians(60.0)  # of a robot that fell
DOWN_TIME = 0.2  # s after the last target from which such a robot will not rise any more
RECORDED = ("qpos", "qvel", "site_xpos", "sensordata", "actuator_force")


@dataclass(frozen=True, kw_only=True, eq=False)
class Worlds:
    """K disturbed worlds, of which the first is the nominal one."""

    starts: Array
    """MuJoCo positions at the start, at rest, (K, nq)."""
    parameters: DomainParameters

    def __len__(self) -> int:
        return len(self.starts)

    def take(self, rows: NDArray[np.int_]) -> Worlds:
        """Return some of the worlds."""
        return Worlds(starts=self.starts[rows], parameters=self.parameters.take(rows))


@dataclass(frozen=True, kw_only=True, eq=False)
class RolloutOutcome(RiseFigures):
    """How rollouts of S motions in K worlds ended; the figures are (S, K)."""

    stood: Bools
    """Whether it ended in a held stand, (S, K)."""
    progress: Array
    """How near it came to a stand, from 0 to 1, (S, K)."""
    simulated: float
    """Simulated time, all of them together [s]."""

    def take(self, rows: NDArray[np.int_]) -> RolloutOutcome:
        """Return the outcomes in some of the worlds."""
        arrays = {
            f.name: getattr(self, f.name)[:, rows] for f in fields(self) if f.name != "simulated"
        }
        return replace(self, **arrays)


class DisturbedRollout:
    """Plays motions in worlds, and drops each as soon as its outcome is known.

    A robot that is at rest in a stand, with targets that do not move any more, stays there: its
    hold need not be simulated. One that lies after its last target has fallen.
    """

    def __init__(self, world: World, n: int, *, threads: int = 0) -> None:
        """Prepare for at most ``n`` simulations at a time."""
        self.world, self.sim = world, VecSim(world, n, threads=threads)
        self.sim.bind("qvel")
        self._steps = count_substeps(world.model, world.robot.control_period)

    def play(
        self, worlds: Worlds, motions: Sequence[Array], *, give_up: bool = False
    ) -> RolloutOutcome:
        """Play the targets of S motions [rad], each (T, n), in every world.

        With ``give_up`` all end as soon as the first one has failed.
        """
        shape = (len(motions), len(worlds))
        targets = [motion for motion in motions for _ in range(len(worlds))]
        sim, ids = self.sim, np.arange(len(targets))
        sim.set_parameters(ids, worlds.parameters.tile(len(motions)))
        sim.place(ids, np.tile(worlds.starts, (len(motions), 1)))
        voltage = np.tile(worlds.parameters.voltage, len(motions))
        tally = _Tally(self.world, np.array([len(target) for target in targets]), voltage)
        while len(going := np.flatnonzero(tally.going)) and not (give_up and tally.failed[0]):
            sent = np.array([_cut(targets[i], tally.cycle) for i in going])
            record = sim.advance(sent, self._steps, RECORDED, going)
            tally.add(going, record, sim.diverged[going])
        return tally.conclude(shape)


def _cut(target: Array, first: int) -> Array:
    """Return a chunk of targets (T, n) from a row on; the last is repeated."""
    return target[np.minimum(np.arange(first, first + CHUNK), len(target) - 1)]


class _Tally:
    """What is known of N rollouts so far."""

    def __init__(self, world: World, length: NDArray[np.int_], voltage: Array) -> None:
        """Begin with motions of ``length`` cycles, (N,), at a supply [V], (N,)."""
        n, self._world, self._length, self._voltage = len(length), world, length, voltage
        self._dof = world.robot.layout(world.model).dof
        self._saturation = LongestRun(n, world.robot.n)
        self._period = world.robot.control_period
        self._meter = StanceMeter(world.robot, world.model, world.scene.support)
        self._neck = world.model.site(world.robot.neck_site).id
        self._overlap = int(world.model.sensor("overlap").adr[0])
        self.cycle = 0
        self.going, self.failed = np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
        self._stood, self._since = np.zeros(n, dtype=bool), np.zeros(n, dtype=int)
        self._best, self._last = np.zeros(n), np.zeros(n)
        self._square: list[Array] = []  # of the torque, mean over servos, each (n, CHUNK)
        self._neck_before = np.zeros((n, 2, 3))
        self._peak, self._impact, self._deepest = np.zeros(n), np.zeros(n), np.zeros(n)
        self._cycles = np.zeros(n, dtype=int)

    def add(self, going: NDArray[np.int_], record: dict[str, Array], diverged: Bools) -> None:
        """Read a chunk of the worlds that go on, and decide which of them are over."""
        foreign = self._world.find_non_foot_contact(record["sensordata"])
        stance = self._meter.measure(record["qpos"], record["site_xpos"], foreign)
        self._add_costs(going, record)
        self._last[going] = compute_uprightness(stance, self._world.robot).mean(axis=1)
        self._best[going] = np.maximum(self._best[going], self._last[going])
        broken = ~is_upright(stance, self._world.robot)
        after = self.cycle + CHUNK - np.argmax(broken[:, ::-1], axis=1)  # the last break
        since = np.where(broken.any(axis=1), after, self._since[going])
        self.cycle += CHUNK
        self._cycles[going], self._since[going] = self.cycle, since
        held = (self.cycle - since) * self._period
        past = (self.cycle - self._length[going]) * self._period  # s after the last target
        at_rest = np.abs(record["qvel"]).max(axis=(1, 2)) < REST_SPEED
        settled = at_rest & (np.minimum(held, past) >= REST_TIME)
        stood = (past > 0.0) & ((held >= HELD) | settled)
        neck = stance.neck_height[:, -1] / self._world.robot.standing_neck_height
        down = (neck < DOWN_NECK) | (stance.tilt[:, -1] > DOWN_TILT)
        late = (since - self._length[going]) * self._period > LAST_CALL
        overloaded = self._find_overloaded(going, record)
        stood &= ~overloaded
        failed = ~stood & ((down & (past > DOWN_TIME)) | late | diverged | overloaded)
        self._stood[going], self.failed[going] = stood, failed
        self.going[going] = ~(stood | failed)

    def _find_overloaded(self, going: NDArray[np.int_], record: dict[str, Array]) -> Bools:
        """Find the worlds in which a servo's overload protection may have tripped by now."""
        transmission = self._world.robot.transmission
        torque = record["actuator_force"]
        speed = transmission.to_actuator(record["qvel"][..., self._dof])
        voltage = self._voltage[going, None]
        saturated = find_saturation(self._world.robot, torque, speed, voltage)
        self._saturation.add(np.moveaxis(saturated, 1, 0), going)
        longest = self._saturation.longest[going].max(axis=1) * self._period
        return longest > LONG_SATURATION

    def _add_costs(self, going: NDArray[np.int_], record: dict[str, Array]) -> None:
        torque, contact = record["actuator_force"], record["sensordata"]
        neck = record["site_xpos"][:, :, self._neck]
        if self.cycle:
            neck = np.concatenate([self._neck_before[going], neck], axis=1)
        self._neck_before[going] = neck[:, -2:]
        square = np.zeros((len(self.going), CHUNK))
        square[going] = np.mean(torque**2, axis=2)
        self._square.append(square)
        change = compute_delta_v(neck, self._period)
        for name, now in (
            (self._peak, np.abs(torque).max(axis=(1, 2))),
            (self._impact, change.max(axis=1)),
            (self._deepest, np.maximum(-contact[..., self._overlap].min(axis=1), 0.0)),
        ):
            name[going] = np.maximum(name[going], now)

    def conclude(self, shape: tuple[int, int]) -> RolloutOutcome:
        """Return the outcomes; a world that was given up did not stand."""
        stood, period = self._stood, self._period
        progress = np.where(stood, 1.0, compute_progress(self._last, self._best))
        last = np.where(stood, self._since, self._cycles - 1)
        square = np.cumsum(np.concatenate(self._square, axis=1), axis=1)[np.arange(len(last)), last]
        return RolloutOutcome(
            stood=stood.reshape(shape),
            stand_time=np.where(stood, (self._since + 1) * period, np.nan).reshape(shape),
            progress=progress.reshape(shape),
            peak_torque=self._peak.reshape(shape),
            rms_torque=np.sqrt(square / (last + 1)).reshape(shape),
            impact=self._impact.reshape(shape),
            overlap=self._deepest.reshape(shape),
            simulated=float(self._cycles.sum()) * period,
        )
