"""`getup motions import`, `record`, `preview` and `build`: from a file or a hand to a motion."""

import shutil
from collections.abc import Callable
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from paths import SHARED
from run_getup import Run

from drivers import DriverError
from humanoid_getup.commands.motions import record_motion
from humanoid_getup.commands.motions.record_motion import RecordMotion
from humanoid_getup.execution.hand_recorder import Press
from humanoid_getup.motions.keyframes_file import KEYFRAMES, load_keyframes
from humanoid_getup.motions.motion import Motion
from robots import Posture, Robot, load_robot

ACTIONS = SHARED / "peers" / "op3_motion_4095.bin"


@pytest.fixture
def op3_folder(op3: Robot, tmp_path: Path) -> Path:
    """A copy of OP3 with one authored motion and none that is built."""
    folder = tmp_path / "my_op3"
    shutil.copytree(op3.folder, folder, ignore=shutil.ignore_patterns("motions", "policies"))
    text = (folder / KEYFRAMES).read_text("utf-8").split("# ---")[0]
    (folder / KEYFRAMES).write_text(text, "utf-8")
    return folder


@pytest.mark.skipif(not ACTIONS.exists(), reason="needs the maker's action file")
def test_the_makers_pages_become_keyframes_that_rise(run: Run, op3_folder: Path):
    before = (op3_folder / KEYFRAMES).read_text("utf-8")
    pages = ("--page", "122,123")
    code, _, error = run("motions", "import", str(ACTIONS), *pages, "--robot", str(op3_folder))
    assert code == 2
    assert "joint 'l_hip_pitch' of key number 2 is -110.742 deg" in error
    assert (op3_folder / KEYFRAMES).read_text("utf-8") == before
    options = (*pages, "--clip", "--robot", str(op3_folder))
    code, out, _ = run("motions", "import", str(ACTIONS), *options)
    assert code == 0
    assert out.count("the nearest is taken") == 10
    assert out.count("undisturbed at full torque: stood after") == 2
    front, back = load_keyframes(op3_folder / KEYFRAMES, load_robot(op3_folder))[-2:]
    assert (front.name, front.start_class) == ("f_get_up_122", "prone")
    assert (back.name, back.start_class) == ("b_get_up_123", "supine")
    code, _, error = run("motions", "import", str(ACTIONS), *options)
    assert code == 2
    assert "motion 'f_get_up_122', 'b_get_up_123' is there already" in error


def write_table(folder: Path) -> Path:
    path = folder / "kick.csv"
    path.write_text("time,l_knee_deg,r_knee_deg\n0,0,0\n0.3,60,-60\n")
    return path


def test_keys_may_go_to_a_file_of_their_own_and_be_previewed(run: Run, tmp_path: Path, op3: Robot):
    table, out = write_table(tmp_path), tmp_path / "mine.toml"
    code, message, _ = run("motions", "import", str(table), "--start", "supine", "--out", str(out))
    assert code == 0
    assert "kick: 3 keys" in message
    assert "from supine (given)" in message
    (read,) = load_keyframes(out, op3)
    assert (read.name, read.start_class) == ("kick", "supine")
    strip = tmp_path / "strip.png"
    preview = ("motions", "preview", "kick", "--keyframes", str(out), "--picture", str(strip))
    code, message, _ = run(*preview)
    assert code == 1  # a robot on its back does not rise by bending its knees
    message = " ".join(message.split())
    assert "kick, as it is: does not end in a held stand: its neck came to" in message
    assert "on the ground besides the feet since" in message
    assert "body_link" in message
    assert strip.read_bytes().startswith(b"\x89PNG") or "no film strip" in message


class Hand:
    """Moves a simulated robot, and presses a key some cycles later."""

    def __init__(self, robot: Robot, postures: list[np.ndarray], last: Press | None) -> None:
        self._robot, self._postures, self._last, self._calls = robot, postures, last, 0
        self.place: Callable[[Posture], None]

    def poll(self) -> Press | None:
        number, cycle = divmod(self._calls, 4)
        self._calls += 1
        if number == len(self._postures):
            if self._last is None:
                raise DriverError("the cable is loose")
            return self._last
        if cycle == 0:
            self.place(replace(self._robot.standing, joint_pos=self._postures[number]))
        return Press.TAKE if cycle == 2 else None


@pytest.fixture
def record(run: Run, own_robot: Path, monkeypatch: pytest.MonkeyPatch):
    """Record the smallest robot in simulated time; return exit code and output."""
    open_backend = record_motion.open_backend

    def record(
        postures: list[np.ndarray], *options: str, last: Press | None = Press.FINISH
    ) -> tuple[int, str, str]:
        hand = Hand(load_robot(own_robot), postures, last)

        @contextmanager
        def open_unpaced(command: RecordMotion, *rest: Any):
            assert command.realtime  # a person takes time
            is_paced = command.backend == "virtual"
            with open_backend(replace(command, realtime=is_paced), *rest) as choice:
                hand.place = choice.place
                yield choice

        monkeypatch.setattr(record_motion, "open_backend", open_unpaced)
        monkeypatch.setattr(record_motion, "open_presses", lambda: nullcontext(hand))
        code, out, error = run("motions", "record", "bow", "--robot", str(own_robot), *options)
        return code, " ".join(out.split()), error

    return record


@pytest.mark.parametrize(
    ("backend", "degrees"),
    # On the bus, simulated time goes on by itself while no goals are sent.
    [("twin", 2.0), pytest.param("virtual", 8.0, marks=(pytest.mark.realtime, pytest.mark.slow))],
)
def test_a_robot_moved_by_hand_is_recorded(backend, degrees, record, own_robot: Path):
    postures = [np.radians(angles) for angles in ([0.0, 0.0], [-60.0, -60.0], [-30.0, -30.0])]
    code, out, _ = record(postures, "--start", "squat", "--backend", backend)
    assert code == 0, out
    robot = load_robot(own_robot)
    (read,) = load_keyframes(own_robot / KEYFRAMES, robot)
    assert read.start_class == "squat"
    # Limp legs fall a little in the cycles before the key is pressed.
    taken = [*np.degrees(postures), [0.0, 0.0]]
    np.testing.assert_allclose(np.degrees(read.keys), taken, atol=degrees)
    # Times are those of the ways, at 1.5 rad/s.
    assert read.duration == pytest.approx(
        [np.pi / 3 / 1.5, np.pi / 6 / 1.5, np.pi / 6 / 1.5], abs=0.1
    )
    assert "bow: 4 keys" in out


def test_a_fault_keeps_the_keys_that_were_taken(record, own_robot: Path):
    code, out, _ = record([np.zeros(2), np.radians([-30.0, -30.0])], "--start", "squat", last=None)
    assert code == 3
    assert "the cable is loose" in out
    (read,) = load_keyframes(own_robot / KEYFRAMES, load_robot(own_robot))
    assert len(read.keys) == 3


def test_a_name_that_is_taken_is_refused_before_anybody_moves(record, own_robot: Path):
    assert record([np.zeros(2)], "--start", "squat")[0] == 0
    before = (own_robot / KEYFRAMES).read_bytes()
    code, _, error = record([np.zeros(2)])
    assert code == 2
    assert "motion 'bow' is there already" in error
    assert (own_robot / KEYFRAMES).read_bytes() == before


@pytest.mark.slow
def test_a_build_that_fails_keeps_its_best_try_and_continues(run: Run, op3_folder: Path):
    robot = ("--robot", str(op3_folder))
    write_table(op3_folder)
    assert (
        run("motions", "import", str(op3_folder / "kick.csv"), "--start", "supine", *robot)[0] == 0
    )
    build = ("motions", "build", "kick", *robot)
    code, out, _ = run(*build, "--generations", "1")
    assert code == 1
    message = " ".join(out.split())
    assert "not built: motion 'kick' does not end in a held stand: its neck came to" in message
    unfinished = op3_folder / "unfinished"
    best = Motion.load(unfinished / "kick.npz")
    assert (best.name, best.end_class) == ("kick", "other")
    assert "neck came to" in str(best.provenance["failure"])
    assert len(load_keyframes(unfinished / "kick.toml", load_robot(op3_folder))) == 1
    code, out, _ = run(*build, "--generations", "2", "--resume")
    assert code == 1
    assert "kick continues after generation 1" in out
    assert len((unfinished / "kick.jsonl").read_text().splitlines()) == 1 + 2
    code, _, error = run(*build, "--resume", "--seed", "5")
    assert code == 2
    assert "kick.jsonl: made with another seed" in error
