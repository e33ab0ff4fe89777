"""`getup bench all`: the whole benchmark of a robot, as one page with pictures."""

from __future__ import annotations

import hashlib
import math
import shlex
from functools import partial
from pathlib import Path
from typing import Any

from humanoid_getup.benchmarks import disturbed
from humanoid_getup.benchmarks.part import Part
from humanoid_getup.benchmarks.rise_method import RiseMethod
from humanoid_getup.benchmarks.torque_cap import QUICK_SHARES, SHARES, make_caps
from humanoid_getup.benchmarks.whole import (
    CASES,
    QUICK_CASES,
    Whole,
    name_rises,
    summarize_parts,
)
from humanoid_getup.cli.bench import NEAREST, hand_over
from humanoid_getup.cli.errors import refusing
from humanoid_getup.cli.inputs import load_robot
from humanoid_getup.cli.options.bench import (
    FIGURES,
    PAGE,
    PARTS,
    PLOT,
    WHOLE_ARTEFACTS,
    BenchAll,
)
from humanoid_getup.cli.output import console_for, counting, phase, staging, to_json
from humanoid_getup.cli.part_store import PartStore
from humanoid_getup.cli.policies import load_policy
from humanoid_getup.motions.motion import MIRRORED_SUFFIX
from humanoid_getup.motions.motion_database import MOTION_FOLDER, MotionDatabase, load_database
from humanoid_getup.policy.onnx_policy import list_policies
from humanoid_getup.reporting.benchmark_page import write_page
from humanoid_getup.reporting.benchmark_plot import save_benchmark
from humanoid_getup.reporting.conditions import describe_conditions
from humanoid_getup.reporting.film_strip import AFTERMATH, NoRendererError, save_run
from humanoid_getup.simulation.world import World
from humanoid_getup.strategies.cached_rise import compute_fingerprint
from humanoid_getup.strategies.learned_rise import LearnedRise
from humanoid_getup.strategies.planned_rise import PlannedRise
from humanoid_getup.strategies.stored_motion import NearestMotion
from humanoid_getup.strategies.track_record import PLAN
from robots import Robot, TorqueLimit

Results = dict[str, dict[str, Any]]


def bench_all(command: BenchAll) -> int:
    """Run the whole benchmark, or go on with it; write its page."""
    with phase("loading"), refusing():
        world = World(load_robot(command))
        whole = _load_whole(command, world)
    results = _run_parts(command, whole)
    result = summarize_parts(whole, results)
    result["notes"] = _list_notes(world.robot, whole)
    result["command"] = _write_command(command)
    result["conditions"] = describe_conditions(world, whole.caps[0].limit)
    with phase("drawing") as report, staging(command.out, WHOLE_ARTEFACTS) as folder:
        result["pictures"] = _draw(whole, results, result, folder, report)
        (folder / FIGURES).write_text(to_json(result), "utf-8")
        (folder / PAGE).write_text(write_page(result), "utf-8")
    code = hand_over(result, command)
    console_for(command.json).print(f"written to {command.out / PAGE}", markup=False)
    return code


def _load_whole(command: BenchAll, world: World) -> Whole:
    """Find what the robot can do; whatever it lacks is left out."""
    robot = world.robot
    caps = make_caps(robot, command.limit_by, QUICK_SHARES if command.quick else SHARES)
    has_motions = any((robot.folder / MOTION_FOLDER).glob("*.npz"))
    database = load_database(robot) if has_motions else None
    policies = _find_policies(robot)
    full = caps[0].limit
    own = database.motions if database else ()
    return Whole(
        world=world,
        methods=[*_plan_methods(world, database), *_policy_methods(world, policies)],
        motions=[motion for motion in own if not motion.name.endswith(MIRRORED_SUFFIX)],
        caps=caps,
        planner=PlannedRise(world, database, torque_limit=full) if database else None,
        policies={name: _learn(world, name, full) for name in policies},
        disturbances=disturbed.select(robot, QUICK_CASES if command.quick else CASES),
        seed=command.seed,
        each=command.each,
    )


def _find_policies(robot: Robot) -> dict[str, Path]:
    """Find the policies of a robot by name; none for another body than theirs."""
    if not robot.body.is_original:
        return {}
    return {file.stem: file for file in list_policies(robot)}


def _plan_methods(world: World, database: MotionDatabase | None) -> list[RiseMethod]:
    if database is None:
        return []
    fingerprint = compute_fingerprint(PlannedRise(world, database))
    return [
        RiseMethod(
            name=PLAN,
            make=lambda limit: PlannedRise(world, database, torque_limit=limit),
            fingerprint=fingerprint,
        ),
        RiseMethod(
            name=NEAREST,
            make=lambda limit: NearestMotion(world, database, torque_limit=limit),
            fingerprint=fingerprint,
            preflight=False,
        ),
    ]


def _policy_methods(world: World, policies: dict[str, Path]) -> list[RiseMethod]:
    return [
        RiseMethod(
            name=name,
            make=partial(_learn, world, name),
            fingerprint=hashlib.sha256(file.read_bytes()).hexdigest(),
        )
        for name, file in policies.items()
    ]


def _learn(world: World, name: str, limit: TorqueLimit) -> LearnedRise:
    policy = load_policy(world.robot, name, limit.value)
    return LearnedRise(world, policy, torque_limit=limit, name=name)


def _run_parts(command: BenchAll, whole: Whole) -> Results:
    """Run the parts that are not finished; every kept one is checked before any work."""
    parts, store = whole.parts(), PartStore(command.out / PARTS)
    with refusing():
        if not command.resume:
            store.clear()
        kept = {part.name: store.load(part) for part in parts}
    results: Results = {name: result for name, result in kept.items() if result is not None}
    if command.resume:
        message = f"{len(results)} of {len(parts)} parts are finished"
        console_for(command.json).print(message, markup=False)
    try:
        _run_rest([part for part in parts if part.name not in results], store, results)
    except KeyboardInterrupt as interrupt:
        again = f"{_write_command(command)} --out {shlex.quote(str(command.out))} --resume"
        raise KeyboardInterrupt(f"{again} goes on") from interrupt
    return {part.name: results[part.name] for part in parts}


def _run_rest(parts: list[Part], store: PartStore, results: Results) -> None:
    with counting("rises", sum(part.count for part in parts)) as advance, refusing():
        for part in parts:
            done: list[dict[str, Any]] = []

            def report(record: dict[str, Any], done: list[dict[str, Any]] = done) -> None:
                done.append(record)
                advance(1)

            results[part.name] = store.run(part, report)
            advance(part.count - len(done))  # of classes in which the robot never lies


def _list_notes(robot: Robot, whole: Whole) -> list[str]:
    """List what was not measured, and why."""
    notes = []
    if whole.planner is None:
        notes.append(
            f"Robot '{robot.name}' has no motions: nothing is planned or played, and no rise is "
            "disturbed. `getup motions retarget` takes those of another robot."
        )
    if not whole.policies:
        other = "" if robot.body.is_original else " for this body"
        notes.append(f"Robot '{robot.name}' has no policies{other}: nothing learned is measured.")
    return notes


def _draw(
    whole: Whole, results: Results, result: dict[str, Any], folder: Path, report: Any
) -> dict[str, Any]:
    """Draw the plot and a rise of each class; return the files, or why there are none."""
    if not whole.methods:
        return {"plot": None, "strips": {}, "reason": "there is no rise to draw"}
    save_benchmark(result, folder / PLOT)
    method, cap = whole.methods[0], whole.caps[0]
    strips: dict[str, str] = {}
    reason = ""
    for name, number in _choose_rises(results[name_rises(method.name, cap)]).items():
        report(f"drawing a {name} rise")
        try:
            file = f"strip_{name}.png"
            rise = whole.repeat(method, number)
            if rise.outcome is not None:
                title = f"{whole.world.robot.name}, {name} fall: {rise.plan.label}"
                end = rise.outcome.stand.start_time + AFTERMATH if rise.stood else math.inf
                rows = end / whole.world.robot.control_period
                qpos, robot = rise.outcome.qpos, whole.world.robot
                save_run(robot, whole.world.model, qpos, rows, folder / file, title=title)
                strips[name] = file
        except NoRendererError as error:
            reason = str(error)
            break
    return {"plot": PLOT, "strips": strips, "method": method.name, "reason": reason}


def _choose_rises(result: dict[str, Any]) -> dict[str, int]:
    """Choose the first rise of each class that stood, or else the first; by its number."""
    rises = result["rises"]
    chosen = {}
    for name in result["classes"]:
        numbers = [k for k, rise in enumerate(rises) if rise["bench_class"] == name]
        chosen[name] = next((k for k in numbers if rises[k]["stood"]), numbers[0])
    return chosen


def _write_command(command: BenchAll) -> str:
    """Write the command line that repeats the benchmark."""
    words = ["getup", "bench", "all", "--robot", command.robot, "--n", str(command.each)]
    words += ["--seed", str(command.seed)]
    words += ["--body", command.body] if command.body else []
    words += ["--limit-by", command.limit_by] if command.limit_by else []
    words += ["--quick"] if command.quick else []
    return shlex.join(words)
