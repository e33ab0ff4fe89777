"""`getup bench NAME`: benchmarks on the twin and on the virtual bus."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from rich.table import Table

from humanoid_getup.benchmarks import (
    disturbed,
    fault_injection,
    motions,
    rise,
    scenes,
    sit,
    soak,
    speed,
)
from humanoid_getup.cli.console import console_for, counting, format_figure, phase, showing
from humanoid_getup.cli.exit_codes import DID_IT, DID_NOT_STAND
from humanoid_getup.cli.output import write_json
from humanoid_getup.cli.repeat import hinting
from humanoid_getup.jobs.errors import refusing
from humanoid_getup.jobs.inputs import find_motion, load_robot, load_world, make_torque_limit
from humanoid_getup.jobs.measure_robot import NEAREST, measure_robot
from humanoid_getup.jobs.policies import load_policy
from humanoid_getup.jobs.requests.bench import (
    PAGE,
    BenchAll,
    BenchDisturbed,
    BenchFaults,
    BenchFilter,
    BenchKill,
    BenchMethods,
    BenchMotions,
    BenchRise,
    BenchScenes,
    BenchSit,
    BenchSoak,
)
from humanoid_getup.jobs.requests.shared import BodyOption, Request, SceneOptions
from humanoid_getup.motions.motion import MIRRORED_SUFFIX, STANDING
from humanoid_getup.motions.motion_database import MotionDatabase, find_lying_down, load_database
from humanoid_getup.playback.stand_holder import make_stand
from humanoid_getup.scenes.named_scenes import load_scene
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.plan import Strategy
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.stored_motion import NearestMotion
from humanoid_getup.strategies.track_record import PLAN
from robots import Body, Robot

STRAIGHT = "straight"
SAFETY_FIGURES = ("n", "succeeded", "endings", "safe_max_s", "beyond_limits", "believed_wrong")
LOAD_FIGURES = ("stand_time_s", "peak_torque_nm", "rms_torque_nm")
FIGURES = {
    "all": ("n", "stood", "stood_interval_95", *LOAD_FIGURES, "torque_use", "head_impact_m_s"),
    "rise": ("n", "planned", "stood", "stood_interval_95", *LOAD_FIGURES, "self_collisions"),
    "methods": ("n", "stood", *LOAD_FIGURES, "head_impact_m_s", "hottest_after_ten_rises_c"),
    "disturbed": ("n", "stood", "stood_interval_95", "refused", *LOAD_FIGURES, "head_impact_m_s"),
    "scenes": ("n", "planned", "stood", "stood_interval_95", "refused", *LOAD_FIGURES),
    "motions": (*LOAD_FIGURES, "lowest_torque_limit_nm", "disturbed_succeeded"),
    "sit": ("n", "succeeded", "interval_95", "head_impact_max_m_s", "torso_impact_max_m_s"),
    "filter": ("n", "filter_over_bare_steps_per_s"),
    "faults": SAFETY_FIGURES,
    "kill": SAFETY_FIGURES,
    "soak": (
        "n",
        "stood",
        "lay_down",
        "faster_than_real_time",
        "unexplained_s",
        "memory_mib",
    ),
}
"""Figures of each benchmark's table, by its name."""
HEADINGS = {
    "n": "n",
    "planned": "planned",
    "stood": "stood",
    "succeeded": "succeeded",
    "stood_interval_95": "95 %",
    "interval_95": "95 %",
    "refused": "refused",
    "stand_time_s": "stand [s]",
    "peak_torque_nm": "peak [N·m]",
    "rms_torque_nm": "RMS [N·m]",
    "torque_use": "of limit",
    "head_impact_m_s": "head [m/s]",
    "head_impact_max_m_s": "head, max [m/s]",
    "torso_impact_max_m_s": "torso, max [m/s]",
    "self_collisions": "self-collisions",
    "hottest_after_ten_rises_c": "after ten [°C]",
    "lowest_torque_limit_nm": "lowest limit [N·m]",
    "disturbed_succeeded": "disturbed",
    "filter_over_bare_steps_per_s": "over bare steps",
    "endings": "endings",
    "safe_max_s": "safe after, max [s]",
    "beyond_limits": "beyond limits",
    "believed_wrong": "believed wrong",
    "lay_down": "lay down",
    "faster_than_real_time": "faster than real time",
    "unexplained_s": "unexplained [s]",
    "memory_mib": "memory [MiB]",
}
"""Headings of the figures in tables."""


def bench_all(command: BenchAll) -> int:
    """Run the whole benchmark, or go on with it; say where its page is."""
    with hinting("bench all", command), showing(command) as report:
        result = measure_robot(command, report)
    code = hand_over(result, command)
    console_for(command).print(f"written to {command.out / PAGE}", markup=False)
    return code


def bench_rise(command: BenchRise) -> int:
    """Rise from many settled falls."""
    world, database = _load(command)
    planner = PlannedRise(
        world,
        database,
        planning=command.planning,
        filtering=command.filtering,
        assistance=command.assistance,
        torque_limit=make_torque_limit(command, world.robot),
        prefer=command.prefer,
        search_budget=command.search_budget,
    )
    rises = len(rise.BENCH_CLASSES) * command.n
    return run_benchmark(command, rise.bench_rise, planner, count=rises, of="rises")


def bench_methods(command: BenchMethods) -> int:
    """Compare plans and policies on the same falls."""
    world, database = _load(command)
    limit = make_torque_limit(command, world.robot)

    def make_strategy(name: str) -> Strategy:
        if name == PLAN:
            return PlannedRise(world, database, torque_limit=limit)
        policy = load_policy(world.robot, name, command.torque_limit)
        return LearnedRise(world, policy, torque_limit=limit, name=name)

    strategies = {name: make_strategy(name) for name in command.ways}
    rises = len(rise.BENCH_CLASSES) * command.n * len(strategies)
    return run_benchmark(command, rise.bench_methods, strategies, count=rises, of="rises")


def bench_disturbed(command: BenchDisturbed) -> int:
    """Compare plans, with and without feedback, and policies in disturbed worlds."""
    world, database = _load(command)
    limit = make_torque_limit(command, world.robot)
    with refusing():
        cases = disturbed.select(world.robot, command.cases)
    policies = {
        name: LearnedRise(
            world,
            load_policy(world.robot, name, command.torque_limit),
            torque_limit=limit,
            name=name,
        )
        for name in command.policies
    }
    rises = len(cases) * (2 + len(policies)) * len(rise.BENCH_CLASSES) * command.n
    planner = PlannedRise(world, database, torque_limit=limit)

    def bench(planner: PlannedRise, **options: Any) -> dict[str, Any]:
        return disturbed.bench_disturbed(planner, policies, disturbances=cases, **options)

    return run_benchmark(command, bench, planner, count=rises, of="rises")


def bench_scenes(command: BenchScenes) -> int:
    """Compare plans, policies and stored motions in every scene."""
    with phase("loading"), refusing():
        robot = load_robot(command)
        database = load_database(robot)
        names = command.scenes or scenes.SCENES
        for name in names:
            load_scene(name, robot, command.seed)
    limit = make_torque_limit(command, robot)

    def make_way(name: str) -> scenes.Way:
        if name == PLAN:
            return scenes.Way(lambda world: PlannedRise(world, database, torque_limit=limit))
        if name == NEAREST:
            return scenes.Way(
                lambda world: NearestMotion(world, database, torque_limit=limit), preflight=False
            )
        if name == STRAIGHT:
            return scenes.Way(
                lambda world: PlannedRise(
                    world, database, planning=False, filtering=False, torque_limit=limit
                ),
                preflight=False,
            )
        policy = load_policy(robot, name, command.torque_limit)
        return scenes.Way(lambda world: LearnedRise(world, policy, torque_limit=limit, name=name))

    ways = {name: make_way(name) for name in command.ways}
    count = len(names) * len(ways) * command.n

    def bench(robot: Robot, **options: Any) -> dict[str, Any]:
        return scenes.bench_scenes(robot, ways, scenes=names, **options)

    return run_benchmark(command, bench, robot, count=count, of="rises")


def bench_motions(command: BenchMotions) -> int:
    """Play every stored motion, undisturbed and disturbed."""
    world, database = _load(command)
    own = [m for m in database.motions if not m.name.endswith(MIRRORED_SUFFIX)]
    return run_benchmark(command, motions.bench_motions, world, own, count=len(own), of="motions")


def bench_sit(command: BenchSit) -> int:
    """Sit and lie down from many disturbed stands."""
    world = load_world(command)
    with refusing():
        find_lying_down(world.robot)
    count = command.n * len(sit.LIMITS)
    return run_benchmark(command, sit.bench_sit, world, count=count, of="stands")


def bench_filter(command: BenchFilter) -> int:
    """Compare the speed of the filter's simulation with bare physics."""
    world, database = _load(command)
    with phase("filtering"):
        result = speed.bench_filter(world, database, seed=command.seed, repeats=command.n)
    return hand_over(result, command)


def bench_faults(command: BenchFaults) -> int:
    """Inject each kind of fault in the middle of a motion, or of a held stand."""
    world, cases = load_world(command), len(fault_injection.CASES)
    robot, is_stand = world.robot, command.motion == STANDING
    motion = make_stand(robot) if is_stand else find_motion(robot, command.motion)
    return run_benchmark(
        command, fault_injection.bench_faults, world, motion, count=cases, of="cases"
    )


def bench_kill(command: BenchKill) -> int:
    """Kill the program in the middle of a rise."""
    world = load_world(command)
    motion = find_motion(world.robot, command.motion)
    return run_benchmark(
        command, fault_injection.bench_kill, world, motion, count=command.n, of="kills"
    )


def bench_soak(command: BenchSoak) -> int:
    """Rise, hold, lie down, tumble and rise again for a time on the bus."""
    planner = PlannedRise(*_load(command))
    with counting("bus time [s]", round(command.duration)) as count:
        result = soak.bench_soak(
            planner, seed=command.seed, duration=command.duration, report=count
        )
    return hand_over(result, command)


def run_benchmark(
    command: BenchRise
    | BenchMethods
    | BenchDisturbed
    | BenchScenes
    | BenchMotions
    | BenchSit
    | BenchFaults
    | BenchKill,
    bench: Callable[..., dict[str, Any]],
    *subjects: Any,
    count: int,
    of: str,
) -> int:
    """Run a benchmark that reports each of a number of steps; return the exit code."""
    with counting(of, count) as advance:
        result = bench(*subjects, seed=command.seed, each=command.n, report=lambda _: advance(1))
    return hand_over(result, command)


def _load(command: SceneOptions) -> tuple[World, MotionDatabase]:
    world = load_world(command)
    with phase("loading"), refusing():
        return world, load_database(world.robot)


def hand_over(result: dict[str, Any], command: Request) -> int:
    """Write the results, print the main figures as a table, and return the exit code.

    The code is 1 if a limit was passed, a wrong position believed, or a robot never safe.
    """
    if isinstance(command, BodyOption):
        result |= {"body": str(Body.parse(command.body))}
    write_json(result, command)
    cases = result.get("classes") or result["cases"]
    figures = FIGURES[result["name"]]
    headings = [HEADINGS[figure] for figure in figures]
    table = Table(result["name"], *headings, box=None, header_style="bold")
    for name, case in cases.items():
        table.add_row(name, *(format_figure(case.get(figure)) for figure in figures))
    console_for(command).print(table)
    harms = ("beyond_limits", "believed_wrong", "never_safe")
    harmed = any(case.get(harm) for case in cases.values() for harm in harms)
    return DID_NOT_STAND if harmed else DID_IT
