"""Playing a motion on a robot without an IMU: no one knows whether it stands in the end."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

from drivers import Cycle, DriverError, Ending, RunReport, State, engaged, run_engaged
from drivers.control_loop import Pacer
from humanoid_getup.execution.phase import Phase, PhaseChange
from humanoid_getup.execution.session import Session
from humanoid_getup.experiments.joint_figures import JointFigures
from humanoid_getup.motions.motion import Motion
from humanoid_getup.playback.estimation import FaultedError, StartError, settle
from humanoid_getup.playback.monitors import Abort
from humanoid_getup.playback.play import GRACE
from humanoid_getup.playback.preflight import Verdict, preflight
from humanoid_getup.playback.supervisor import Supervisor, supervise_hold, supervise_motion

UNKNOWN = "played; without an IMU no one knows whether it stands"
HOLDING = "holding the last targets, until a key is pressed"


@dataclass(frozen=True, kw_only=True)
class BlindPlay:
    """How a motion was played without an IMU; it may have fallen, or stand."""

    motion: Motion
    verdict: Verdict = field(default_factory=Verdict)
    """Verdict of the preflight, as if the robot lay where the motion begins."""
    refusal: str | None = None
    """Why nothing was played."""
    by_fault: bool = False
    """Whether the guard or the hardware refused or ended it."""
    run: RunReport | None = None
    """None if nothing was played."""
    hold: RunReport | None = None
    """Holding the last targets; None if it was not asked to."""
    abort: Abort | None = None
    """Why the supervisor aborted, if it did."""
    warnings: tuple[str, ...] = ()
    figures: JointFigures | None = None
    """What the joints measured; None if nothing was played."""

    @property
    def played(self) -> bool:
        """Return whether it was played to its end."""
        return self.run is not None and self.run.ending is Ending.DONE and self.abort is None

    @property
    def reason(self) -> str:
        """Return in one line how it ended."""
        if self.run is None:
            return self.refusal or "not started"
        if self.abort is not None:
            return f"aborted after {self.abort.time:.1f} s: {self.abort}"
        if self.run.ending is not Ending.DONE:
            return self.run.reason
        if self.hold is not None and self.hold.ending is not Ending.DONE:
            return f"{UNKNOWN}; holding it ended: {self.hold.reason}"
        return UNKNOWN

    def record(self) -> dict[str, Any]:
        """Return the figures under report.json's keys; what no one knows is None."""
        run = self.run
        return {
            "stood": None,
            "stand_time_s": None,
            "hold_s": None,
            "start_class": None,
            "played": self.played,
            "reason": self.reason,
            "without_imu": True,
            "balanced": False,
            "held_s": self.hold.duration if self.hold else 0.0,
            "judged_by": None,
            "overruns": run.overruns if run else 0,
            "holds": run.holds if run else 0,
            "clips": run.clips.total if run else 0,
            "warnings": [*map(str, self.verdict.warnings), *self.warnings],
            **(self.figures.record() if self.figures else {}),
        }


def play_blind(session: Session, motion: Motion) -> BlindPlay:
    """Play a motion open loop, without an IMU; torque is off afterwards.

    The robot settles, as its joints tell; the preflight rolls the motion out from its own start,
    because no one knows how the robot lies; the supervisor monitors joints and servos.

    Raises:
        KeyboardInterrupt: if it was interrupted; the robot's torque is off then.
    """
    play = BlindPlay(motion=motion)
    try:
        state = _settle(session)
        play = _preflight(session, play, state)
        return play if play.refusal else _play(session, play)
    except StartError as error:
        return replace(play, refusal=str(error))
    except (FaultedError, DriverError) as error:
        return replace(play, refusal=str(error), by_fault=True)


def _settle(session: Session) -> State:
    _report(session, Phase.SETTLING)
    if session.settle:
        return settle(session.guard, Pacer(session.guard.period) if session.realtime else None)
    with session.guard:
        return session.guard.read()


def _preflight(session: Session, play: BlindPlay, state: State) -> BlindPlay:
    if not session.preflight:
        return play
    _report(session, Phase.PREFLIGHT)
    verdict = preflight(
        session.world,
        play.motion,
        voltage=state.voltage,
        torque_limit=session.torque_limit,
        temperature=state.temperature,
        balanced=False,
    )
    return replace(play, verdict=verdict, refusal=None if verdict.passed else str(verdict))


def _play(session: Session, play: BlindPlay) -> BlindPlay:
    """Play the motion and hold its end, in one piece."""
    world, limit = session.world, session.torque_limit.value
    cycles: list[Cycle] = []
    supervisor = supervise_motion(world, play.motion, torque_limit=limit, balanced=False)
    hold = None
    with engaged(session.guard, realtime=session.realtime):
        _report(session, Phase.PLAYING)
        run = _run(session, supervisor, supervisor.longest + GRACE, cycles.append)
        if session.then == "hold" and run.ending is Ending.DONE and supervisor.aborted is None:
            _report(session, Phase.HOLDING, HOLDING)
            holder = supervise_hold(
                world.robot,
                play.motion,
                is_released=session.is_released,
                torque_limit=limit,
                held=cycles[-1].sent.joint_pos,
            )
            hold = _run(session, holder, holder.longest, lambda _: None)
    return replace(
        play,
        run=run,
        hold=hold,
        by_fault=Ending.FAULT in (run.ending, hold and hold.ending),
        abort=supervisor.aborted,
        warnings=tuple(supervisor.warnings),
        figures=JointFigures.of(world.robot, limit, [cycle.state for cycle in cycles]),
    )


def _run(
    session: Session, supervisor: Supervisor, longest: float, keep: Callable[[Cycle], None]
) -> RunReport:
    def observe(cycle: Cycle) -> None:
        keep(cycle)
        if session.on_cycle is not None:
            session.on_cycle(cycle)

    run = run_engaged(
        supervisor,
        session.guard,
        max_time=longest,
        realtime=session.realtime,
        on_cycle=observe,
    )
    if run.ending is Ending.INTERRUPTED:
        raise KeyboardInterrupt
    return run


def _report(session: Session, phase: Phase, detail: str = "") -> None:
    session.on_phase(PhaseChange(phase, 1, detail or phase.value))
