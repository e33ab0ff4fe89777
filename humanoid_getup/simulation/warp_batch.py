"""Batch of worlds that mujoco-warp steps: on a GPU, or on the CPU for tests."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, cast

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
from mujoco.batch import MODEL_FIELDS, Batch
from numpy.typing import ArrayLike, NDArray

from robots.quaternion import Array

Ids = NDArray[np.int_]

STATE = (
    "time",
    "qpos",
    "qvel",
    "act",
    "history",
    "qacc_warmstart",
    "ctrl",
    "qfrc_applied",
    "xfrc_applied",
    "eq_active",
    "mocap_pos",
    "mocap_quat",
    "plastic",
)
"""MjData fields that a step reads."""
NO_STAGE = mujoco.mjtStage.mjSTAGE_NONE.value
FULL_STAGE = mujoco.mjtStage.mjSTAGE_ACC.value
CTRL = mujoco.mjtState.mjSTATE_CTRL.value
MOST_VALUE = 1e10  # mjMAXVAL: a state beyond it has diverged
CONTACTS_PER_GEOM = 2  # of the robot; falls have at most one
FEWEST_CONTACTS = 32
MOST_GROWTH = 8
ROW_OVERFLOW = mjw.OverflowType.NEFC | mjw.OverflowType.NJMAX_NNZ
NO_OVERFLOW = mjw.OverflowType.ITERATIONS | mjw.OverflowType.LS_ITERATIONS
PER_WORLD = frozenset(
    field.name
    for field in fields(mjw.Model)
    if (getattr(field.type, "shape", None) or (0,))[0] == "*"
)
"""Model fields that may differ between the worlds of mujoco-warp."""


@dataclass(frozen=True)
class Room:
    """Room for contacts and constraints, which mujoco-warp reserves."""

    contacts: int
    """Of a world on average; also pairs of geoms that are near."""
    rows: int
    """Constraints of each world."""

    @classmethod
    def of(cls, model: mujoco.MjModel) -> Room:
        """Estimate the room that any fall needs: two contacts for each geom of the robot."""
        geoms = np.count_nonzero(model.body_weldid[model.geom_bodyid])
        contacts = max(FEWEST_CONTACTS, CONTACTS_PER_GEOM * int(geoms))
        is_pyramid = model.opt.cone == mujoco.mjtCone.mjCONE_PYRAMIDAL
        condim = int(model.geom_condim.max(initial=1))
        rows = contacts * (max(1, 2 * (condim - 1)) if is_pyramid else condim)
        rows += np.count_nonzero(model.dof_frictionloss) + np.count_nonzero(model.jnt_limited)
        rows += np.count_nonzero(model.tendon_frictionloss) + np.count_nonzero(model.tendon_limited)
        return cls(contacts, int(rows) + 6 * model.neq)

    def grow(self, *, only_rows: bool) -> Room:
        """Return twice the room."""
        return Room(self.contacts if only_rows else 2 * self.contacts, 2 * self.rows)


class WarpBatch(Batch):
    """Steps a batch of worlds with mujoco-warp, in single precision.

    States, model fields and the constants derived from them are those of `mujoco.batch.Batch`,
    which also computes outputs without a step (`reset`, `forward`, `set_const`), on the CPU.
    """

    def __init__(
        self, model: mujoco.MjModel, nsim: int, nthread: int = 0, *, device: str = ""
    ) -> None:
        """Put a model on a device: cpu, cuda or cuda:N; by default a GPU, if warp finds one."""
        super().__init__(model, nsim, nthread)
        self.device = _find_device(device)
        self._room = Room.of(model)
        self._most_rows = MOST_GROWTH * self._room.rows
        self._own: dict[str, Array] = {}
        self._graph: Any = None
        with wp.ScopedDevice(self.device):
            try:
                self._on_device = mjw.put_model(model)
            except (NotImplementedError, ValueError) as error:
                raise ValueError(f"mujoco-warp cannot simulate this model: {error}") from error
            self._on_device.opt.warn_overflow = 0
            # Boxes meet as in MuJoCo; by default mujoco-warp takes its general convex collider.
            self._on_device.opt.disableflags |= mjw.DisableBit.NATIVECCD
            self._reserve()

    def bind(self, name: str) -> Array:
        """Return a live (nsim, ...) array over an MjData field, as a `Batch` does."""
        values = super().bind(name)
        if name in STATE:
            return values
        if not hasattr(self._data_on_device, name):
            raise ValueError(f"mujoco-warp does not compute '{name}'")
        if name not in self._own:
            self._own[name] = values.copy()
        return self._own[name]

    def expand(self, name: str) -> Array:
        """Give a model field values of each world; return them, (nsim, ...)."""
        if name not in PER_WORLD:
            raise ValueError(f"mujoco-warp shares the model field '{name}' between all worlds")
        return super().expand(name)

    def forward(self, ids: ArrayLike | None = None, stage: int = FULL_STAGE) -> None:
        """Compute outputs of some worlds at their states, on the CPU."""
        super().forward(ids, stage)
        self._copy_outputs(ids)

    def reset(
        self, ids: ArrayLike | None = None, keyframe: ArrayLike = -1, stage: int = FULL_STAGE
    ) -> None:
        """Reset some worlds, and compute their outputs up to a stage, on the CPU."""
        super().reset(ids, keyframe, stage)
        self._copy_outputs(ids)

    def step(self, ids: ArrayLike | None = None, nstep: int = 1, stage: int = NO_STAGE) -> None:
        """Advance some worlds by physics steps; outputs are one step behind their states."""
        if stage != NO_STAGE:
            raise ValueError("mujoco-warp computes no stages after a step")
        self.rollout(nstep, record=(), ids=ids)

    def rollout(
        self,
        nstep: int,
        control: ArrayLike | None = None,
        control_spec: int = CTRL,
        record: Sequence[Any] = ("qpos",),
        ids: ArrayLike | None = None,
        out: dict[Any, Array] | None = None,
    ) -> dict[Any, Array]:
        """Advance some worlds with controls (n, nstep, nu); record MjData fields after each step.

        Without room for all contacts it is repeated with more of it. A world that then still
        lacks some, or whose state diverges, raises its counter of MuJoCo's warnings, and is reset
        in the latter case.
        """
        if control_spec != CTRL or out is not None:
            raise ValueError("a rollout of mujoco-warp takes controls alone, and makes its records")
        rows = np.arange(self.nsim) if ids is None else np.arange(self.nsim)[np.asarray(ids)]
        sent = np.repeat(self.bind("ctrl")[np.newaxis], nstep, axis=0)
        if control is not None:
            sent[:, rows] = np.swapaxes(np.asarray(control), 0, 1)
        with wp.ScopedDevice(self.device):
            recorded, lacks = self._run_with_room(sent, record, rows)
            rolled = {name: self._read_record(name, each, rows) for name, each in recorded.items()}
            self._download(rows)
        self._note_overflow(rows, lacks)
        self._reset_diverged(rows, rolled)
        return rolled

    def _run_with_room(
        self, sent: Array, record: Sequence[str], rows: Ids
    ) -> tuple[dict[str, wp.array], NDArray[np.int_]]:
        """Run steps, again with more room while some worlds lack it; return what these lack."""
        while True:
            recorded = self._run(sent, record)
            lacks = self._read_overflow()[rows]
            if not lacks.any() or self._room.rows >= self._most_rows:
                return recorded, lacks
            self._room = self._room.grow(only_rows=not np.any(lacks & ~int(ROW_OVERFLOW)))
            self._reserve()

    def _run(self, sent: Array, record: Sequence[str]) -> dict[str, wp.array]:
        """Run steps from the states on the host, with controls (T, N, nu)."""
        data = self._data_on_device
        self._set_fields()
        self._capture()
        for name in STATE:
            if (values := super().bind(name)).size:
                getattr(data, name).assign(values)
        data.overflow.zero_()
        controls = wp.array(sent, dtype=float)
        recorded = {name: self._make_record(name, len(sent)) for name in record}
        for step in range(len(sent)):
            wp.copy(data.ctrl, _row(controls, step))
            if self._graph is None:
                mjw.step(self._on_device, data)
            else:
                wp.capture_launch(self._graph)
            for name, samples in recorded.items():
                wp.copy(_row(samples, step), getattr(data, name))
        return recorded

    def _capture(self) -> None:
        """Capture a step in a CUDA graph, which launches it at once."""
        if self._graph is not None or not self._can_capture:
            return
        mjw.step(self._on_device, self._data_on_device)  # loads the kernels; its state is replaced
        with wp.ScopedCapture() as capture:
            mjw.step(self._on_device, self._data_on_device)
        self._graph = capture.graph

    @property
    def _can_capture(self) -> bool:
        return self.device.is_cuda and wp.is_mempool_enabled(self.device)

    def _reserve(self) -> None:
        """Make the data of all worlds on the device."""
        room = self._room
        self._on_device.opt.contact_sensor_maxmatch = room.contacts
        self._data_on_device = mjw.make_data(
            self.model, nworld=self.nsim, nconmax=room.contacts, njmax=room.rows
        )
        self._graph = None

    def _set_fields(self) -> None:
        """Send model fields that differ between worlds to the device."""
        for name in PER_WORLD & MODEL_FIELDS:
            values = self.expanded(name)
            if values is None or not values.size:
                continue
            field = getattr(self._on_device, name)
            if field.shape[0] != self.nsim:
                field = wp.zeros((self.nsim, *field.shape[1:]), dtype=field.dtype)
                setattr(self._on_device, name, field)
                self._graph = None
            field.assign(values)

    def _make_record(self, name: str, steps: int) -> wp.array:
        self.bind(name)
        field = getattr(self._data_on_device, name)
        return wp.empty((steps, *field.shape), dtype=field.dtype)

    def _read_record(self, name: str, samples: wp.array, rows: Ids) -> Array:
        """Read a field as it was recorded, (len(rows), T, ...)."""
        template = self.bind(name)
        recorded = np.swapaxes(samples.numpy()[:, rows], 0, 1)
        return recorded.reshape(*recorded.shape[:2], *template.shape[1:]).astype(template.dtype)

    def _download(self, rows: Ids) -> None:
        """Copy states and outputs of some worlds from the device."""
        for name in (*STATE, *self._own):
            if (values := self.bind(name)).size:
                on_device = getattr(self._data_on_device, name).numpy()
                values[rows] = on_device[rows].reshape(len(rows), *values.shape[1:])

    def _copy_outputs(self, ids: ArrayLike | None) -> None:
        """Copy the outputs that were computed on the CPU."""
        rows = slice(None) if ids is None else np.asarray(ids)
        for name, values in self._own.items():
            values[rows] = super().bind(name)[rows]

    def _read_overflow(self) -> NDArray[np.int_]:
        """Read which world lacked room for what, bits of `mjw.OverflowType`, (N,)."""
        return self._data_on_device.overflow.numpy() & ~int(NO_OVERFLOW)

    def _note_overflow(self, rows: Ids, lacks: NDArray[np.int_]) -> None:
        """Count worlds that lacked room, as MuJoCo's warnings."""
        if not lacks.any():
            return
        few_rows = rows[(lacks & int(ROW_OVERFLOW)) > 0]
        few_contacts = rows[(lacks & ~int(ROW_OVERFLOW)) > 0]
        self.warning[few_rows, mujoco.mjtWarning.mjWARN_CNSTRFULL, 1] += 1
        self.warning[few_contacts, mujoco.mjtWarning.mjWARN_CONTACTFULL, 1] += 1
        warnings.warn(
            f"mujoco-warp: {np.count_nonzero(lacks)} of {len(rows)} worlds lacked room for their "
            f"contacts ({self._room.contacts} a world) or constraints ({self._room.rows}): their "
            "physics counts as diverged",
            RuntimeWarning,
            stacklevel=2,
        )

    def _reset_diverged(self, rows: Ids, rolled: dict[str, Array]) -> None:
        """Reset worlds whose state is not finite, or too large, as MuJoCo does."""
        values = np.concatenate([self.bind(name)[rows] for name in ("qpos", "qvel")], axis=1)
        is_bad = ~(np.abs(values).max(axis=1, initial=0.0) < MOST_VALUE)
        is_bad |= ~np.isfinite(self.state[rows]).all(axis=1)
        if not is_bad.any():
            return
        self.reset(rows[is_bad])  # clears their warnings, too
        self.warning[rows[is_bad], mujoco.mjtWarning.mjWARN_BADQPOS, 1] = 1
        for name, samples in rolled.items():
            now = np.broadcast_to(self.bind(name)[rows][:, np.newaxis], samples.shape)
            np.copyto(samples, now, where=~np.isfinite(samples))


def _row(samples: wp.array, step: int) -> wp.array:
    return cast(wp.array, samples[step])


def _find_device(name: str) -> wp.Device:
    """Find a device of warp; by default its GPU, if there is one."""
    try:
        return cast(wp.Device, wp.get_device(name or None))
    except (ValueError, RuntimeError) as error:
        found = ", ".join(str(device) for device in wp.get_devices())
        raise ValueError(f"warp finds no device '{name}' here, expected {found}") from error
