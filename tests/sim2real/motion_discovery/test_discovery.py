"""Discovery of motions in the rises of a policy: shaping, kinds, preflight, and the command."""

import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from humanoid_getup.commands.main import main
from humanoid_getup.motions.build import ATTITUDES
from humanoid_getup.motions.keyframes import SPEED_SHARE
from humanoid_getup.motions.motion import Motion
from humanoid_getup.motions.motion_database import load_database
from humanoid_getup.playback.preflight import Reason, ReasonKind, Verdict
from humanoid_getup.posture_chains.rise_kind import KindNamer
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, quaternion
from robots.kinematics import place
from sim2real import motion_discovery as discovery
from sim2real.motion_discovery import (
    BALANCING,
    SMOOTHINGS,
    PolicyRise,
    Replay,
    group_rises,
    name_kind,
    shape,
)


def make_replay(world: World, sides: list[str], bend: float = 0.0) -> Replay:
    """Make a rise that lies on sides for 0.4 s each, its joints bent by so much [rad]."""
    robot = world.robot
    rows = []
    for side in sides:
        axis, angle = ATTITUDES[side]
        posture = Posture(
            position=np.array([0.0, 0.0, 0.3]),
            orientation=quaternion.from_axis_angle(np.array(axis), angle),
            joint_pos=robot.standing.joint_pos + bend,
        )
        rows += [place(robot, world.model, posture)] * round(0.4 / robot.control_period)
    qpos = np.array(rows)
    rise = PolicyRise(
        start_class=sides[0],  # type: ignore[arg-type]
        start=qpos[0],
        target=np.zeros((len(qpos), robot.n)),
        stand_time=len(qpos) * robot.control_period,
    )
    return Replay(
        rise=rise,
        target=rise.target,
        qpos=qpos,
        stood=np.ones(2, dtype=bool),
        stand_time=rise.stand_time,
        rms_torque=1.0,
    )


def test_a_kind_names_the_sides_passed_and_rises_of_other_kinds_or_angles_are_apart(op3):
    world = World(op3)
    namer, direct = KindNamer(world), make_replay(world, ["supine", "standing"])
    assert name_kind(namer, world, direct) == "learned"
    over = make_replay(world, ["supine", "left", "prone", "squat"])
    assert name_kind(namer, world, over) == "learned, over left, prone"
    straight = [make_replay(world, ["supine", "squat"], bend) for bend in (0.0, 0.02, 1.0)]
    groups = group_rises(world, [*straight, over])
    assert groups == [straight[:2], [straight[2]], [over]]


@pytest.mark.parametrize("passes", [True, False])
def test_what_the_preflight_refuses_is_not_kept(
    op3: Robot, monkeypatch: pytest.MonkeyPatch, passes: bool
):
    world = World(op3)
    stored = next(m for m in load_database(op3).motions if m.start_class == "supine")
    start = place(op3, world.model, stored.posture(0))
    rise = PolicyRise(start_class="supine", start=start, target=stored.joint_target, stand_time=1.0)
    replay = Replay(
        rise=rise,
        target=stored.joint_target,
        qpos=np.tile(start, (len(stored.joint_target) + 10, 1)),
        stood=np.ones(48, dtype=bool),
        stand_time=1.0,
        rms_torque=0.5,
    )
    reason = Reason(kind=ReasonKind.REFUSE, joint=None, text="too hot")
    seen: list[Motion] = []

    def check(_world: World, motion: Motion, **_options: object) -> Verdict:
        seen.append(motion)
        return Verdict(reasons=() if passes else (reason,))

    monkeypatch.setattr(discovery, "collect_rises", lambda *_: [rise])
    monkeypatch.setattr(discovery.MotionDiscovery, "play", lambda *_: replay)
    monkeypatch.setattr(discovery, "with_entries", lambda _world, motion: motion)
    monkeypatch.setattr(discovery, "preflight_stored", check)
    finder = discovery.MotionDiscovery(world, None, policy_name="robust", seed=0)  # type: ignore[arg-type]
    found = finder.search("supine", count=1, most=1)
    assert (found.learned, found.replayed, found.best_share) == (1, 1, 1.0)
    assert len(seen) == 1
    assert list(found.motions) == (seen if passes else [])


@pytest.fixture
def bare(op3: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of OP3 with its policies and without motions."""
    shutil.copytree(op3.folder, tmp_path / "bare", ignore=shutil.ignore_patterns("motions"))
    monkeypatch.chdir(tmp_path)
    return tmp_path / "bare"


@pytest.mark.slow
def test_motions_are_discovered_from_every_side_and_can_be_played(
    bare: Path, capsys: pytest.CaptureFixture[str]
):
    options = ("--robot", "bare", "--rises", "12", "--most", "1")
    assert main(["motions", "discover", "quick", *options]) == 0
    out = capsys.readouterr().out
    files = sorted((bare / "motions").iterdir())
    assert [file.stem for file in files] == ["left_quick_1", "prone_quick_1", "supine_quick_1"]
    for motion in map(Motion.load, files):
        assert motion.provenance["disturbed_success"] >= 0.8
        assert motion.provenance["policy"] == "quick"
        assert f"motion '{motion.name}' ({motion.strategy}) stands" in out
    assert main(["play", "prone_quick_1", "--robot", "bare", "--out", "played"]) == 0
    assert main(["motions", "discover", "quick", *options]) == 2
    assert "are there already: left_quick_1, prone_quick_1" in capsys.readouterr().err


def test_a_policy_with_style_curves_is_refused(bare: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["motions", "discover", "styled", "--robot", "bare"]) == 2
    assert "follows style curves, expected one without" in capsys.readouterr().err
    assert not (bare / "motions").exists()


def make_rise(robot: Robot, seed: int, step: float, stand_time: float = 1.0) -> PolicyRise:
    """Make targets that walk at random by steps [rad] at each control period."""
    walk = np.random.default_rng(seed).uniform(-step, step, (400, robot.n)).cumsum(axis=0)
    return PolicyRise(
        start_class="supine", start=np.zeros(robot.n + 7), target=walk, stand_time=stand_time
    )


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), step=st.floats(0.0, 0.5), smoothing=st.sampled_from(SMOOTHINGS))
def test_shaped_targets_are_never_faster_than_the_servos_and_end_standing(
    op3: Robot, seed: int, step: float, smoothing: float
):
    rise = make_rise(op3, seed, step)
    shaped = shape(op3, rise, smoothing)
    speed = np.abs(np.diff(shaped, axis=0)) / op3.control_period
    assert np.all(speed <= SPEED_SHARE * op3.max_velocity * 1.001)
    assert shaped[0] == pytest.approx(rise.target[0])
    assert shaped[-1] == pytest.approx(op3.standing.joint_pos)


def test_slow_targets_stay_until_the_policy_has_balanced_unless_they_are_smoothed(op3: Robot):
    rise = make_rise(op3, 0, 0.02)
    count = round((rise.stand_time + BALANCING) / op3.control_period)
    assert np.array_equal(shape(op3, rise, 0.0)[:count], rise.target[:count])
    rough, smooth = (np.diff(shape(op3, rise, s), n=2, axis=0)[50:200] for s in (0.0, 0.05))
    assert np.square(smooth).mean() < 0.01 * np.square(rough).mean()
