"""Buffers in which delayed targets and measurements wait."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array

Whole = NDArray[np.integer[Any]]


class DelayBuffers:
    """Fills the buffers of placed robots as if they had always rested in their present state.

    A buffer in mjData.history is two numbers of bookkeeping, the sample times, then the samples.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Find the samples in the history of a model."""
        self.exist = model.nhistory > 0
        data = mujoco.MjData(model)
        self._blank = data.history.copy()
        each, one = np.arange(model.nu), np.ones(model.nu, dtype=int)
        self._ctrl = _find_samples(model.actuator_historyadr, model.actuator_history, each, one)
        self._sensors = _find_samples(
            model.sensor_historyadr, model.sensor_history, model.sensor_adr, model.sensor_dim
        )

    def fill(self, history: Array, ids: Whole, ctrl: Array, sensordata: Array) -> None:
        """Fill the buffers of some robots with present values."""
        rows = np.tile(self._blank, (len(ids), 1))
        for (there, here), now in ((self._ctrl, ctrl), (self._sensors, sensordata)):
            rows[:, there] = now[ids[:, None], here]
        history[ids] = rows


def _find_samples(
    starts: Whole, history: Whole, addresses: Whole, sizes: Whole
) -> tuple[Whole, Whole]:
    """Return the addresses of all samples in the history, and of their values."""
    there, here = [np.zeros(0, dtype=int)], [np.zeros(0, dtype=int)]
    for start, samples, address, size in zip(starts, history[:, 0], addresses, sizes, strict=True):
        there.append(start + 2 + samples + np.arange(samples * size))
        here.append(address + np.tile(np.arange(size), samples))
    return np.concatenate(there), np.concatenate(here)
