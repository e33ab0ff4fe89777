"""A robot that stands: it is held, lies down softly, goes limp, or is handed over under torque."""

from dataclasses import replace
from itertools import count
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from stored_plans import lie_at_start

import humanoid_getup as hg
from drivers import Command, Cycle, Ending, FaultKind, Release, SafetyGuard, State, Twin
from drivers.dynamixel.backend import DynamixelBackend
from drivers.dynamixel.clock import CycleClock
from drivers.twin.simulation import Simulation
from drivers.virtual_bus import TimeMode, VirtualPorts, VirtualRobot
from humanoid_getup.execution import stand_keeper
from humanoid_getup.execution.session import Phase, PhaseChange, Session, SessionOptions
from humanoid_getup.execution.stand_keeper import StandKeeper, StandWatch
from humanoid_getup.experiments.falls import classify, settle_posture
from humanoid_getup.experiments.judging.standing import HOLD
from humanoid_getup.playback.monitors import AbortKind
from humanoid_getup.simulation.world import World
from robots import Posture, Robot, TorqueLimit
from robots.kinematics import read_posture

WEAK = TorqueLimit(2.0, "pwm")


@pytest.fixture(scope="module")
def rise(world: World) -> hg.StoredMotion:
    return hg.StoredMotion(world, "squat_to_stand")


@pytest.fixture(scope="module")
def squat(world: World, rise: hg.StoredMotion) -> Posture:
    at_rest = settle_posture(world, rise.motion.posture(0))
    return read_posture(world.robot, world.model, at_rest)


def after(seconds: float, period: float):
    """Make what releases a robot after a time of being held [s]."""
    cycles = count(1)
    return lambda: next(cycles) * period >= seconds


def get_up(backend, rise: hg.StoredMotion, **options):
    """Play the rise, from a squat that is not given time to fall over."""
    chosen = SessionOptions(settle=False, **options)
    return hg.get_up(backend, rise, max_attempts=1, options=chosen)


def begin(backend, world: World, **options) -> Session:
    return Session.on(backend, world, options=SessionOptions(**({"then": "sit"} | options)))


def test_a_robot_that_stands_sits_and_lies_down_and_is_limp_then(world: World, op3: Robot):
    twin = Twin(world, op3.standing)
    result = hg.keep_stand(twin, world, torque_limit=WEAK)
    assert result.succeeded, result.reason
    assert result.reason == "sat and lay down, torque off"
    assert classify(twin.truth.posture.orientation) == "supine"
    assert not twin.simulation.has_torque
    figures = result.figures()
    assert figures.head_impact_m_s < 0.3
    assert figures.torso_impact_m_s < 0.3
    assert figures.peak_torque_nm <= 2.0 + 1e-9


class Laden(Twin):
    """Its head, pulled by a cable, is 0.1 rad from its target."""

    def read(self) -> State:
        state, angle = super().read(), np.zeros(self.robot.n)
        angle[self.robot.joint_names.index("head_pan")] = 0.1
        return replace(state, joint_pos=state.joint_pos + angle)


def test_what_follows_a_rise_follows_it_without_a_cycle_limp_from_its_last_targets(
    world: World, rise: hg.StoredMotion, squat: Posture
):
    twin = Laden(world, squat)
    sent: list[Command] = []
    phases: list[Phase] = []
    result = get_up(
        twin,
        rise,
        then="hold",
        is_released=after(2.0, twin.period),
        on_phase=lambda change: phases.append(change.phase),
        on_cycle=lambda cycle: sent.append(cycle.sent),
    )
    assert result.stood
    assert result.after.succeeded
    assert phases[-4:] == [Phase.PLAYING, Phase.HOLDING, Phase.LYING_DOWN, Phase.ENDED]
    assert not any(command.is_limp for command in sent)
    moved = np.abs(np.diff([command.joint_pos for command in sent], axis=0)).max()
    assert moved <= twin.robot.max_velocity.max() * twin.period
    pan = [command.joint_pos[world.robot.joint_names.index("head_pan")] for command in sent]
    assert np.ptp(pan[50:]) == 0.0, "it begins again where the head is, not where it is sent"
    assert result.figures().after.held_s == pytest.approx(2.0, abs=0.1)
    assert classify(twin.truth.posture.orientation) == "supine"


class NoddingPilot:
    """Stands with its head turned, for some seconds."""

    def __init__(self, robot: Robot, pan: float, seconds: float) -> None:
        self._robot, self._pan, self._seconds = robot, pan, seconds
        self.states: list[State] = []

    @property
    def done(self) -> bool:
        return len(self.states) * self._robot.control_period >= self._seconds

    def reset(self, state: State) -> None:
        del state
        self._target = self._robot.standing.joint_pos.copy()
        self._target[self._robot.joint_names.index("head_pan")] = self._pan
        self.states = []

    def step(self, state: State) -> Command:
        self.states.append(state)
        return Command.position(self._robot, self._target)


def test_a_pilot_moves_the_robot_after_its_stand_without_a_cycle_limp(world, rise, squat):
    twin, pilot = Twin(world, squat), NoddingPilot(world.robot, pan=0.4, seconds=1.0)
    sent: list[Command] = []
    phases: list[Phase] = []
    result = get_up(
        twin,
        rise,
        pilot=pilot,
        on_phase=lambda change: phases.append(change.phase),
        on_cycle=lambda cycle: sent.append(cycle.sent),
    )
    assert result.stood
    assert result.after.reason == "followed its pilot for 1.0 s, torque off where it stood"
    assert phases[-3:] == [Phase.PLAYING, Phase.FOLLOWING, Phase.ENDED]
    assert not any(command.is_limp for command in sent)
    pan = world.robot.joint_names.index("head_pan")
    assert pilot.states[-1].joint_pos[pan] == pytest.approx(0.4, abs=0.01)
    assert not twin.simulation.has_torque


@pytest.mark.parametrize("then", [pytest.param("hold", marks=pytest.mark.slow), "hand-over"])
def test_a_robot_on_servos_lies_down_or_holds_without_a_watchdog(then, rise, squat, world):
    virtual = VirtualRobot(Simulation(world), powered=True)
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        backend = DynamixelBackend(world.robot, ports.paths, clock=CycleClock())
        with backend:
            pass  # the first connection configures the servos, which may take time
        ports.main.call(lambda: virtual.place(squat))
        result = get_up(backend, rise, simulation=virtual.simulation, then=then)
        assert result.stood, result.reason
        assert result.after.succeeded, result.after.reason
        backend.close()  # as at the end of a `with` block of the caller
        assert result.unreleased == backend.unreleased == ()
        torque = {servo.peek("torque_enable") for servo in virtual.servos}
        assert torque == {1 if then == "hand-over" else 0}
        assert {servo.peek("bus_watchdog") for servo in virtual.servos} == {0}
        ports.main.call(lambda: virtual.physics.advance(virtual.physics.time + 1.0))
    truth = virtual.simulation.truth
    side = None if then == "hand-over" else "supine"  # it stands on, with no program
    assert classify(truth.posture.orientation) == side


class Pushed(Twin):
    """Is pushed at a time, harder than any stance bears."""

    push_at = np.inf  # s

    def write(self, command: Command) -> Command:
        if abs(self.data.time - self.push_at) < 0.5 * self.period:
            self.data.qvel[0] += 1.2  # m/s
        return super().write(command)


@pytest.mark.parametrize("phase", [Phase.HOLDING, Phase.LYING_DOWN])
@pytest.mark.parametrize("fault", [FaultKind.TOO_HOT, FaultKind.STALE_DATA])
def test_a_robot_that_stands_or_lies_down_is_watched(phase, fault, world, op3):
    phases: list[Phase] = []

    class Ailing(Twin):
        since = 0.0

        def read(self) -> State:
            state = super().read()
            if phases[-1:] != [phase]:
                self.since = state.time + 0.5
            if state.time < self.since:
                return state
            if fault is FaultKind.TOO_HOT:
                return replace(state, temperature=state.temperature + 60.0)
            return replace(state, time=self.since)

    then = "hold" if phase is Phase.HOLDING else "sit"
    options = SessionOptions(on_phase=lambda change: phases.append(change.phase))
    twin = Ailing(world, op3.standing)
    result = hg.keep_stand(twin, world, then=then, options=options)
    assert not result.succeeded
    step = result.hold if phase is Phase.HOLDING else result.way_down
    if fault is FaultKind.STALE_DATA:
        assert step.run.ending is Ending.FAULT
        assert result.by_fault
    assert fault.value in result.reason  # the monitor and the guard say it in the same words
    assert not twin.simulation.has_torque


@pytest.mark.parametrize("lies", [True, False])
def test_a_robot_that_does_not_stand_is_refused_in_one_line(lies, world, squat):
    twin = Twin(world, lie_at_start(world) if lies else squat)
    result = hg.keep_stand(twin, world)
    assert "\n" not in result.refusal
    assert result.refusal.startswith("the robot does not stand: its torso is")
    assert not result.succeeded
    assert not result.by_fault
    assert not twin.simulation.has_torque


def test_a_robot_that_has_no_way_down_is_refused_before_it_moves(tiny: Robot):
    world = World(tiny)
    with pytest.raises(ValueError, match="robot 'tiny' has no motions"):
        hg.keep_stand(Twin(world), world, then="sit")
    with pytest.raises(ValueError, match="then is 'jump', expected one of 'hold', 'sit'"):
        hg.keep_stand(Twin(world), world, then="jump")  # pyright: ignore[reportArgumentType]


def test_a_way_down_that_the_supply_does_not_allow_is_refused(world: World, op3: Robot):
    twin = Twin(world, op3.standing, voltage=9.0)
    result = StandKeeper(begin(twin, world)).start()
    assert "the supply is 9.0 V, expected 10.0 to 14.8 V: charge the battery" in result.refusal
    assert not result.by_fault  # the guard ends a motion only if it stays so


class Turned(Twin):
    """Has a gyro that reads a turn for a moment, after a judged stand."""

    def read(self) -> State:
        state = super().read()
        is_turned = 4.9 < state.time < 4.95
        return replace(state, gyro=state.gyro + np.array([0.0, 0.0, 1.2 * is_turned]))


def test_a_robot_that_stood_has_stood_whenever_it_is_released(world: World, op3: Robot):
    """By its sensors, as a robot is judged: 3 s without a break are over too late."""
    twin = Turned(world, op3.standing)
    session = begin(twin, world, then="limp", is_released=after(5.5, twin.period))
    result = StandKeeper(replace(session, simulation=None)).start()
    assert result.succeeded, result.reason
    assert result.figures().held_s == pytest.approx(5.5, abs=0.1)


def test_a_robot_that_sways_on_lies_down_all_the_same(world: World, op3: Robot, monkeypatch):
    monkeypatch.setattr(stand_keeper, "LONGEST_WAIT", 1.0)

    class Swaying(Twin):
        def read(self) -> State:
            state = super().read()
            return replace(state, gyro=state.gyro + np.array([0.0, 0.0, 1.2 * (state.time < 8.0)]))

    twin = Swaying(world, op3.standing)
    session = begin(twin, world, then="hold")
    result = StandKeeper(replace(session, simulation=None)).start()
    assert not result.succeeded
    assert result.way_down.is_done
    assert "it sat and lay down" in result.reason
    assert classify(twin.truth.posture.orientation) == "supine"


@pytest.mark.parametrize("method", ["hand_over", "close"])
def test_an_interrupted_hand_over_says_that_torque_is_on(method, world: World, op3: Robot):
    class Interrupted(Twin):
        def close(self) -> None:
            super().close()
            if self.release is Release.HOLD and method == "close":
                raise KeyboardInterrupt

        def hand_over(self) -> tuple[str, ...]:
            super().hand_over()
            if method == "hand_over":
                raise KeyboardInterrupt
            return ()

    twin = Interrupted(world, op3.standing)
    with pytest.raises(KeyboardInterrupt, match="servos hold their targets"):
        hg.keep_stand(twin, world, then="hand-over")
    assert twin.simulation.has_torque


def test_an_orientation_that_is_none_is_refused(world: World, op3: Robot):
    class Blind(Twin):
        def read(self) -> State:
            return replace(super().read(), orientation=np.zeros(4))

    result = hg.keep_stand(Blind(world, op3.standing), world)
    assert result.by_fault
    assert result.refusal is not None
    assert FaultKind.BAD_MEASUREMENT.value in result.refusal


def test_an_interrupted_hold_leaves_the_robot_limp(world: World, op3: Robot):
    def interrupt(cycle: Cycle) -> None:
        if cycle.state.time > 1.0:
            raise KeyboardInterrupt

    twin = Twin(world, op3.standing)
    with pytest.raises(KeyboardInterrupt):
        hg.keep_stand(twin, world, then="hand-over", options=SessionOptions(on_cycle=interrupt))
    assert not twin.simulation.has_torque
    assert not twin.simulation.on_sensor_update, "a judge goes on sampling after the run"
    assert twin.release is Release.LIMP


def test_a_robot_that_falls_while_it_is_held_after_its_rise_does_not_lie_down(world, rise, squat):
    """To sit and lie down begins with the stand: a robot on the ground would thrash about."""
    twin, phases, after_fall = Pushed(world, squat), list[Phase](), list[Command]()

    def note(change: PhaseChange) -> None:
        phases.append(change.phase)
        if change.phase is Phase.HOLDING:
            twin.push_at = twin.data.time + 0.5

    def watch(cycle: Cycle) -> None:
        if cycle.state.time > twin.push_at + 2.0:
            after_fall.append(cycle.sent)

    result = get_up(
        twin, rise, then="hold", is_released=after(20.0, twin.period), on_phase=note, on_cycle=watch
    )
    assert result.stood
    assert result.after.hold.abort.kind is AbortKind.FELL
    assert result.after.way_down is None
    assert Phase.LYING_DOWN not in phases
    assert all(command.is_limp for command in after_fall)  # if the loop went on at all
    assert not twin.simulation.has_torque


class LetGo(Twin):
    """Stands in a person's hands until it was measured, and is let go before its torque is on."""

    connections = 0

    def connect(self) -> None:
        super().connect()
        self.connections += 1
        if self.connections == 2:
            self.place(self.lying)


def test_a_robot_that_is_let_go_after_it_was_measured_gets_no_torque(world: World, op3: Robot):
    twin = LetGo(world, op3.standing)
    twin.lying = lie_at_start(world)
    sent: list[Command] = []
    write = twin.write
    twin.write = lambda command: sent.append(command) or write(command)
    result = hg.keep_stand(twin, world)
    assert twin.connections == 2
    assert result.refusal.startswith("the robot does not stand: its torso is")
    assert sent
    assert all(command.is_limp for command in sent)


def press(guard: SafetyGuard, name: str):
    """Make a method of a guard's backend during which a key is pressed, at its end."""
    original = getattr(guard.backend, name)

    def pressed():
        result = original()
        guard.stop("a key was pressed")
        return result

    setattr(guard.backend, name, pressed)


def test_a_stop_at_the_hand_over_wins(world: World, op3: Robot):
    guard = SafetyGuard(Twin(world, op3.standing))
    press(guard, "hand_over")
    result = hg.keep_stand(guard, world, then="hand-over")
    assert result.hand_over is None
    assert result.by_fault
    assert result.reason == "the robot was stopped: a key was pressed; torque off"
    assert not guard.backend.simulation.has_torque
    assert guard.backend.release is Release.LIMP


class Doubtful(Twin):
    """Has a servo that does not confirm the hand-over the first time, or ever."""

    doubts = 1

    def hand_over(self) -> tuple[str, ...]:
        self.doubts -= 1
        return ("r_knee",) if self.doubts >= 0 else super().hand_over()


@pytest.mark.parametrize(("doubts", "has_torque"), [(1, True), (2, False)])
def test_a_robot_that_does_not_confirm_its_hand_over_is_held(doubts, has_torque, world, op3):
    twin, said = Doubtful(world, op3.standing), list[str]()
    twin.doubts = doubts
    options = SessionOptions(on_phase=lambda change: said.append(change.detail))
    result = hg.keep_stand(twin, world, then="hand-over", options=options)
    assert "not handed over: r_knee did not confirm it: held on" in said[1]
    assert result.hold.run.duration >= 3.0
    assert twin.simulation.has_torque is has_torque
    assert (result.hand_over is not None) is has_torque
    assert result.by_fault is not has_torque


@pytest.mark.parametrize("by", ["current", "pwm"])
def test_a_hand_over_says_what_the_servos_are_left_with(by, world: World, op3: Robot):
    twin = Twin(world, op3.standing)
    result = hg.keep_stand(twin, world, then="hand-over", torque_limit=TorqueLimit(3.0, by))
    assert twin.simulation.has_torque
    assert twin.release is Release.LIMP, "the next program's failures would stay under torque"
    left = result.hand_over
    assert f"at most 3.00 N·m by {by}" in str(left)
    assert "watchdog off" in str(left)
    knee = left.figures().joints["l_knee"]
    assert knee.target_rad == pytest.approx(0.8901, abs=0.002)  # as in robot.toml
    assert knee.torque_limit_nm == pytest.approx(3.0, abs=0.005)
    assert knee.position_p_gain == 800


def test_a_hand_over_names_the_robot_whatever_fails_after_it(world: World, rise, squat: Posture):
    def fail(change: PhaseChange) -> None:
        if change.phase is Phase.ENDED:
            raise OSError("no space left")

    twin = Twin(world, squat)
    with pytest.raises(OSError, match="no space") as caught:
        get_up(twin, rise, then="hand-over", on_phase=fail)
    assert "handed over: servos hold their targets" in caught.value.__notes__[0]
    assert twin.simulation.has_torque


class Pausing(Twin):
    """Is not asked for 2 s, once, while its servos hold their last targets."""

    pause_at, skipped = 2.0, 0.0

    def read(self) -> State:
        if not self.skipped and self.data.time > self.pause_at:
            self.skipped = 2.0
            self.simulation.step(round(2.0 / self.model.opt.timestep))
        return super().read()


def test_a_stand_goes_on_after_a_pause_without_a_jump(world: World, op3: Robot):
    twin, cycles, said = Pausing(world, op3.standing), list[Cycle](), list[str]()
    options = SessionOptions(
        on_cycle=cycles.append, on_phase=lambda change: said.append(change.detail)
    )
    result = hg.keep_stand(twin, world, then="limp", options=options)
    assert result.succeeded, result.reason
    assert any("paused under torque: 2.01 s between two cycles" in text for text in said)
    assert not any(cycle.sent.is_limp for cycle in cycles)
    moved = np.abs(np.diff([cycle.sent.joint_pos for cycle in cycles], axis=0)).max(axis=1)
    assert moved.max() < 0.1


def test_a_pause_in_mid_rise_ends_limp_and_the_next_attempt_begins_where_it_lies(
    world: World, rise: hg.StoredMotion, squat: Posture
):
    twin = Pausing(world, squat)
    twin.pause_at = 0.5
    sent: list[Command] = []
    write = twin.write
    twin.write = lambda command: sent.append(command) or write(command)
    result = get_up(twin, rise, then="limp")
    assert result.attempts[0].reason.startswith("the control loop paused under torque: 2.01 s")
    assert not twin.simulation.has_torque
    assert np.abs(np.diff([c.joint_pos for c in sent if not c.is_limp], axis=0)).max() < 0.3


PERIOD = 0.1


class Judge:
    """Sees a stand in whatever it is shown, and counts it."""

    seen = 0

    def __call__(self, _cycle: Any) -> None:
        self.seen += 1

    def end(self) -> bool:
        return True


def test_a_stand_is_seen_once_and_then_nothing_is_kept():
    judges = list[Any]()
    watch = StandWatch(lambda: judges.append(Judge()) or judges[-1], lambda: True)
    for cycle in range(36_000):
        assert watch.may_end() == watch.stood == (cycle * PERIOD > HOLD)
        watch(cast("Any", SimpleNamespace(state=SimpleNamespace(time=cycle * PERIOD))))
    assert [judge.seen for judge in judges] == [round(HOLD / PERIOD) + 1]
