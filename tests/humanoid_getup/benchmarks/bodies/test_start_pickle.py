"""Pickled start states: arrays are read, and nothing else is loaded or run."""

import os
import pickle
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from humanoid_getup.benchmarks.bodies.start_pickle import StartPickleError, read_start_pickle

PAIRS = [[np.array([0.1, -2.0, 3.0]), np.array([0.5])], [np.zeros(3), np.array([-1.0])]]


class Runs:
    """Runs a command as it is unpickled."""

    def __init__(self, command: str) -> None:
        self.command = command

    def __reduce__(self):
        return os.system, (self.command,)


def write(folder: Path, content: object) -> Path:
    path = folder / "starts.pkl"
    path.write_bytes(content if isinstance(content, bytes) else pickle.dumps(content, protocol=4))
    return path


def refusal_of(path: Path) -> str:
    with pytest.raises(StartPickleError) as caught:
        read_start_pickle(path)
    text = str(caught.value)
    assert text.startswith(f"{path}: ")
    assert "\n" not in text
    return text


@pytest.mark.parametrize("protocol", [3, 4, 5])
@pytest.mark.parametrize("core", [b"numpy.core.", b"numpy._core."])
def test_pairs_of_arrays_are_read_as_any_numpy_writes_them(
    tmp_path: Path, protocol: int, core: bytes
):
    content = pickle.dumps(PAIRS, protocol=protocol)
    if protocol == 3:  # the only one that states no lengths of names
        content = content.replace(b"numpy._core.", core).replace(b"numpy.core.", core)
    found = read_start_pickle(write(tmp_path, content))
    assert [[part.tolist() for part in state] for state in found] == [
        [part.tolist() for part in state] for state in PAIRS
    ]


@pytest.mark.parametrize("hidden", [False, True])
def test_a_pickle_that_would_run_a_command_is_refused_and_runs_nothing(
    tmp_path: Path, hidden: bool
):
    bad = Runs(f"touch {tmp_path / 'ran'}")
    states = [*PAIRS, [np.zeros(3), bad]] if hidden else bad
    assert "system', expected numpy arrays alone: not loaded" in refusal_of(write(tmp_path, states))
    assert not (tmp_path / "ran").exists()


@pytest.mark.parametrize(
    "name",
    ["builtins\neval", "numpy\nload", "numpy.core.multiarray\nfromfile", "copyreg\n_reconstructor"],
)
def test_no_other_name_is_looked_up(tmp_path: Path, name: str):
    text = refusal_of(write(tmp_path, b"c" + name.encode() + b"\n."))
    assert f"it names '{name.replace(chr(10), '.')}'" in text


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "not a pickle of start states"),
        (pickle.dumps(PAIRS)[:-40], "not a pickle of start states"),
        ([], "holds no list"),
        (np.zeros(3), "holds no list"),
        ({"a": 1}, "it has the instruction EMPTY_DICT, expected numpy arrays alone"),
        (b"]r\xff\xff\xff\x7f.", "it numbers more objects than it has bytes"),
        ([[np.zeros(3)]], "start 0 is no pair of vectors"),
        ([[np.zeros(3), np.zeros(1), np.zeros(1)]], "start 0 is no pair of vectors"),
        ([*PAIRS, [np.zeros(3), 2]], "start 2 is no pair of vectors"),
        ([[np.zeros(3), np.array([np.nan])]], "start 0 holds numbers that are not finite"),
        ([[np.zeros((2, 3)), np.zeros(1)]], "an array of shape (2, 3), expected a vector"),
        ([[np.zeros(3, dtype=object), np.zeros(1)]], "another kind than numbers"),
        ([[np.zeros(3, dtype=">f8"), np.zeros(1)]], "another kind than numbers"),
        ([[np.array(["a"]), np.zeros(1)]], "another kind than numbers"),
    ],
)
def test_what_is_no_start_state_is_refused_with_the_reason(tmp_path: Path, content, reason: str):
    assert reason in refusal_of(write(tmp_path, content))


def test_a_missing_file_is_refused(tmp_path: Path):
    assert refusal_of(tmp_path / "none.pkl").endswith("No such file or directory")


@given(content=st.binary(max_size=200), at=st.integers(0, 400), cut=st.booleans())
def test_damaged_bytes_are_read_or_refused_and_raise_nothing_else(
    tmp_path_factory: pytest.TempPathFactory, content: bytes, at: int, cut: bool
):
    good = pickle.dumps(PAIRS, protocol=4)
    spoiled = good[:at] + content + (b"" if cut else good[at + len(content) :])
    path = tmp_path_factory.mktemp("fuzz") / "starts.pkl"
    path.write_bytes(spoiled)
    try:
        assert all(len(state) == 2 for state in read_start_pickle(path))
    except StartPickleError as error:
        assert str(error).startswith(f"{path}: ")
