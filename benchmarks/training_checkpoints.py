"""Checkpoints of a training, kept as it replaces them, and how often their policies stand up."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event, Thread

from training_progress import TrainingProgress

from humanoid_getup.commands.learn.evaluate import EvaluateRequest, evaluate
from humanoid_getup.commands.learn.train import ExportRequest, export
from sim2real.training.checkpoint import CHECKPOINT, read_checkpoint
from sim2real.training.config import RECIPE

FALLS, SEED = 200, 1  # of which a policy has to stand up
LOOK = 1.0  # s between two looks for a new checkpoint; a training writes one in minutes


@dataclass(kw_only=True)
class KeptCheckpoints:
    """Checkpoints of a training, each in a folder that can be exported."""

    training: Path
    """Folder of the training."""
    folder: Path
    """Where they are kept."""
    found: list[Path] = field(default_factory=list)
    """Their folders, the oldest first."""
    _newest: int = 0

    def look(self) -> None:
        """Keep the checkpoint of the training, if it is another one than before."""
        file = self.training / CHECKPOINT
        number = file.stat().st_ino if file.exists() else self._newest
        if number == self._newest:
            return
        kept = self.folder / f"{len(self.found):04}"
        kept.mkdir(parents=True, exist_ok=True)
        shutil.copy(self.training / RECIPE, kept)
        os.link(file, kept / CHECKPOINT)  # as it is: the training replaces it as a whole
        self._newest = (kept / CHECKPOINT).stat().st_ino
        self.found.append(kept)

    @contextmanager
    def keeping(self) -> Iterator[None]:
        """Keep all checkpoints that are written while the block runs."""
        ended = Event()

        def watch() -> None:
            while not ended.wait(LOOK):
                self.look()

        thread = Thread(target=watch)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()
            self.look()


@dataclass(frozen=True, kw_only=True)
class JudgedCheckpoint:
    """How often the policy of a checkpoint stands up."""

    minutes: float
    """Of the training until then."""
    steps: int
    """Policy steps of all robots until then."""
    stood: float
    """Share of falls that it never saw."""


def judge_until(
    kept: Iterable[Path], progress: TrainingProgress, share: float, falls: Path
) -> list[JudgedCheckpoint]:
    """Judge checkpoints until the policy of one stands up from a share of unseen falls.

    Policies that stand up from less than half of that while they explore are left out.

    Args:
        kept: Folders of checkpoints, the oldest first.
        progress: Of the training.
        share: Share that has to stand.
        falls: File of the falls: read if it exists, else written.
    """
    judged = list[JudgedCheckpoint]()
    for folder in kept:
        iteration = int(read_checkpoint(folder / CHECKPOINT)["iter"])
        if progress.share[iteration] < share / 2.0:
            continue
        minutes, steps = progress.seconds[iteration] / 60.0, int(progress.steps[iteration])
        stood = measure_stands(folder, falls)
        text = f"  {stood:6.1%} stand after {minutes:.1f} min, {steps / 1e6:.2f} million steps"
        print(text, flush=True)
        judged.append(JudgedCheckpoint(minutes=float(minutes), steps=steps, stood=stood))
        if stood >= share:
            break
    return judged


def measure_stands(checkpoint: Path, falls: Path) -> float:
    """Return the share of falls from which the policy of a checkpoint stands up."""
    policy = checkpoint / "policy.onnx"
    export(ExportRequest(folder=checkpoint, out=policy))
    request = EvaluateRequest(policy=str(policy), n=FALLS, seed=SEED, falls=falls)
    (case,) = evaluate(request).cases.values()
    return case.all.stood / case.all.n
