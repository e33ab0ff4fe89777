"""Policies through the attempt manager: supervised, checked, and chosen by their records."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")

from recording_backend import still_state
from tiny_policies import save_policy, weights_of

from drivers import Ending, SafetyGuard, State, Twin
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.rise import Rise
from humanoid_getup.execution.session import Session
from humanoid_getup.playback.supervisor import Supervisor, supervise_policy
from humanoid_getup.policy.onnx_policy import OnnxPolicy
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.choice import (
    PLAN,
    POLICY,
    StandCount,
    StrategyId,
    StrategyRecord,
    StrategySelector,
    TrackRecord,
)
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import Plan, RiseStatus
from robots import Posture, Robot, TorqueLimit, quaternion

PERIOD = 0.008
SHORT = 0.5  # s


@pytest.fixture
def idle(op3: Robot, tmp_path: Path) -> OnnxPolicy:
    return OnnxPolicy.load(save_policy(tmp_path / "idle.onnx", op3), op3, PERIOD, longest=SHORT)


@pytest.fixture
def lost(op3: Robot, tmp_path: Path) -> OnnxPolicy:
    """A policy that loses its numbers as soon as gravity points backwards in the torso."""
    weight = weights_of(op3, gravity=np.array([[1.0], [0.0], [0.0]]))
    file = save_policy(tmp_path / "lost.onnx", op3, weight=weight, then=("Sqrt",))
    return OnnxPolicy.load(file, op3, PERIOD)


def state_of(robot: Robot, time: float, **changes) -> State:
    return still_state(robot, time=time, joint_pos=robot.standing.joint_pos, **changes)


def supervise(policy: OnnxPolicy, seconds: float, **changes) -> Supervisor:
    supervisor = supervise_policy(policy)
    supervisor.reset(state_of(policy.robot, 0.0))
    for k in range(round(seconds / PERIOD)):
        if supervisor.done:
            break
        command = supervisor.step(state_of(policy.robot, k * PERIOD, **changes))
        assert command.is_limp == (supervisor.aborted is not None)
    return supervisor


def test_a_policy_may_lean_and_fall_for_as_long_as_it_has(idle: OnnxPolicy):
    turned = quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 1.5)
    supervisor = supervise(idle, 2.0, orientation=turned)
    assert supervisor.done
    assert supervisor.aborted is None
    assert supervisor.longest == SHORT


def rise(world: World, policy: OnnxPolicy, start: Posture, **options) -> tuple[Rise, Twin]:
    twin = Twin(world, voltage=options.pop("voltage", None))
    twin.place(start)
    session = Session(guard=SafetyGuard(twin), world=world, **options)
    manager = AttemptManager(session, LearnedRise(world, policy, name="mine"), max_attempts=1)
    return manager.get_up(np.random.default_rng(0)), twin


def test_a_policy_that_does_nothing_is_run_to_its_end_and_judged(world, idle, supine):
    result, _ = rise(world, idle, supine)
    assert (result.stood, result.start_class) == (False, "supine")
    assert result.reason == "held no stand: 0.0 s of 3.0 s"
    assert (result.run.ending, result.run.clips.total) == (Ending.DONE, 0)
    assert result.run.duration == pytest.approx(SHORT, abs=2 * PERIOD)
    figures = result.figures()
    assert (figures.policy, figures.planned, figures.connection) == ("mine", False, None)


def test_a_policy_that_gives_up_leaves_the_robot_limp(world, lost, supine):
    result, twin = rise(world, lost, supine)
    assert result.reason.startswith("aborted after 0.0 s: the policy returned no valid action")
    assert not twin.simulation.has_torque


def test_a_policy_is_not_run_on_the_wrong_battery(world, idle, supine):
    result, _ = rise(world, idle, supine, voltage=16.0)
    assert result.run is None
    assert result.reason.startswith(
        "preflight refused: the supply is 16.0 V, expected 10.0 to 14.8"
    )


class Named:
    def __init__(self, name: str, world: World, torque_limit: float) -> None:
        self._name, self.world, self.torque_limit = name, world, TorqueLimit(torque_limit)

    def plan(self, _start: Posture, _rng: np.random.Generator) -> Plan:
        return Plan(status=RiseStatus.NOT_PLANNED, detail=self._name)


def choose(world: World, records: TrackRecord, start: Posture, torque_limit: float = 4.1) -> str:
    strategies = {
        StrategyId(PLAN): Named("plan", world, torque_limit),
        StrategyId(POLICY, "robust"): Named("policy", world, torque_limit),
    }
    return StrategySelector(strategies, records).plan(start, np.random.default_rng(0)).detail


def test_the_strategy_with_the_better_record_for_how_the_robot_lies_is_selected(supine, op3, world):
    plan = StrategyRecord(
        method=PLAN, torque_limit=2.0, supine=StandCount(90, 100), prone=StandCount(100, 100)
    )
    policy = StrategyRecord(
        method=POLICY,
        policy="robust",
        torque_limit=2.0,
        supine=StandCount(99, 100),
        prone=StandCount(99, 100),
    )
    prone = replace(supine, orientation=quaternion.from_axis_angle(np.array([0.0, 1.0, 0.0]), 1.5))
    records = TrackRecord((plan, policy))
    assert choose(world, records, supine) == "policy"
    assert choose(world, records, prone) == "plan"
    assert choose(world, records, op3.standing) == "plan"  # it lies on no side
    assert choose(world, TrackRecord(), supine) == "plan"
    weak = choose(world, records, supine, torque_limit=1.9)
    assert weak == "plan", "no record is of servos so weak"
