"""Checkpoints: no code in a file is run, and all that was written comes back to the last bit."""

import pickle
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")
pytest.importorskip("rsl_rl")

import torch
from tensordict import TensorDict

from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint, restore_like, write_checkpoint
from sim2real.training.ppo import AVERAGE, UPDATES

NEEDED = {"actor_state_dict": {}, AVERAGE: {}, UPDATES: 0, "iter": 0}


class Malicious:
    """Touches a file when it is unpickled."""

    def __init__(self, target: Path) -> None:
        self.target = target

    def __reduce__(self):
        return Path.touch, (self.target,)


@pytest.mark.parametrize("how", ["torch", "legacy", "pickle"])
def test_code_in_a_checkpoint_is_not_run(tmp_path: Path, how: str):
    file, target = tmp_path / CHECKPOINT, tmp_path / "touched"
    state = NEEDED | {"extra": Malicious(target)}
    if how == "pickle":
        file.write_bytes(pickle.dumps(state))
    else:
        torch.save(state, file, _use_new_zipfile_serialization=how == "torch")
    with pytest.raises(ValueError) as refusal:
        read_checkpoint(file)
    assert "\n" not in str(refusal.value)
    assert not target.exists()
    if how == "torch":  # the file would do harm to a reader that unpickles
        torch.load(file, weights_only=False)  # which no code of the package does
        assert target.exists()


@dataclass(eq=False)
class Inner:
    values: np.ndarray
    count: int


@dataclass(frozen=True, eq=False)
class Outer:
    inner: Inner
    flags: np.ndarray


def test_a_state_comes_back_to_the_last_bit(tmp_path: Path):
    rng = np.random.default_rng(0)
    state = {
        "outer": Outer(Inner(rng.normal(size=(3, 2)), 7), rng.random(4) < 0.5),
        "rng": rng.bit_generator.state,
        "scalar": np.float64(0.1),
        "ages": np.arange(3),
    }
    file = tmp_path / CHECKPOINT
    observations = TensorDict({"policy": torch.ones(2, 3)}, [2])
    write_checkpoint(NEEDED | {"env": state, "observations": observations}, file)
    stored = read_checkpoint(file)
    template = {
        "outer": Outer(Inner(np.zeros((3, 2)), 0), np.zeros(4, dtype=bool)),
        "rng": np.random.default_rng(1).bit_generator.state,
        "scalar": 0.0,
        "ages": np.zeros(3, dtype=int),
    }
    restored = restore_like(template, stored["env"])
    assert np.array_equal(restored["outer"].inner.values, state["outer"].inner.values)
    assert restored["outer"].inner.count == 7
    assert np.array_equal(restored["outer"].flags, state["outer"].flags)
    assert restored["outer"].flags.dtype == bool
    assert restored["rng"] == state["rng"]
    assert restored["scalar"] == 0.1
    assert np.array_equal(restored["ages"], np.arange(3))
    assert torch.equal(stored["observations"]["policy"], observations["policy"])
    assert template["outer"].inner.count == 0, "the template was changed"


@pytest.mark.parametrize(
    ("template", "stored"),
    [
        ({"a": 1}, {"b": 1}),
        ({"a": 1}, torch.zeros(1)),
        (np.zeros(2), torch.zeros(3)),
        (np.zeros(2), 1.0),
        (Inner(np.zeros(2), 0), {"values": torch.zeros(2)}),
    ],
)
def test_a_state_of_another_structure_is_refused(template, stored):
    with pytest.raises(match="the checkpoint holds"):
        restore_like(template, stored)


def test_a_checkpoint_that_is_too_large_or_unpacks_to_too_much_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    """Zeros of 4 MB, packed again with compression, are some kilobytes."""
    file = tmp_path / CHECKPOINT
    write_checkpoint(NEEDED | {"env": torch.zeros(1_000_000)}, file)
    monkeypatch.setattr("sim2real.training.checkpoint.MAX_BYTES", 1_000_000)
    with pytest.raises(match=r"it has more than \d+ bytes"):
        read_checkpoint(file)
    with zipfile.ZipFile(file) as archive:
        entries = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    assert file.stat().st_size < 50_000
    with pytest.raises(match=r"it unpacks to 4\d+ bytes, expected at most"):
        read_checkpoint(file)
