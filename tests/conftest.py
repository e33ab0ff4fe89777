import contextlib
import shutil
import signal
from collections.abc import Generator, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import settings

# Triton, which some builds of torch bring, crashes if it is loaded after Mesa's LLVM has
# rendered a picture in the same process.
with contextlib.suppress(ImportError):
    import triton  # noqa: F401  # pyright: ignore[reportMissingImports]

from humanoid_getup.reporting import film_strip
from humanoid_getup.simulation.world import World
from robots import Robot, load_robot
from robots.transmission import Coupling

pytest_plugins = ["processor_times", "few_postures"]

TINY = Path(__file__).parent / "robots" / "tiny"

# One seed, and no deadline: two cores are shared with other tests.
settings.register_profile("tests", deadline=None, derandomize=True)
settings.load_profile("tests")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol() -> Generator[None, object, object]:
    """Give signals their handlers back, which commands replace; end the run at a Ctrl-C.

    A command that is interrupted returns its exit code, and ignores all further signals.
    """
    before = {name: signal.getsignal(name) for name in (signal.SIGINT, signal.SIGTERM)}
    done = yield
    is_interrupted = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    for name, handler in before.items():
        signal.signal(name, handler)
    if is_interrupted and before[signal.SIGINT] is not signal.SIG_IGN:
        raise KeyboardInterrupt
    return done


@pytest.fixture(scope="session")
def op3() -> Robot:
    return load_robot("op3")


@pytest.fixture(scope="session")
def tiny() -> Robot:
    return load_robot(TINY)


@pytest.fixture(scope="session")
def swing(tiny: Robot, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight log of the tiny robot."""
    from flight_recording import record_swing, twin_of  # not before a GL is chosen, above

    path = tmp_path_factory.mktemp("swing") / "swing.mcap"
    record_swing(path, tiny, twin_of(tiny), tiny.standing)
    return path


@pytest.fixture(scope="session")
def geared(tiny: Robot) -> Robot:
    """The tiny robot with a gear on each hip: one servo turns faster than its joint, one slower."""
    pairs = zip(tiny.joints, (1.2, 10 / 11), strict=True)
    joints = [replace(joint, servo=replace(joint.servo, gear=gear)) for joint, gear in pairs]
    return replace(tiny, joints=tuple(joints))


@pytest.fixture(scope="session")
def coupled(tiny: Robot) -> Robot:
    """The tiny robot whose two servos turn both hips through a lopsided differential."""
    coupling = Coupling(joints=(0, 1), matrix=np.array([[0.9, -0.5], [0.6, 0.7]]))
    return replace(tiny, couplings=(coupling,))


@pytest.fixture(scope="session")
def world(op3: Robot) -> World:
    return World(op3)


@pytest.fixture(scope="session", autouse=True)
def draft_pictures() -> Iterator[None]:
    """Render without shadows and smooth edges, and store few pixels, in a third of the time."""
    render, save = film_strip._open, film_strip.save_figure

    def render_draft(model: Any, height: int, width: int) -> Any:
        model.vis.quality.shadowsize = model.vis.quality.offsamples = 0
        return render(model, height, width)

    def save_draft(figure: Any, path: Path, dpi: int) -> None:
        save(figure, path, dpi=dpi // 4)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(film_strip, "_open", render_draft)
        patch.setattr(film_strip, "save_figure", save_draft)
        yield


@pytest.fixture
def no_film(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no film strips, as where there is no GL: a second each."""

    def render(*_, **__):
        raise film_strip.NoRendererError("not drawn in this test")

    monkeypatch.setattr(film_strip, "render_frames", render)


@pytest.fixture
def own_robot(tmp_path: Path) -> Path:
    """A user's own robot folder, to be spoiled by the test."""
    return Path(shutil.copytree(TINY, tmp_path / "mine"))
