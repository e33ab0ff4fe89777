"""Measure how many small faults the tests notice: mutants of the code that decides and protects.

A seeded sample of mutants (Cosmic Ray's operators) of each module is put in, one at a time, in a
copy of the repository, and the tests beside that module run. A mutant is killed when a test fails.
Mutants of type annotations and decorators are left out: annotations are never evaluated.

    python benchmarks/mutants.py --n 40 --seed 0 --json mutants.json
"""

from __future__ import annotations

import ast
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from queue import SimpleQueue

import tyro
from cosmic_ray.ast import ast_nodes, get_ast_from_path
from cosmic_ray.mutating import mutate_code
from cosmic_ray.plugins import get_operator, operator_names
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from humanoid_getup.experiments.judging.summary import wilson_interval

REPOSITORY = Path(__file__).parents[1]
OPERATORS = re.compile(
    r"core/(ReplaceBinaryOperator_(Add_Sub|Sub_Add|Mul_Div|Div_Mul|FloorDiv_Div|BitAnd_BitOr"
    r"|BitOr_BitAnd)|ReplaceComparisonOperator_(Lt_LtE|LtE_Lt|Gt_GtE|GtE_Gt|Lt_Gt|Gt_Lt|LtE_GtE"
    r"|GtE_LtE|Eq_NotEq|NotEq_Eq|Is_IsNot|IsNot_Is)|ReplaceUnaryOperator_(Delete_\w+|USub_UAdd)"
    r"|ReplaceAndWithOr|ReplaceOrWithAnd|AddNot|ReplaceTrueWithFalse|ReplaceFalseWithTrue"
    r"|ReplaceBreakWithContinue|ReplaceContinueWithBreak|NumberReplacer|ZeroIterationForLoop)"
)
"""Faults that a person could make; most other replacements of operators are type errors."""
TIMEOUT_FACTOR, TIMEOUT_EXTRA = 5.0, 10.0  # s beyond what the tests take without a fault
LONGEST = 600.0  # s for the tests of a module without a fault
_GUARD = (
    "tests/drivers/test_safety_guard_faults.py",
    "tests/drivers/test_safety_guard.py",
)
_EXPERIMENTS = "humanoid_getup/experiments"
_JUDGING = (
    f"tests/{_EXPERIMENTS}/judging",
    "-k=not test_it_s and not one_outcome",  # whole rises: slow, and noticed by the rest
)
_BODY = ("tests/robots/body",)
_PLANNING = "tests/humanoid_getup/planning"
TARGETS: dict[str, tuple[str, ...]] = {
    "drivers/safety_guard.py": _GUARD,
    "drivers/safety_limits.py": _GUARD,
    "drivers/control_loop.py": ("tests/drivers/test_control_loop.py",),
    "drivers/dynamixel/servo_states.py": ("tests/drivers/dynamixel/test_servo_states.py",),
    "drivers/dynamixel/command_writer.py": ("tests/drivers/dynamixel/test_command_writer.py",),
    "drivers/dynamixel/cyclic_read.py": ("tests/drivers/dynamixel/test_cyclic_read.py",),
    "humanoid_getup/planning/rrt_blossom.py": (f"{_PLANNING}/test_rrt_blossom.py",),
    "humanoid_getup/planning/posture_space.py": (f"{_PLANNING}/test_posture_space.py",),
    "humanoid_getup/planning/refinement.py": (f"{_PLANNING}/test_refinement.py",),
    "humanoid_getup/motions/posture_metric.py": (
        "tests/humanoid_getup/motions/test_motion_database.py",
    ),
    "humanoid_getup/filtering/dynamics_filter.py": (
        "tests/humanoid_getup/filtering/test_dynamics_filter.py",
    ),
    "humanoid_getup/filtering/candidate.py": ("tests/humanoid_getup/filtering/test_reference.py",),
    "humanoid_getup/filtering/tracking.py": (
        "tests/humanoid_getup/filtering/test_dynamics_filter.py",
        "tests/humanoid_getup/filtering/test_tracking.py",
    ),
    f"{_EXPERIMENTS}/judging/standing.py": _JUDGING,
    f"{_EXPERIMENTS}/judging/judge.py": _JUDGING,
    f"{_EXPERIMENTS}/judging/outcome.py": _JUDGING,
    f"{_EXPERIMENTS}/judging/torque.py": _JUDGING,
    f"{_EXPERIMENTS}/judging/lying.py": _JUDGING,
    f"{_EXPERIMENTS}/judging/summary.py": _JUDGING,
    f"{_EXPERIMENTS}/rollouts.py": (f"tests/{_EXPERIMENTS}/rollouts",),
    f"{_EXPERIMENTS}/disturbances.py": (f"tests/{_EXPERIMENTS}/disturbances",),
    "humanoid_getup/progress/ledger.py": ("tests/humanoid_getup/progress/test_ledger.py",),
    "humanoid_getup/execution/session.py": ("tests/humanoid_getup/execution/test_session.py",),
    "sim2real/policy_evaluation.py": (
        "tests/sim2real/test_policy_evaluation.py",
        f"tests/{_EXPERIMENTS}/judging/test_running_outcome.py",
    ),
    "sim2real/environment/rewards.py": ("tests/sim2real/environment/test_rewards.py",),
    "humanoid_getup/playback/monitors.py": (
        "tests/humanoid_getup/playback/test_monitors.py",
        "tests/humanoid_getup/playback/test_supervisor.py",
        "-k=not stored_motion",  # whole rises
    ),
    "robots/body/parts.py": _BODY,
    "robots/body/limbs.py": _BODY,
    "robots/body/sides.py": _BODY,
    "robots/body/soles.py": _BODY,
    "robots/body/statics.py": _BODY,
    "robots/model_import/servo_choice.py": ("tests/robots/model_import/test_servo_choice.py",),
    "robots/storage/arrays.py": ("tests/robots/storage/test_arrays.py", "-k=not bomb"),
    "robots/storage/files.py": ("tests/robots/storage/test_files.py", "-k=not standard_output"),
}
"""Modules to mutate, each with the arguments for pytest: the tests that must notice."""


@dataclass(frozen=True, kw_only=True)
class Mutant:
    """One small fault of one module."""

    module: str
    operator: str
    occurrence: int
    line: int
    source: str
    """Source text of the mutated line."""

    def apply(self, text: str) -> str | None:
        """Return a module's text with the fault; None where it changes nothing or is no Python."""
        mutated = mutate_code(text, get_operator(f"core/{self.operator}")(), self.occurrence)
        if mutated is None:
            return None
        try:
            before, after = ast.parse(text), ast.parse(mutated)
        except SyntaxError:
            return None
        is_same = ast.dump(after) == ast.dump(before)
        # Cosmic Ray takes the mark of keyword-only parameters for a multiplication.
        return None if is_same or _count_parameters(after) != _count_parameters(before) else mutated


@dataclass(frozen=True, kw_only=True)
class Survivor:
    """A fault that no test noticed."""

    mutant: Mutant
    changed: str
    """What the fault made of its line."""


@dataclass(frozen=True, kw_only=True)
class Options:
    """Sample mutants of the code that decides and protects; count those that a test notices."""

    n: int = 40
    """Mutants a module, at most."""
    seed: int = 0
    """Seed of the sample."""
    jobs: int = 1
    """Copies of the repository that are tested side by side."""
    only: tuple[str, ...] = ()
    """Modules to mutate (paths); all when left out."""
    json: Path | None = None
    """File for the figures and for every mutant that survived."""


@dataclass(kw_only=True)
class Count:
    """How many mutants of a module were put in, and which survived."""

    n: int = 0
    survivors: list[Survivor] = field(default_factory=list)


def list_mutants(module: str, folder: Path) -> list[Mutant]:
    """List every mutant of a module in a copy, without those of annotations and decorators."""
    path = folder / module
    lines = path.read_text("utf-8").splitlines()
    skipped = set(_annotation_lines(ast.parse(path.read_text("utf-8"))))
    tree, mutants = get_ast_from_path(path), []
    for name in operator_names():
        if not OPERATORS.fullmatch(name):
            continue
        operator = get_operator(name)()
        positions = (
            start for node in ast_nodes(tree) for start, _ in operator.mutation_positions(node)
        )
        for occurrence, (line, column) in enumerate(positions):
            if (line, column) in skipped:
                continue
            source = lines[line - 1].strip()
            mutants.append(
                Mutant(
                    module=module,
                    operator=name.removeprefix("core/"),
                    occurrence=occurrence,
                    line=line,
                    source=source,
                )
            )
    return mutants


def _count_parameters(tree: ast.AST) -> list[tuple[int, int]]:
    signatures = (node for node in ast.walk(tree) if isinstance(node, ast.arguments))
    return [(len(node.posonlyargs), len(node.kwonlyargs)) for node in signatures]


def _annotation_lines(tree: ast.AST) -> Iterable[tuple[int, int]]:
    """Yield the positions (line, column) of annotations and of decorators."""
    for node in ast.walk(tree):
        for part in getattr(node, "decorator_list", ()):
            yield from ((part.lineno, column) for column in range(200))
        for name in ("annotation", "returns"):
            part = getattr(node, name, None)
            if isinstance(part, ast.expr):
                for line in range(part.lineno, (part.end_lineno or part.lineno) + 1):
                    begin = part.col_offset if line == part.lineno else 0
                    end = part.end_col_offset or 0 if line == part.end_lineno else 200
                    yield from ((line, column) for column in range(begin, end + 1))


class Copy:
    """A copy of the repository in which one mutant at a time is tested."""

    def __init__(self, folder: Path) -> None:
        """Copy what git tracks, as it is in the working tree."""
        self.folder = folder
        listed = subprocess.run(
            ["git", "ls-files", "-z"], cwd=REPOSITORY, capture_output=True, check=True, text=True
        )
        for name in filter(None, listed.stdout.split("\0")):
            if (REPOSITORY / name).is_file():
                (folder / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(REPOSITORY / name, folder / name)

        environment = os.environ | {
            "PYTHONPATH": str(folder),
            "PYTHONDONTWRITEBYTECODE": "1",
        }
        self._server = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("pytest_server.py"))],
            cwd=folder,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def close(self) -> None:
        """End the process that runs tests."""
        self._server.communicate()

    def test(self, mutant: Mutant, timeout: float) -> Survivor | bool | None:
        """Return a mutant that survives, whether it is killed, or None where it is no fault."""
        path = self.folder / mutant.module
        original = path.read_text("utf-8")
        mutated = mutant.apply(original)
        if mutated is None:
            return None
        try:
            path.write_text(mutated, "utf-8")
            if not self.passes(mutant.module, timeout):
                return True
        finally:
            path.write_text(original, "utf-8")
        lines = mutated.splitlines()
        return Survivor(mutant=mutant, changed=lines[mutant.line - 1].strip())

    def passes(self, module: str, timeout: float) -> bool:
        """Run the tests beside a module; tests that never end fail."""
        assert self._server.stdin and self._server.stdout
        request = {"timeout": timeout, "arguments": ["-m", "not slow", *TARGETS[module]]}
        print(json.dumps(request), file=self._server.stdin, flush=True)
        return int(self._server.stdout.readline()) == 0


def measure(options: Options, console: Console) -> dict[str, Count]:
    """Put mutants in and count those that survive.

    Raises:
        RuntimeError: if the tests of a module fail without any mutant.
    """
    counts: dict[str, Count] = {}
    with tempfile.TemporaryDirectory() as folder, Progress(console=console) as progress:
        copies: SimpleQueue[Copy] = SimpleQueue()
        for job in range(options.jobs):
            copies.put(Copy(Path(folder) / str(job)))
        for module in options.only or TARGETS:
            mutants = list_mutants(module, Path(folder) / "0")
            rng = random.Random(f"{options.seed} {module}")
            sample = rng.sample(mutants, min(options.n, len(mutants)))
            timeout = _time_tests(copies, module)

            def test(mutant: Mutant, timeout: float = timeout) -> Survivor | bool | None:
                copy = copies.get()
                try:
                    return copy.test(mutant, timeout)
                finally:
                    copies.put(copy)

            counts[module] = count = Count()
            bar = progress.add_task(module, total=len(sample))
            with ThreadPoolExecutor(options.jobs) as pool:
                for result in pool.map(test, sample):
                    progress.advance(bar)
                    count.n += result is not None
                    if isinstance(result, Survivor):
                        count.survivors.append(result)
            console.print(_describe(module, count), markup=False, highlight=False, soft_wrap=True)
            if options.json is not None:
                _write(options, counts)
        while not copies.empty():
            copies.get().close()
    return counts


def _describe(module: str, count: Count) -> str:
    """Return one line for a module and one for each survivor."""
    lines = [f"{module}: {count.n - len(count.survivors)} of {count.n} killed"]
    for survivor in count.survivors:
        m = survivor.mutant
        lines.append(f"  {m.line} {m.operator}: {m.source}  ->  {survivor.changed}")
    return "\n".join(lines)


def _write(options: Options, counts: dict[str, Count]) -> None:
    assert options.json is not None
    record = {
        "seed": options.seed,
        "modules": {
            module: {
                "n": count.n,
                "survivors": [vars(s.mutant) | {"changed": s.changed} for s in count.survivors],
            }
            for module, count in counts.items()
        },
    }
    options.json.parent.mkdir(parents=True, exist_ok=True)
    options.json.write_text(json.dumps(record, indent=1) + "\n", "utf-8")


def _time_tests(copies: SimpleQueue[Copy], module: str) -> float:
    """Return how long tests with a mutant may take [s]."""
    copy = copies.get()
    try:
        begin = time.perf_counter()
        if not copy.passes(module, LONGEST):
            raise RuntimeError(f"the tests of {module} fail without any mutant")
        return TIMEOUT_FACTOR * (time.perf_counter() - begin) + TIMEOUT_EXTRA
    finally:
        copies.put(copy)


def tabulate(counts: dict[str, Count]) -> Table:
    """Make a table: mutants, killed share and its 95 % interval, by module."""
    table = Table("module", "mutants", "killed", "share (95 %)")
    for module, count in counts.items():
        killed = count.n - len(count.survivors)
        low, high = wilson_interval(killed, count.n)
        share = f"{killed / max(count.n, 1):.2f} ({low:.2f} to {high:.2f})"
        table.add_row(module, str(count.n), str(killed), share)
    return table


def main() -> None:
    """Run the measurement and print it."""
    options, console = tyro.cli(Options), Console(stderr=True)
    Console().print(tabulate(measure(options, console)))


if __name__ == "__main__":
    main()
