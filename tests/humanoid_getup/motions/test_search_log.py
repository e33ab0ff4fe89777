"""A search that was interrupted continues as if it had not been."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from humanoid_getup.experiments.rollouts import Experiment
from humanoid_getup.motions import optimization
from humanoid_getup.motions.build import make_task, settle
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.optimization import POPULATION, TrajectoryOptimizer
from humanoid_getup.progress.ledger import Ledger
from humanoid_getup.simulation.world import World
from robots import Robot

GENERATIONS = 3


@pytest.fixture(scope="module")
def world(tiny: Robot) -> World:
    return World(tiny)


@pytest.fixture(scope="module")
def keyframes() -> Keyframes:
    """A bow of both hips."""
    return Keyframes(
        name="bow",
        start_class="squat",
        strategy="bow",
        duration=np.array([0.2, 0.2]),
        keys=np.radians([[0.0, 0.0], [-20.0, -20.0], [0.0, 0.0]]),
        free=np.array([0]),
        mirrored=np.array([True]),
        torque_limit=2.0,
        time_cost=0.5,
        torque_cost=1.0,
    )


@pytest.fixture(scope="module", autouse=True)
def few_scenarios() -> Iterator[None]:
    """Judge the finalists in few disturbed worlds: which of them wins is not tested."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(optimization, "FINAL_SCENARIOS", 4)
        yield


class Interrupted(Exception):
    """Stands for a key or a kill signal."""


def search(world: World, keyframes: Keyframes, log: Ledger | None, stop: int = GENERATIONS):
    """Run a search that is interrupted after so many generations; return what it reported too."""
    reports = []

    def report(*message: float) -> None:
        reports.append(message)
        if len(reports) == stop < GENERATIONS:
            raise Interrupted

    optimizer = TrajectoryOptimizer(world, settle(world, keyframes))
    return *optimizer.optimize(keyframes, GENERATIONS, 7, report, log), reports


def test_an_interrupted_search_finds_what_another_one_finds(
    world: World, keyframes: Keyframes, tiny: Robot, tmp_path: Path, monkeypatch
):
    """What its log has is not simulated again."""
    whole, share, reports = search(world, keyframes, None)
    path, task = tmp_path / "bow.json", make_task(tiny, keyframes, 7, None)
    with pytest.raises(Interrupted):
        search(world, keyframes, Ledger(path, task), 2)
    log = Ledger.resume(path, task)
    assert len(log.done) == 2
    played, play = [], Experiment.play

    def count(*args: object, **options: object) -> object:
        played.append(len(args[1]))
        return play(*args, **options)

    monkeypatch.setattr(Experiment, "play", count)
    resumed, same_share, same_reports = search(world, keyframes, log)
    assert played.count(POPULATION * optimization.SCENARIOS) == GENERATIONS - 2
    np.testing.assert_array_equal(resumed.keys, whole.keys)
    np.testing.assert_array_equal(resumed.duration, whole.duration)
    assert (same_share, same_reports) == (share, reports)
    generations = Ledger.resume(path, task).done.values()
    assert [len(each["cost"]) for each in generations] == [POPULATION] * GENERATIONS


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"recipe": {}, "done": {"1": {"cost": "x"}}}'])
def test_a_damaged_log_is_refused_in_one_line(text: str, keyframes, tiny, tmp_path: Path):
    (tmp_path / "bow.json").write_text(text)
    with pytest.raises(ValueError, match=r"bow\.json: ") as refusal:
        Ledger.resume(tmp_path / "bow.json", make_task(tiny, keyframes, 7, None))
    assert "\n" not in str(refusal.value)
