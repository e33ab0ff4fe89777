"""`getup motions discover`: a robot without motions, keys or policies gets its own by a search."""

import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest
from run_getup import Run

from humanoid_getup.commands.motions import search_motions
from humanoid_getup.commands.motions.discover_motions import (
    DiscoverRequest,
    discover,
)
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion, load_database, suggest_motions
from humanoid_getup.playback.preflight import Reason, ReasonKind, Verdict
from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery, SideSearch
from humanoid_getup.posture_chains.motion_maker import MadeMotion
from humanoid_getup.progress.callback import CancelledError, Progress
from robots import Robot, load_robot

pytestmark = pytest.mark.usefixtures("few_postures", "known_ways_up")

STORED = {
    "supine": "supine_sit_up_fast",
    "prone": "prone_push_up_fast",
    "left": "lateral_side_sit",
}
DISCOVER = ("motions", "discover", "--robot", "bare")


@pytest.fixture
def bare(op3: Robot, tmp_path: Path) -> Path:
    """Return a folder of OP3 without motions, keys and policies."""
    hidden = shutil.ignore_patterns("motions", "policies", "keyframes.toml")
    return Path(shutil.copytree(op3.folder, tmp_path / "bare", ignore=hidden))


@pytest.fixture
def small_batches(monkeypatch: pytest.MonkeyPatch) -> None:
    small = partial(SearchSettings, batch=4, worlds=2, threads=1)
    monkeypatch.setattr(search_motions, "SearchSettings", small)


@pytest.fixture
def found(op3: Robot, monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Let every search find stored rises at once; return their names."""
    keys = {each.name: each for each in load_keyframes(op3.folder / "keyframes.toml", op3)}
    names = list[str]()

    def advance(self: ChainDiscovery) -> Iterator[tuple[SideSearch, MadeMotion]]:
        for each in self.sides:
            names.append(f"{each.side}_found_1")
            motion = replace(find_motion(op3, STORED[each.side]), name=names[-1])
            keyframes = replace(keys[STORED[each.side]], name=names[-1])
            each.kept.append(motion)
            yield each, MadeMotion(keyframes=keyframes, share=1.0, motion=motion)

    monkeypatch.setattr(ChainDiscovery, "advance", advance)
    return names


@pytest.mark.usefixtures("small_batches")
def test_motions_and_their_keys_are_stored_drawn_and_never_replaced(
    bare: Path, run: Run, found: list[str]
):
    code, out, _ = run(*DISCOVER, "--most", "1")
    assert code == 0
    robot = load_robot(bare)
    assert {motion.name for motion in load_database(robot).motions} >= set(found)
    assert [each.name for each in load_keyframes(bare / "keyframes.toml", robot)] == found
    assert Path("op3_motions.png").stat().st_size > 10_000
    assert "motion 'prone_found_1' (" in out
    assert "next: getup rise --robot" in out
    assert not (bare / "unfinished").exists()

    before = {file: file.read_bytes() for file in (bare / "motions").iterdir()}
    code, _, error = run(*DISCOVER, "--most", "1")
    assert code == 2
    assert "motions of an earlier search are there: supine_found_1, prone_found_1" in error
    assert "--resume" not in error
    assert {file: file.read_bytes() for file in (bare / "motions").iterdir()} == before
    (bare / "motions" / "prone_found_1.npz").unlink()
    hidden = (bare / "keyframes.toml").read_text("utf-8").replace("prone_found_1", "push")
    (bare / "keyframes.toml").write_text(hidden, "utf-8")
    assert "or search the others with --sides prone" in run(*DISCOVER, "--most", "1")[2]
    assert suggest_motions(load_robot(bare)).endswith("--sides prone")


@pytest.mark.usefixtures("small_batches")
def test_a_cancelled_search_goes_on_and_says_how_when_its_budget_ends(bare: Path, run: Run):
    reports = list[Progress]()
    request = DiscoverRequest(robot=str(bare), sides=("supine",), budget=1e6)
    with pytest.raises(CancelledError):
        discover(request, reports.append, lambda: any(each.done > 50.0 for each in reports))
    file = bare / "unfinished" / "search.npz"
    size = file.stat().st_size
    wanted = (*DISCOVER, "--sides", "supine", "--budget", "100")
    code, _, error = run(*wanted)
    assert code == 2
    assert "a search that ended before it was done is there: go on with --resume" in error
    code, out, _ = run(*wanted, "--resume")
    assert code == 1
    assert re.search(r"goes on after \d+ s simulated: supine: \d+%", out)
    assert "no motion from: supine" in out
    assert re.search(r"supine: no chain stands; .* after \d+ moves, has its neck at \d+%", out)
    assert f"next: getup {' '.join(wanted)} --resume" in out
    assert Path("op3_motions.png").stat().st_size > 5_000
    assert file.stat().st_size > size
    assert not (bare / "motions").exists()


def test_a_search_accepts_what_the_preflight_passes(
    bare: Path, op3: Robot, monkeypatch: pytest.MonkeyPatch
):
    accepts, reasons = list[Callable[[Motion], str]](), list[Reason]()

    def begin(*_: object, accept: Callable[[Motion], str], **__: object) -> None:
        accepts.append(accept)
        raise InterruptedError  # a search takes seconds to begin

    monkeypatch.setattr(search_motions, "ChainDiscovery", begin)
    monkeypatch.setattr(
        search_motions, "preflight_stored", lambda *_: Verdict(reasons=tuple(reasons))
    )
    with pytest.raises(InterruptedError):
        discover(DiscoverRequest(robot=str(bare)))
    motion = find_motion(op3, "supine_sit_up_fast")
    assert accepts[0](motion) == ""
    reasons.append(Reason(kind=ReasonKind.REFUSE, joint=None, text="too hot"))
    assert accepts[0](motion) == "the preflight refuses it: too hot"


@pytest.mark.slow
def test_op3_finds_a_rise_from_its_back(bare: Path, run: Run):
    code, out, _ = run(*DISCOVER, "--sides", "supine", "--most", "1", "--seed", "4")
    assert code == 0, out
    motion = Motion.load(bare / "motions" / "supine_found_1.npz")
    assert float(motion.provenance["disturbed_success"]) >= 0.9
