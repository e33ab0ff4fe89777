"""A network in an ONNX file, run by one thread."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from robots.rotation import Array

QUIET = 4  # onnxruntime's log level: only what ends it


class NetworkError(ValueError):
    """A file holds no network that can be run; the message is one line."""


class OnnxNetwork:
    """Maps observations to actions as the graph of an ONNX file does."""

    def __init__(self, file: Path) -> None:
        """Load a file.

        Raises:
            OSError: if it cannot be read.
            NetworkError: if it is not ONNX, or not one vector in, one vector out.
        """
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = options.inter_op_num_threads = 1
        options.log_severity_level = QUIET
        content = file.read_bytes()
        try:
            self._session = onnxruntime.InferenceSession(
                content, options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # onnxruntime's errors have no base of their own
            told = " ".join(str(error).split())
            raise NetworkError(f"it is no whole ONNX file: {told}") from error
        faults = [
            f"{len(values)} {name}, allowed 1"
            for name, values in (
                ("inputs", self._session.get_inputs()),
                ("outputs", self._session.get_outputs()),
            )
            if len(values) != 1
        ]
        if faults:
            raise NetworkError(f"the network has {' and '.join(faults)}")
        self._input, self._output = self._session.get_inputs()[0], self._session.get_outputs()[0]

    @property
    def metadata(self) -> dict[str, str]:
        """Return the texts that the file carries, by key."""
        return dict(self._session.get_modelmeta().custom_metadata_map)

    def find_faults(self, observation_size: int, action_size: int) -> list[str]:
        """Tell what keeps the network from mapping (N, observation) to (N, action)."""
        faults = []
        for name, value, size in (
            ("input", self._input, observation_size),
            ("output", self._output, action_size),
        ):
            if value.type != "tensor(float)":
                faults.append(f"network {name}: {value.type}, allowed tensor(float)")
            shape = value.shape
            if len(shape) != 2 or (isinstance(shape[0], int) and shape[0] != 1) or shape[1] != size:
                faults.append(f"network {name}: shape {shape}, allowed (N, {size})")
        return faults

    def __call__(self, observations: NDArray[np.float32]) -> Array:
        """Map observations, (N, size), to actions, (N, k)."""
        (actions,) = self._session.run(None, {self._input.name: observations})
        return np.asarray(actions, dtype=float)
