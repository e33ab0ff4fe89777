"""`getup motions discover`: a robot without motions, keys or policies gets its own by a search."""

import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.main import main
from humanoid_getup.commands.motions import search_motions
from humanoid_getup.commands.motions.discover_motions import (
    DiscoverRequest,
    SearchPiece,
    discover,
    discover_all,
    search_piece,
)
from humanoid_getup.commands.pieces import SharedFolder
from humanoid_getup.motions.keyframes_file import load_keyframes
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import find_motion, load_database, suggest_motions
from humanoid_getup.playback.preflight import Reason, ReasonKind, Verdict
from humanoid_getup.posture_chains.chain_search import SearchSettings
from humanoid_getup.posture_chains.discovery import ChainDiscovery, SideSearch
from humanoid_getup.posture_chains.motion_maker import MadeMotion
from humanoid_getup.progress.callback import CancelledError, Progress
from robots import Robot, load_robot

pytestmark = pytest.mark.usefixtures("few_postures")

SIDES = ("supine", "prone", "left")
SHARED = ("--sides", "supine", "--budget", "1", "--seed", "4")
HOT = Reason(kind=ReasonKind.REFUSE, joint=None, text="too hot")
Getup = Callable[..., tuple[int, str, str]]


@pytest.fixture
def bare(op3: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of OP3 without motions, keys and policies; searches take small batches."""
    hidden = shutil.ignore_patterns("motions", "policies", "keyframes.toml")
    shutil.copytree(op3.folder, tmp_path / "bare", ignore=hidden)
    monkeypatch.chdir(tmp_path)
    small = partial(SearchSettings, batch=4, worlds=2, threads=1)
    monkeypatch.setattr(search_motions, "SearchSettings", small)
    return tmp_path / "bare"


@pytest.fixture
def getup(capsys: pytest.CaptureFixture[str]) -> Getup:
    """Return a function that discovers motions of the bare robot."""

    def run(*options: str) -> tuple[int, str, str]:
        code = main(["motions", "discover", "--robot", "bare", *options])
        out, err = capsys.readouterr()
        return code, out, err

    return run


@pytest.fixture
def found(op3: Robot, monkeypatch: pytest.MonkeyPatch) -> list[MadeMotion]:
    """Let every search find stored rises at once; return them as they were made."""
    stored = {
        "supine": "supine_sit_up_fast",
        "prone": "prone_push_up_fast",
        "left": "lateral_side_sit",
    }
    keys = {each.name: each for each in load_keyframes(op3.folder / "keyframes.toml", op3)}
    made = list[MadeMotion]()

    def advance(self: ChainDiscovery) -> Iterator[tuple[SideSearch, MadeMotion]]:
        for each in self.sides:
            name = f"{each.side}_found_1"
            motion = replace(find_motion(op3, stored[each.side]), name=name)
            keyframes = replace(keys[stored[each.side]], name=name)
            each.kept.append(motion)
            made.append(MadeMotion(keyframes=keyframes, share=1.0, motion=motion))
            yield each, made[-1]

    monkeypatch.setattr(ChainDiscovery, "advance", advance)
    return made


def test_motions_and_their_keys_are_stored_and_drawn(
    bare: Path, getup: Getup, found: list[MadeMotion]
):
    code, out, _ = getup("--most", "1")
    assert code == 0
    robot = load_robot(bare)
    assert {motion.name for motion in load_database(robot).motions} >= {
        f"{side}_found_1" for side in SIDES
    }
    keys = load_keyframes(bare / "keyframes.toml", robot)
    assert [each.name for each in keys] == [made.keyframes.name for made in found]
    assert Path("op3_motions.png").stat().st_size > 10_000
    assert "motion 'prone_found_1' (" in out
    assert "next: getup rise --robot" in out
    assert not (bare / "unfinished").exists()


@pytest.mark.usefixtures("found", "no_film")
def test_motions_of_an_earlier_search_are_never_replaced(bare: Path, getup: Getup):
    assert getup("--most", "1")[0] == 0
    before = {file: file.read_bytes() for file in (bare / "motions").iterdir()}
    code, _, err = getup("--most", "1")
    assert code == 2
    assert "motions of an earlier search are there: supine_found_1, prone_found_1" in err
    (bare / "motions" / "prone_found_1.npz").unlink()
    hidden = (bare / "keyframes.toml").read_text("utf-8").replace("prone_found_1", "push")
    (bare / "keyframes.toml").write_text(hidden, "utf-8")
    assert "or search the others with --sides prone" in getup("--most", "1")[2]
    assert suggest_motions(load_robot(bare)).endswith("--sides prone")
    (bare / "motions" / "prone_found_1.npz").write_bytes(
        before[bare / "motions" / "prone_found_1.npz"]
    )
    assert "--resume" not in err
    assert {file: file.read_bytes() for file in (bare / "motions").iterdir()} == before


def test_a_search_whose_budget_ends_says_how_to_go_on_and_does(bare: Path, getup: Getup):
    options = ("--sides", "supine", "--budget", "100")
    code, out, _ = getup(*options)
    assert code == 1
    assert "no motion from: supine" in out
    assert re.search(r"supine: no chain stands; .* after \d+ moves, has its neck at \d+%", out)
    assert Path("op3_motions.png").stat().st_size > 5_000
    again = "getup motions discover --robot bare --sides supine --budget 100 --resume"
    assert f"next: {again}" in out
    file = bare / "unfinished" / "search.npz"
    size = file.stat().st_size
    assert "--sides is 'up'" in getup("--sides", "up")[2]
    code, _, err = getup(*options)
    assert code == 2
    assert "a search that ended before it was done is there: go on with --resume" in err
    code, out, _ = getup(*options, "--resume")
    assert code == 1
    assert re.search(r"goes on after \d+ s simulated: supine: \d+%", out)
    assert file.stat().st_size > size
    assert not (bare / "motions").exists()


@pytest.mark.usefixtures("no_film")
def test_a_cancelled_search_can_be_resumed(bare: Path, getup: Getup):
    reports = list[Progress]()
    request = DiscoverRequest(robot=str(bare), sides=("supine",), budget=1e6)
    with pytest.raises(CancelledError):
        discover(request, reports.append, lambda: any(each.done > 50.0 for each in reports))
    assert (bare / "unfinished" / "search.npz").exists()
    assert getup("--sides", "supine", "--budget", "1", "--resume")[0] == 1


@pytest.mark.parametrize(
    ("reasons", "failure"), [((), ""), ((HOT,), "the preflight refuses it: too hot")]
)
def test_a_search_accepts_what_the_preflight_passes(
    bare: Path, op3: Robot, monkeypatch: pytest.MonkeyPatch, reasons: tuple[Reason], failure: str
):
    accepts = list[Callable[[Motion], str]]()

    def begin(*_: object, accept: Callable[[Motion], str], **__: object) -> None:
        accepts.append(accept)
        raise InterruptedError  # a search takes seconds to begin

    monkeypatch.setattr(search_motions, "ChainDiscovery", begin)
    monkeypatch.setattr(search_motions, "preflight_stored", lambda *_: Verdict(reasons=reasons))
    with pytest.raises(InterruptedError):
        discover(DiscoverRequest(robot=str(bare)))
    assert accepts[0](find_motion(op3, "supine_sit_up_fast")) == failure


@pytest.mark.slow
def test_op3_finds_a_rise_from_its_back(
    op3: Robot, tmp_path: Path, getup: Getup, monkeypatch: pytest.MonkeyPatch
):
    hidden = shutil.ignore_patterns("motions", "policies", "keyframes.toml")
    shutil.copytree(op3.folder, tmp_path / "bare", ignore=hidden)
    monkeypatch.chdir(tmp_path)
    code, out, _ = getup("--sides", "supine", "--most", "1", "--seed", "4")
    assert code == 0, out
    motion = Motion.load(tmp_path / "bare" / "motions" / "supine_found_1.npz")
    assert float(motion.provenance["disturbed_success"]) >= 0.9


@pytest.fixture
def two(bare: Path) -> list[Path]:
    """Return the folders of two robots without motions, one and two."""
    folders = [Path(shutil.copytree(bare, bare.with_name(name))) for name in ("one", "two")]
    for folder in folders:
        described = (folder / "robot.toml").read_text("utf-8")
        renamed = re.sub(r"(?m)^name = .*", f'name = "{folder.name}"', described, count=1)
        (folder / "robot.toml").write_text(renamed, "utf-8")
    return folders


@pytest.mark.slow
def test_several_robots_are_searched_in_one_command(
    two: list[Path], capsys: pytest.CaptureFixture[str]
):
    assert main(["motions", "discover", "--robot", "one,two", *SHARED]) == 1
    out = capsys.readouterr().out
    assert "one: 0 motions, none from supine" in out
    assert "two: 0 motions, none from supine" in out
    assert all((folder / "unfinished" / "search.npz").exists() for folder in two)
    assert Path("one_motions.png").exists() and Path("two_motions.png").exists()


@pytest.mark.slow
@pytest.mark.usefixtures("no_film")
def test_a_cancelled_search_of_several_robots_is_resumed_where_it_was(two: list[Path]):
    reports = list[Progress]()
    request = DiscoverRequest(robot="one,two", sides=("supine",), budget=1.0)
    with pytest.raises(CancelledError):
        discover_all(request, reports.append, lambda: reports[-1].phase == "two: search")
    files = [folder / "unfinished" / "search.npz" for folder in two]
    assert [file.exists() for file in files] == [True, True]
    found = discover_all(replace(request, resume=True), reports.append)
    assert [each.robot.name for each in found] == ["one", "two"]
    lines = [each.message for each in reports]
    for name in ("one", "two"):
        assert any(line.startswith(f"{name}: goes on after") for line in lines)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--robot", "one,one"), "--robot has one twice, expected robots of different names"),
        (("--robot", "one,two", "--picture", "a.png"), "--picture is given, expected none with"),
        (("quick", "--robot", "one,two"), "--robot is one,two, expected one with a policy"),
        (("quick", "--robot", "one", "--engine", "local:2"), "--engine is given, expected none"),
        (("quick", "--robot", "one", "--resume"), "--resume is given, expected none with a policy"),
        (("--robot", "one", "--sides", "right"), "expected supine, prone or left"),
    ],
)
def test_options_that_do_not_fit_are_refused(
    two: list[Path],
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    message: str,
):
    assert main(["motions", "discover", *options]) == 2
    assert message in capsys.readouterr().err
    assert not any((folder / "unfinished").exists() for folder in two)


def test_a_worker_that_does_not_share_the_folder_is_refused(two: list[Path], tmp_path: Path):
    request = DiscoverRequest(robot=str(two[0]))
    folder = SharedFolder(folder=two[0], mark=tmp_path / "elsewhere")
    piece = SearchPiece(request=request, before=None, prefix="", folder=folder)
    with pytest.raises(BadInputError, match="expected one that all machines share"):
        search_piece(1, piece)
    assert not (two[0] / "unfinished").exists()
