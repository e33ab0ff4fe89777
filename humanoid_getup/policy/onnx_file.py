"""Policy files: ONNX models that end with a checksum of all their other bytes.

A model is read as protocol buffers before it is run. Field numbers are those of ``onnx.proto``. A
message is a row of fields; each has a number, and here either a number as its value or bytes, which
may be a message again.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import re
import signal
import time
from collections.abc import Iterator
from multiprocessing.connection import Connection
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robots.quaternion import Array
from robots.storage.files import read_bounded

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

GRAPH, METADATA, FUNCTION = 7, 14, 25  # of a model
KEY, VALUE = 1, 2  # of an entry of its metadata
NODE, INITIALIZER, SPARSE_INITIALIZER = 1, 5, 15  # of a graph
ATTRIBUTE = 5  # of a node
TENSOR, SUBGRAPH, TENSORS, SUBGRAPHS, SPARSE_TENSOR, SPARSE_TENSORS = 5, 6, 10, 11, 22, 23
"""Of an attribute."""
SPARSE_PARTS = (1, 2)  # of a sparse tensor: values and indices, which are tensors
EXTERNAL_DATA, DATA_LOCATION = 13, 14  # of a tensor

EXTERNAL_WEIGHTS = "its weights are in another file, expected all in this one"

VARINT, FIXED_64, BYTES, FIXED_32 = 0, 1, 2, 5  # wire types
FIXED_SIZES = {FIXED_64: 8, FIXED_32: 4}


def find_content_problems(model: bytes) -> list[str]:
    """List content that a policy must not have: control flow, functions, data in other files.

    Without control flow, the time of an inference does not depend on the observation.
    """
    whole = memoryview(model)
    if not _has(whole, GRAPH):
        raise ValueError("it holds no network")
    attributes = [*_select(whole, GRAPH, NODE, ATTRIBUTE)]
    problems = []
    if any(_has(attribute, SUBGRAPH, SUBGRAPHS) for attribute in attributes):
        problems.append("the network has loops or branches, expected none")
    if _has(whole, FUNCTION):
        problems.append("the model has functions, expected none")
    if any(_is_external(tensor) for tensor in _list_tensors(whole, attributes)):
        problems.append(EXTERNAL_WEIGHTS)
    return problems


def read_metadata(model: bytes) -> dict[str, str]:
    """Read the metadata of a model."""
    found = {}
    for entry in _select(memoryview(model), METADATA):
        texts = {field: bytes(v) for field, v in _read_fields(entry) if isinstance(v, memoryview)}
        found[texts.get(KEY, b"").decode()] = texts.get(VALUE, b"").decode()
    return found


def _list_tensors(model: memoryview, attributes: list[memoryview]) -> Iterator[memoryview]:
    yield from _select(model, GRAPH, INITIALIZER)
    sparse = [*_select(model, GRAPH, SPARSE_INITIALIZER)]
    for attribute in attributes:
        for field in (TENSOR, TENSORS):
            yield from _select(attribute, field)
        for field in (SPARSE_TENSOR, SPARSE_TENSORS):
            sparse += _select(attribute, field)
    for tensor in sparse:
        for part in SPARSE_PARTS:
            yield from _select(tensor, part)


def _is_external(tensor: memoryview) -> bool:
    fields = [*_read_fields(tensor)]
    return any(field == EXTERNAL_DATA or (field == DATA_LOCATION and v) for field, v in fields)


def _has(message: memoryview, *fields: int) -> bool:
    return any(field in fields for field, _ in _read_fields(message))


def _select(message: memoryview, field: int, *path: int) -> Iterator[memoryview]:
    """Yield every message at a path of fields."""
    for found, value in _read_fields(message):
        if found == field and isinstance(value, memoryview):
            yield from _select(value, *path) if path else [value]


def _read_fields(message: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Yield number and value of every field."""
    at = 0
    while at < len(message):
        tag, at = _read_varint(message, at)
        field, wire_type = tag >> 3, tag & 7
        if wire_type == VARINT:
            value, at = _read_varint(message, at)
            yield field, value
            continue
        if wire_type == BYTES:
            size, at = _read_varint(message, at)
        elif wire_type in FIXED_SIZES:
            size = FIXED_SIZES[wire_type]
        else:
            raise ValueError(f"field {field} has wire type {wire_type}")
        if at + size > len(message):
            raise ValueError(f"field {field} has {size} bytes, {len(message) - at} are left")
        yield field, message[at : at + size]
        at += size


def _read_varint(message: memoryview, at: int) -> tuple[int, int]:
    """Read a number of 7 bits a byte, lowest first; return it and its end."""
    value = 0
    for shift in range(0, 70, 7):
        if at >= len(message):
            raise ValueError("it ends within a number")
        byte, at = message[at], at + 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value, at
    raise ValueError("a number has more than 10 bytes")


CONTRACT_KEY = "policy_contract"  # of the contract in the model's metadata
CHECKSUM_KEY = "policy_sha256"  # of the checksum there
MAX_BYTES = 64 * 2**20

# A model is a protocol buffer, to which an entry of its metadata may be appended: field 14
# (0x72) of 81 bytes, in which field 1 (0x0a) is the key and field 2 (0x12) the value.
CHECKSUM_ENTRY = b"\x72\x51\x0a\x0d" + CHECKSUM_KEY.encode() + b"\x12\x40"


def read_model(file: Path) -> bytes:
    """Read a policy file and compare its checksum; raises ValueError of one line."""
    try:
        content = read_bounded(file, MAX_BYTES)
    except ValueError as error:
        raise ValueError(f"it is not an ONNX file: {error}") from error
    model, entry, checksum = content.rpartition(CHECKSUM_ENTRY)
    if CONTRACT_KEY.encode() not in content:
        raise ValueError(
            "it is not a complete ONNX file, or has no policy contract: export it with "
            "`getup export`"
        )
    if not entry:
        raise ValueError("it is damaged, or has no checksum: export it again with `getup export`")
    if checksum != _compute_checksum(model):
        raise ValueError("it is damaged: its content does not match its checksum")
    try:
        problems = find_content_problems(content)
    except ValueError as error:
        raise ValueError(f"it is not a complete ONNX file: {error}") from error
    if problems:
        raise ValueError("; ".join(problems))
    return content


def describe_refusal(library: ModuleType, error: Exception) -> str:
    """Say in one line why a library does not take a whole model, such as a newer one."""
    name, reason = library.__name__, " ".join(str(error).split()).rstrip(".")
    reason = re.sub(r"^\[ONNX.*? : [A-Z_]+ : (/\S+ .*\) (?=[A-Z]))?", "", reason)  # the place
    return (
        f"{name} {library.__version__} cannot load it: {reason}; expected what this version knows: "
        f"export it with an older IR version or opset, or update {name}"
    )


def seal_model(model: bytes) -> bytes:
    """Append the checksum of an ONNX model to its metadata."""
    return model + CHECKSUM_ENTRY + _compute_checksum(model)


def _compute_checksum(model: bytes) -> bytes:
    return hashlib.sha256(model).hexdigest().encode()


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
            raise ValueError(f"the network has {' and '.join(problems)}")
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
        raise ValueError(describe_refusal(onnxruntime, error)) from error


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
            raise ValueError(f"an inference takes more than {limit:g} s") from None
        raise ValueError(f"an inference ends its process ({child.exitcode})") from None
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
