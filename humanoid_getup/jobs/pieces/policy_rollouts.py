"""Falls on random grounds and rollouts of a policy from them, as pieces."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from humanoid_getup.engines.executor import do_pieces, is_here
from humanoid_getup.experiments.starts.falls import CLASSES, Fall, FallSet, sample_fall_set
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import load_robot, make_torque_limit
from humanoid_getup.jobs.pieces.spreading import make_absolute, make_worker_request
from humanoid_getup.jobs.policies import load_policy
from humanoid_getup.jobs.requests.learning import EvaluateRequest
from humanoid_getup.policy.style_follower import StyleChoice
from humanoid_getup.progress.callback import Progress, ProgressMonitor
from humanoid_getup.progress.worker import report
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.scenes.scene import Scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.plan import MotionPlan
from humanoid_getup.strategies.planned_rise import PlannedRise, PlannerOptions
from humanoid_getup.strategies.styled_rise import PLANNED, read_curves
from humanoid_getup.style.curves import StyleCurves
from humanoid_getup.style.extraction import ExtractionError
from humanoid_getup.style.style import Style
from humanoid_getup.style.style_file import load_any_style, load_style
from robots import Robot

if TYPE_CHECKING:  # torch is slow to import
    from sim2real.perturbations import Perturbation
    from sim2real.policy_evaluation import PolicyFigures

NEAREST = "nearest"
"""Style without a choice: the nearest of all named ones."""
PLAN_SHARE = 0.9
"""Of the time that a planned rise takes, where a policy follows the curves of its plan."""
Curves = list[StyleCurves | None]
Piece = TypeVar("Piece")
Result = TypeVar("Result")


@dataclass(frozen=True, kw_only=True)
class SeededScene:
    """A scene, with the seed of its ground if that is random."""

    name: str
    """Its name, or file."""
    seed: int

    def load(self, robot: Robot) -> Scene:
        """Load the scene for a robot."""
        return load_scene(self.name, robot, self.seed)


Grounds = list[tuple[SeededScene, FallSet]]
"""Each ground with the falls on it."""


@dataclass(frozen=True, kw_only=True)
class RolloutPiece:
    """Rollouts of a policy from some falls on one ground, at once."""

    ground: SeededScene
    falls: tuple[Fall, ...]
    first: int
    """Number of the first of the falls among those on this ground."""
    style: str | None
    """Name or file of the style that it follows; None for a policy without style curves."""
    seed: int
    """Of what is random about its robots."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RolledOut:
    """Figures of some rollouts."""

    figures: PolicyFigures
    planned: int
    """Number of rises that followed the curves of a plan."""


class EvaluatedPolicy:
    """The policy of a request on its robots."""

    def __init__(self, request: EvaluateRequest, threads: int = 0) -> None:
        """Load the policy of a request, whose physics takes a number of threads."""
        self.request, self.threads = request, threads
        self.robot = load_robot(request)
        self.limit = make_torque_limit(request, self.robot)
        self.policy = load_policy(self.robot, request.policy, self.limit.value)

    @cached_property
    def perturbation(self) -> Perturbation:
        """Make the perturbation of the request."""
        from sim2real.perturbations import Perturbation

        request = self.request
        return Perturbation(
            torque_limit=self.limit.value,
            limit_by=request.limit_by,
            delay=request.delay / 1000.0,
            voltage=request.voltage,
            friction=request.friction,
            mass=request.mass,
            backlash=math.radians(request.backlash),
            weak_servo=request.weak_servo,
            push=request.push,
            imu_tilt=math.radians(request.imu_tilt),
            gyro_bias=math.radians(request.gyro_bias),
            noise=request.noise,
            physics=request.variant,
        )

    def sample_falls(self, ground: SeededScene) -> FallSet:
        """Sample a fall of each class on a ground."""
        world = World(self.robot, ground.load(self.robot))
        with refusing():
            return sample_fall_set(world, dict.fromkeys(CLASSES, 1), ground.seed)

    def roll_out(self, piece: RolloutPiece) -> RolledOut:
        """Let the policy get up from falls, and report robots as they are done."""
        from sim2real.perturbations import PolicyTrial
        from sim2real.policy_evaluation import PolicyDriver

        choice, planned = self._choose_curves(piece)
        trial = PolicyTrial(
            robot=self.robot,
            policy=PolicyDriver.of(self.policy, choice, sees_ground=self.request.height_map),
            perturbation=self.perturbation,
            seed=piece.seed,
            scene=piece.ground.load(self.robot),
            threads=self.threads,
        )
        share = 1.0 - PLAN_SHARE if piece.style == PLANNED else 1.0
        starts = [fall.posture for fall in piece.falls]
        rollouts = trial.run(starts, lambda robots: report(Progress(done=share * robots)))
        return RolledOut(figures=rollouts.figures, planned=planned)

    def _choose_curves(self, piece: RolloutPiece) -> tuple[StyleChoice | None, int]:
        """Make the choice of curves; count rises that follow a plan's curves."""
        if piece.style is None:
            return None, 0
        with refusing():
            style = load_followed(piece.style, self.robot)
        if piece.style != PLANNED:
            return lambda _row, features: style.choose(features), 0
        curves = self._plan_curves(piece)
        found = sum(each is not None for each in curves)
        return lambda row, features: curves[row] or style.choose(features), found

    def _plan_curves(self, piece: RolloutPiece) -> Curves:
        """Plan a motion for each fall, and read its curves; ``None`` where no plan stands."""
        world = World(self.robot, piece.ground.load(self.robot))
        planner = PlannedRise(world, options=PlannerOptions(threads=self.threads))
        found: Curves = []
        for number, fall in enumerate(piece.falls, piece.first):
            rng = np.random.default_rng([self.request.seed, number])
            plan = planner.plan(fall.posture, rng)
            found.append(None)
            if isinstance(plan, MotionPlan) and plan.motion.rises:
                with suppress(ExtractionError):
                    found[-1] = read_curves(world, plan.motion)
            report(Progress(done=PLAN_SHARE))
        return found


def load_followed(name: str, robot: Robot) -> Style:
    """Load a style to follow, by name; for curves of plans, that of falls without one.

    Raises:
        ValueError: if there is no such style.
    """
    return load_any_style(robot) if name in (NEAREST, PLANNED) else load_style(name, robot)


@dataclass(frozen=True, kw_only=True, eq=False)
class Rollouts:
    """Rollouts of a policy on the engine of a request."""

    evaluated: EvaluatedPolicy
    """Does them in this process."""
    executor: Executor
    monitor: ProgressMonitor

    def sample_falls(self, grounds: Sequence[SeededScene], phase: str) -> Grounds:
        """Sample a fall of each class on each ground."""
        count = self.monitor.count(phase, len(grounds) * len(CLASSES))
        pieces = {str(ground.seed): ground for ground in grounds}
        found = dict[str, FallSet]()

        def end(name: str, falls: FallSet) -> None:
            found[name] = falls
            count(len(falls.falls))

        self._spread(self.evaluated.sample_falls, sample_on_ground, pieces, end)
        return [(ground, found[name]) for name, ground in pieces.items()]

    def roll_out(self, pieces: Sequence[RolloutPiece], phase: str) -> list[RolledOut]:
        """Let the policy get up from all falls."""
        total = sum(len(piece.falls) for piece in pieces)
        count = self.monitor.count(phase, total)
        named = {str(number): piece for number, piece in enumerate(pieces)}
        found, reported = dict[str, RolledOut](), 0.0

        def receive(progress: Progress) -> None:
            nonlocal reported
            done = min(progress.done, total - reported)  # a piece that is done again reports again
            reported += done
            count(done)

        def end(name: str, result: RolledOut) -> None:
            found[name] = result
            done = sum(len(named[each].falls) for each in found)
            if done > reported:  # workers elsewhere report nothing
                receive(Progress(done=done - reported))

        self._spread(self.evaluated.roll_out, roll_out_piece, named, end, receive)
        return [found[name] for name in named]

    def _spread(
        self,
        here: Callable[[Piece], Result],
        away: Callable[[EvaluateRequest, Piece], Result],
        pieces: Mapping[str, Piece],
        end: Callable[[str, Result], None],
        receive: Callable[[Progress], None] | None = None,
    ) -> None:
        """Do pieces in this process or in workers."""
        shared = _make_shared(self.evaluated.request)
        do_pieces(
            here if is_here(self.executor) else partial(away, shared),
            pieces,
            self.executor,
            ended=end,
            monitor=self.monitor,
            robot=shared.robot,
            receive=receive,
        )


def cut_falls(grounds: Grounds, style: str | None, *, most: int, seed: int) -> list[RolloutPiece]:
    """Cut the falls on grounds into pieces of at most a number of robots, with seeds."""
    parts = [
        (ground, falls.falls, first)
        for ground, falls in grounds
        for first in range(0, len(falls.falls), most)
    ]
    return [
        RolloutPiece(
            ground=replace(ground, name=make_absolute(ground.name)),
            falls=falls[first : first + most],
            first=first,
            style=style and make_absolute(style),
            seed=seed * len(parts) + number,
        )
        for number, (ground, falls, first) in enumerate(parts)
    ]


def sample_on_ground(request: EvaluateRequest, ground: SeededScene) -> FallSet:
    """Sample a fall of each class on a ground, in a worker."""
    return _get_policy(request).sample_falls(ground)


def roll_out_piece(request: EvaluateRequest, piece: RolloutPiece) -> RolledOut:
    """Let the policy get up from falls, in a worker."""
    return _get_policy(request).roll_out(piece)


def _make_shared(request: EvaluateRequest) -> EvaluateRequest:
    """Make the request of workers: pieces name scene, style and falls."""
    return make_worker_request(
        EvaluateRequest,
        request,
        policy=make_absolute(request.policy),
        scene="flat",
        style=None,
        falls=None,
    )


@lru_cache(maxsize=1)
def _get_policy(request: EvaluateRequest) -> EvaluatedPolicy:
    """Load the policy of a worker, once."""
    return EvaluatedPolicy(request, threads=1)
