"""Plans of one attempt: made again where they fall in the preflight, and after a move."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from prone_motions import RIGHT, WRONG

from drivers import Twin
from humanoid_getup.execution import attempt_manager
from humanoid_getup.execution.attempt_manager import MOST_MOVES, MOST_PLANS
from humanoid_getup.execution.get_up import get_up as get_robot_up
from humanoid_getup.execution.rise import AttemptStatus, Rise
from humanoid_getup.execution.session import DeadReckoning, SessionOptions
from humanoid_getup.motions.motion import NO_END, Motion
from humanoid_getup.playback.preflight import Reason, ReasonKind, Verdict
from humanoid_getup.simulation.placement import Placement
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Plan, RiseStatus
from robots import FULL_TORQUE, Posture, quaternion


@dataclass
class Plans:
    """A strategy that makes the plans that it is given, one after the other."""

    world: World
    plans: list[Plan]
    torque_limit = FULL_TORQUE
    starts: list[Posture] = field(default_factory=list)

    def plan(self, start: Posture, _rng: np.random.Generator) -> Plan:
        self.starts.append(start)
        return self.plans.pop(0)


class Passed(Plan):
    """A plan that the preflight lets pass, without a rollout."""

    def preflight(self, *_) -> Verdict:
        return Verdict()


class Fallen(Verdict):
    """A verdict of a motion that falls."""

    falls = another_may_pass = True


class Falls(Plan):
    """A plan that the preflight refuses, without a rollout."""

    def preflight(self, *_) -> Verdict:
        return Fallen((Reason(ReasonKind.REFUSE, None, "it does not end in a held stand"),))


@pytest.fixture
def move(world: World, prone: Posture) -> Plan:
    """Lift an arm and lay it down."""
    frames = 60
    target = np.tile(prone.joint_pos, (frames, 1))
    shoulder = world.robot.joint_names.index("l_sho_pitch")
    target[:, shoulder] += 0.5 * np.sin(np.linspace(0.0, np.pi, frames))
    motion = Motion.through(
        [prone] * frames,
        world.robot.control_period,
        name="lift_an_arm",
        robot=world.robot.name,
        start_class="prone",
        end_class=NO_END,
        strategy="crawl",
        joint_target=target,
    )
    return Plan(status=RiseStatus.MOVES, motion=motion, plan_s=2.0)


def get_up(world: World, prone: Posture, plans: list[Plan], **options) -> tuple[Rise, Plans]:
    strategy = Plans(world, plans)
    chosen, twin = SessionOptions(**options), Twin(world, prone)
    return get_robot_up(twin, strategy, max_attempts=1, options=chosen), strategy


def test_a_searched_plan_that_falls_in_the_preflight_is_made_again(world, prone, motions):
    wrong = Falls(status=RiseStatus.STOOD, motion=motions[WRONG], plan_s=1.0)
    right = Plan(status=RiseStatus.STOOD, motion=motions[RIGHT], plan_s=0.5)
    result, _ = get_up(world, prone, [wrong, right])
    assert result.status is AttemptStatus.STOOD
    (attempt,) = result.attempts
    assert attempt.refused == (wrong,)
    figures = result.figures()
    assert (figures.refused_plans, figures.moves, figures.attempts) == (1, 0, 1)
    assert figures.plan_s == pytest.approx(1.5)


def test_after_a_few_plans_that_fall_nothing_is_played(world, prone, motions):
    wrong = Falls(status=RiseStatus.STOOD, motion=motions[WRONG])
    result, strategy = get_up(world, prone, [wrong] * (MOST_PLANS + 1))
    assert len(strategy.starts) == MOST_PLANS
    assert result.times_played == 0
    assert result.attempts[0].refusal is not None
    assert "it does not end in a held stand" in result.attempts[0].refusal


def test_a_robot_that_tips_over_while_it_is_planned_for_is_planned_for_again(
    world, prone, motions, monkeypatch
):
    """The first estimate is that of a robot on its side, which then rolls onto its front."""
    rolled = quaternion.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.pi / 2.0)
    on_edge = replace(prone, orientation=quaternion.multiply(rolled, prone.orientation))
    estimates = iter([on_edge])
    monkeypatch.setattr(attempt_manager, "estimate_posture", lambda *_: next(estimates, prone))
    for_the_side = Plan(status=RiseStatus.STORED, motion=_begin_as(motions[RIGHT], on_edge))
    right = Passed(status=RiseStatus.STOOD, motion=motions[RIGHT])
    result, strategy = get_up(world, prone, [for_the_side, right])
    assert [start is prone for start in strategy.starts] == [False, True]
    assert result.stood
    assert result.figures().refused_plans == 1


def _begin_as(motion: Motion, posture: Posture) -> Motion:
    turned = motion.orientation.copy()
    turned[0] = posture.orientation
    return replace(motion, orientation=turned)


def test_a_motion_that_would_be_the_same_again_is_not_planned_again(world, prone, motions):
    stored = Falls(status=RiseStatus.STORED, motion=motions[WRONG])
    result, strategy = get_up(world, prone, [stored] * 2)
    assert len(strategy.starts) == 1
    assert not result.stood


def test_after_a_move_the_robot_settles_and_is_planned_for_again(world, prone, motions, move):
    rise = Passed(status=RiseStatus.STOOD, motion=motions[RIGHT], plan_s=0.5)
    moved = []
    result, strategy = get_up(world, prone, [move, rise], moved=moved.append, settle=False)
    assert result.status is AttemptStatus.STOOD
    assert moved == [move]
    assert len(strategy.starts) == 2
    # The torso stays where it is; what the arm does is measured, not taken from the plan.
    assert np.abs(strategy.starts[1].joint_pos - strategy.starts[0].joint_pos).max() > 1e-4
    figures = result.figures()
    assert (figures.moves, figures.refused_plans, figures.plan_s) == (1, 0, 2.5)


def test_a_robot_that_only_moves_is_given_up(world, prone, move):
    result, _ = get_up(world, prone, [move] * (MOST_MOVES + 1))
    assert result.status is AttemptStatus.NEEDS_HELP
    assert result.reason == f"no room to rise after {MOST_MOVES} moves"
    assert len(result.attempts[0].moves) == MOST_MOVES


def test_after_a_move_that_turns_the_robot_it_is_looked_for_in_that_heading(
    world, prone, motions, move
):
    """The IMU's own heading drifts: where there is no localization, the move's end counts."""
    end = move.motion.orientation.copy()
    end[-1] = quaternion.multiply(quaternion.from_yaw(0.7), end[-1])
    turning = replace(move, motion=replace(move.motion, orientation=end))
    rise = Passed(status=RiseStatus.STOOD, motion=motions[RIGHT])
    reckoning = DeadReckoning(Placement(x=1.0, y=-2.0, heading=0.4))
    _, strategy = get_up(
        world, prone, [turning, rise], locate=reckoning.locate, moved=reckoning.move, settle=False
    )
    headings = [Placement.of(start).heading for start in strategy.starts]
    assert headings[0] == pytest.approx(0.4)
    expected = Placement.of(turning.motion.posture(-1))
    assert headings[1] == pytest.approx(expected.heading)
    assert headings[1] - Placement.of(prone).heading == pytest.approx(0.7)
    assert strategy.starts[1].position[:2] == pytest.approx([expected.x, expected.y])
