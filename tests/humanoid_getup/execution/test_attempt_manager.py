"""The attempt manager on the twin: tries, faults, stops, and asking for help."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from prone_motions import RIGHT, WRONG

from drivers import Command, DriverError, SafetyGuard, State, Twin
from humanoid_getup.execution import stand_keeper
from humanoid_getup.execution.attempt_manager import AttemptManager
from humanoid_getup.execution.recovery import OVERHEATING, OVERLOAD, Cooling, RebootBudget
from humanoid_getup.execution.rise import AttemptStatus, Rise
from humanoid_getup.execution.session import Phase, PhaseChange, Session
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.balance import Balance
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import Plan, RiseStatus
from robots import FULL_TORQUE, Posture, Robot, TorqueLimit

KNEE = "l_knee"
FAST = Cooling(min_time=0.2)


class Scripted:
    world: World
    torque_limit = FULL_TORQUE

    def __init__(self, motion: Motion) -> None:
        self._plan = Plan(status=RiseStatus.STORED, motion=motion)

    def plan(self, _start: Posture, _rng: np.random.Generator) -> Plan:
        return self._plan


class Ailing(Twin):
    """A twin whose measurements can be spoiled and that remembers what it was sent."""

    def __init__(self, world: World) -> None:
        super().__init__(world)
        self.spoil: Callable[[State], State] = lambda state: state
        self.sent: list[Command] = []
        self.open = False

    def connect(self) -> None:
        super().connect()
        self.open = True

    def close(self) -> None:
        super().close()
        self.open = False

    def read(self) -> State:
        return self.spoil(super().read())

    def write(self, command: Command) -> Command:
        self.sent.append(command)
        return super().write(command)

    @property
    def moves(self) -> list[Command]:
        return [command for command in self.sent if not command.is_limp]


class Alerts:
    """Hardware errors that reboots clear."""

    def __init__(self, robot: Robot) -> None:
        self._names, self.rebooted = robot.joint_names, list[str]()
        self.bits = np.zeros(robot.n, dtype=int)

    def reboot(self, joint: str) -> None:
        self.rebooted.append(joint)
        self.bits[self._names.index(joint)] = 0

    def trip(self, joint: str, bit: int) -> None:
        self.bits[self._names.index(joint)] |= bit

    def spoil(self, state: State) -> State:
        return replace(state, alert=self.bits.copy())


@pytest.fixture
def twin(world: World, prone: Posture) -> Ailing:
    twin = Ailing(world)
    twin.place(prone)
    return twin


@pytest.fixture
def phases() -> list[PhaseChange]:
    return []


@pytest.fixture
def manage(world: World, twin: Ailing, phases: list[PhaseChange]):
    def manage(plans, guard=None, services=None, **options) -> AttemptManager:
        plans.world = world
        most = options.pop("max_attempts", 3)
        if services is not None:
            twin.reboot = services.reboot
        session = Session(
            guard=guard or SafetyGuard(twin),
            world=world,
            simulation=twin.simulation,
            on_phase=phases.append,
            **{"preflight": False, "cooling": FAST} | options,
        )
        return AttemptManager(session, plans, max_attempts=most)

    return manage


def get_up_with(manager: AttemptManager) -> Rise:
    return manager.get_up(np.random.default_rng(0))


def test_a_lying_robot_stands_after_one_attempt(manage, motions, twin, phases):
    result = get_up_with(manage(Scripted(motions[RIGHT]), preflight=True))
    assert (result.status, result.reason) == (AttemptStatus.STOOD, "held stand")
    (attempt,) = result.attempts
    assert (attempt.stood, attempt.start_class, attempt.abort) == (True, "prone", None)
    assert attempt.verdict is not None and attempt.verdict.passed
    assert [change.phase for change in phases] == [
        Phase.SETTLING,
        Phase.PLANNING,
        Phase.PREFLIGHT,
        Phase.PLAYING,
        Phase.ENDED,
    ]
    assert phases[1].detail == "the robot lies prone"
    assert not twin.open


def test_a_failed_attempt_is_followed_by_rest_and_another_and_the_last_one_by_asking_for_help(
    manage, motions, phases
):
    result = get_up_with(manage(Scripted(motions[WRONG]), max_attempts=2))
    assert result.status is AttemptStatus.NEEDS_HELP
    assert result.reason.startswith("2 attempts failed: 1. aborted after")
    assert "; 2. aborted after" in result.reason
    assert not result.by_fault
    first, second = result.attempts
    assert first.abort is not None and first.outcome is not None and not first.stood
    assert first.reason.startswith("aborted after 1.0 s: the torso is not oriented")
    assert (second.number, second.stood) == (2, False)
    assert Phase.RECOVERING in [change.phase for change in phases]
    assert [change.attempt for change in phases if change.phase is Phase.PLAYING] == [1, 2]


def test_what_the_preflight_refuses_is_never_played(manage, motions, twin):
    plans = Scripted(motions[RIGHT])
    plans.torque_limit = TorqueLimit(0.2)
    result = get_up_with(manage(plans, preflight=True, max_attempts=1))
    assert result.status is AttemptStatus.NEEDS_HELP
    assert result.reason.startswith("preflight refused: rolled out at 12.0 V with 0.2 N·m")
    assert result.attempts[0].run is None
    assert twin.sent and not twin.moves


def test_a_rise_that_falls_with_balance_alone_is_played_and_held_without(
    manage, motions, monkeypatch
):
    monkeypatch.setattr(Balance, "_offset", lambda self, *_: 0.35 * self._ankles[1])
    monkeypatch.setattr(stand_keeper, "find_lying_down", lambda _: None)
    waits = iter([False] * 250)
    result = get_up_with(
        manage(
            Scripted(motions[RIGHT]),
            preflight=True,
            max_attempts=1,
            then="hold",
            is_released=lambda: next(waits, True),
        )
    )
    assert result.status is AttemptStatus.STOOD, result.reason
    (attempt,) = result.attempts
    assert attempt.plan is not None and not attempt.plan.balanced
    assert result.figures().balanced is False
    assert attempt.after.succeeded, attempt.after.reason


def test_a_robot_that_is_carried_about_is_not_risen(manage, motions, twin):
    twin.spoil = lambda state: replace(state, gyro=np.array([0.0, 0.5, 0.0]))
    result = get_up_with(manage(Scripted(motions[RIGHT]), max_attempts=1))
    assert result.status is AttemptStatus.NEEDS_HELP
    assert "does not come to rest" in result.reason
    assert "turned at up to 0.50 rad/s" in result.reason
    assert not twin.moves


def test_a_stop_while_it_rises_ends_everything(manage, motions, twin):
    guard = SafetyGuard(twin)

    def press(state: State) -> State:
        if len(twin.moves) == 50:
            guard.stop("the operator pressed the key")
        return state

    twin.spoil = press
    result = get_up_with(manage(Scripted(motions[RIGHT]), guard=guard))
    assert result.status is AttemptStatus.STOPPED
    assert result.reason == "stopped by the operator: the operator pressed the key"
    assert len(result.attempts) == 1
    assert len(twin.moves) == 50
    assert twin.sent[-1].is_limp
    assert not result.by_fault


def test_a_stopped_robot_stays_so_until_somebody_clears_it(manage, motions, twin):
    guard = SafetyGuard(twin)
    guard.stop("now")
    manager = manage(Scripted(motions[RIGHT]), guard=guard)
    assert get_up_with(manager).status is AttemptStatus.STOPPED
    assert not twin.moves
    guard.clear()
    assert get_up_with(manager).status is AttemptStatus.STOOD


def test_a_servo_that_trips_again_and_again_is_left_alone(manage, motions, twin, op3):
    alerts = Alerts(op3)

    def spoil(state: State) -> State:
        if twin.sent and not twin.sent[-1].is_limp:
            alerts.trip(KNEE, OVERLOAD)
        return alerts.spoil(state)

    twin.spoil = spoil
    result = get_up_with(manage(Scripted(motions[RIGHT]), services=alerts, max_attempts=9))
    assert result.status is AttemptStatus.NEEDS_HELP
    assert alerts.rebooted == [KNEE] * 3
    assert "3 servos were rebooted within 5 min already" in result.reason


@pytest.mark.parametrize(
    ("bits", "error", "remedy"),
    [
        (8, "encoder", "inspect the servo"),
        (16, "electrical shock", "inspect the servo"),
        (OVERHEATING | OVERLOAD, "overheating", "then switch its power off and on"),
    ],
)
def test_a_broken_or_hot_servo_needs_a_person(manage, motions, twin, op3, bits, error, remedy):
    alerts = Alerts(op3)
    alerts.trip(KNEE, bits)
    twin.spoil = alerts.spoil
    result = get_up_with(manage(Scripted(motions[RIGHT]), services=alerts))
    assert result.reason.startswith(f"joint '{KNEE}' reports {error}")
    assert result.reason.endswith(remedy)
    assert alerts.rebooted == []


def test_a_robot_that_stays_hot_asks_for_help(manage, motions, twin):
    twin.spoil = lambda state: replace(state, temperature=np.full(len(state.temperature), 78.0))
    cooling = Cooling(min_time=0.1, max_time=1.0)
    result = get_up_with(manage(Scripted(motions[RIGHT]), cooling=cooling))
    assert result.status is AttemptStatus.NEEDS_HELP
    assert "still has 78 °C after 1 s of rest, expected at most 55 °C" in result.reason
    assert not twin.moves


def test_a_stop_is_heard_while_it_cools_down(manage, motions, twin):
    guard = SafetyGuard(twin)

    def press(state: State) -> State:
        if state.time > 2.0:
            guard.stop("enough")
        return state

    twin.spoil = press
    options = {"cooling": Cooling(min_time=60.0)}
    result = get_up_with(manage(Scripted(motions[WRONG]), guard=guard, **options))
    assert result.reason == "stopped by the operator: enough"
    assert twin.data.time < 5.0


def test_a_lost_bus_ends_it(manage, motions, twin):
    def lose(state: State) -> State:
        if len(twin.moves) >= 50:
            raise DriverError("port /dev/ttyUSB0 is gone: plug it in again")
        return state

    twin.spoil = lose
    result = get_up_with(manage(Scripted(motions[RIGHT])))
    assert result.status is AttemptStatus.NEEDS_HELP
    assert result.reason == "port /dev/ttyUSB0 is gone: plug it in again"
    assert result.by_fault
    assert not twin.open
    assert len(twin.moves) == 50


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda state: replace(state, voltage=9.1), "the supply is too low: 9.1 V"),
        (lambda state: replace(state, time=1.0), "the measurement is repeated"),
        (lambda state: replace(state, gyro=np.full(3, np.nan)), "invalid values"),
        (lambda state: replace(state, imu_age=2.0), "orientation has been unknown"),
    ],
)
def test_what_no_rest_cures_needs_a_person(manage, motions, twin, spoil, message):
    twin.spoil = spoil
    result = get_up_with(manage(Scripted(motions[RIGHT])))
    assert result.status is AttemptStatus.NEEDS_HELP
    assert message in result.reason
    assert not twin.moves


def test_an_interrupt_leaves_the_robot_limp(manage, motions, twin):
    def interrupt(state: State) -> State:
        if len(twin.moves) == 50:
            raise KeyboardInterrupt
        return state

    twin.spoil = interrupt
    with pytest.raises(KeyboardInterrupt):
        get_up_with(manage(Scripted(motions[RIGHT])))
    assert not twin.open
    assert len(twin.moves) == 50


def test_a_reboot_is_allowed_again_when_the_window_has_passed():
    budget = RebootBudget(most=3, window=300.0)
    assert [budget.spend(time) for time in (0.0, 1.0, 299.0, 299.5)] == [True, True, True, False]
    assert budget.spend(300.5)  # the one at 0 s is 5 min ago
    assert not budget.spend(300.9)
    assert budget.spend(301.5)
