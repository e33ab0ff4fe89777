"""The network of a policy file, run by one thread."""

from __future__ import annotations

import multiprocessing
import signal
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from humanoid_getup.policy.onnx_file import CONTRACT_KEY, NetworkError, describe_refusal, read_model
from robots.quaternion import Array

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

QUIET = 4  # onnxruntime's log level: fatal errors only
LONGEST_INFERENCE = 5.0  # s; hundreds of microseconds are usual
FORK = multiprocessing.get_context("fork")  # takes milliseconds, a fresh process tenths of a second


class OnnxNetwork:
    """Maps observations to actions by the graph of an ONNX file.

    A second output, if the graph has one, is its memory: a part of its next input.
    """

    def __init__(self, file: Path, limit: float = LONGEST_INFERENCE) -> None:
        """Load a file after a child process has loaded and run it, each time within a limit [s]."""
        model = read_model(file)
        self.faults, self.inference_time = _try_in_child(model, limit)
        """Problems of its output for zeros; processor time of one inference [s]."""
        self._session = _create_session(model)
        self.metadata: dict[str, str] = self._session.get_modelmeta().custom_metadata_map
        self.contract = self.metadata.get(CONTRACT_KEY, "")
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        problems = [f"{len(inputs)} inputs, expected 1"] if len(inputs) != 1 else []
        if len(outputs) not in (1, 2):
            problems.append(f"{len(outputs)} outputs, expected 1, or 2 with a memory")
        if problems:
            raise NetworkError(f"the network has {' and '.join(problems)}")
        self._input, self._outputs = inputs[0], outputs

    def find_problems(
        self, observation_size: int, action_size: int, memory_size: int | None = None
    ) -> list[str]:
        """List differences from a network that maps (N, observation) to (N, action).

        With a memory, it maps to (N, memory) as well.
        """
        sizes = [action_size] if memory_size is None else [action_size, memory_size]
        if len(self._outputs) != len(sizes):
            return [f"the network has {len(self._outputs)} outputs, expected {len(sizes)}"]
        problems = []
        for name, value, size in (
            ("input", self._input, observation_size),
            *zip(("output", "memory"), self._outputs, sizes, strict=False),
        ):
            if value.type != "tensor(float)":
                problems.append(f"network {name}: {value.type}, expected tensor(float)")
            shape = value.shape
            if len(shape) != 2 or (isinstance(shape[0], int) and shape[0] != 1) or shape[1] != size:
                problems.append(f"network {name}: shape {shape}, expected (N, {size})")
        return problems

    def __call__(self, observations: NDArray[np.float32]) -> tuple[Array, Array]:
        """Map observations (N, size) to actions (N, k) and to the memory (N, m).

        Without a memory of its own, the memory is the clipped actions.
        """
        found = self._run(observations)
        actions, *memory = (np.asarray(values, dtype=float) for values in found)
        return actions, memory[0] if memory else np.clip(actions, -1.0, 1.0)

    def _run(self, observations: NDArray[np.float32]) -> list[Array]:
        """Run the network, row by row if it takes one only."""
        if len(observations) > 1 and self._input.shape[0] == 1:
            rows = [self._run(row[None]) for row in observations]
            return [np.concatenate(values) for values in zip(*rows, strict=True)]
        return [np.asarray(v) for v in self._session.run(None, {self._input.name: observations})]


def _create_session(model: bytes) -> InferenceSession:
    import onnxruntime  # which takes time, and not every rise needs it

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.log_severity_level = QUIET
    try:
        return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors have no base of their own
        raise NetworkError(describe_refusal(onnxruntime, error)) from error


def _try_in_child(model: bytes, limit: float) -> tuple[list[str], float]:
    """Find problems and time of a model's first inferences, which may end their process.

    Nothing else can stop onnxruntime within an operator, or while it computes constants.
    """
    import onnxruntime  # noqa: F401  (the child is to have it)

    ours, theirs = FORK.Pipe(duplex=False)
    child = FORK.Process(target=_try, args=(model, limit, theirs))
    try:
        child.start()
        theirs.close()
        return ours.recv()
    except EOFError:
        child.join()
        if child.exitcode == -signal.SIGALRM:
            raise NetworkError(f"an inference takes more than {limit:g} s") from None
        raise NetworkError(f"an inference ends its process ({child.exitcode})") from None
    finally:
        if child.pid is not None:
            child.kill()
            child.join()
        ours.close()


def _try(model: bytes, limit: float, found: Connection) -> None:
    """Send what two inferences tell; the system ends this process at the limit [s] of each."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
        signal.signal(number, signal.SIG_DFL)  # Python's own handlers wait for the operator
    found.send(_test(model, limit))


def _test(model: bytes, limit: float) -> tuple[list[str], float]:
    """Return the problems of the output for zeros, and the time of a second inference [s]."""
    import onnxruntime

    signal.setitimer(signal.ITIMER_REAL, limit)

    options = onnxruntime.RunOptions()
    options.log_severity_level = QUIET
    try:
        session = _create_session(model)
        entry = session.get_inputs()[0]
        blank = np.zeros((1, entry.shape[1]), dtype=np.float32)
        outputs = session.run(None, {entry.name: blank}, options)
        signal.setitimer(signal.ITIMER_REAL, limit)
        begin = time.process_time()  # of one thread, whatever else the machine does
        session.run(None, {entry.name: blank}, options)
        took = time.process_time() - begin
    except Exception as error:  # errors of the session are reported when the file is loaded
        return [f"the network cannot be run: {' '.join(str(error).split())}"], 0.0
    # A weight that is not finite makes every action not finite.
    finite = all(np.isfinite(np.asarray(values, dtype=float)).all() for values in outputs)
    return ([] if finite else ["the network returns NaN or infinity"]), took
