"""Count the code, and how far a reader has to walk through it.

    python benchmarks/code_size.py --tree ../base --json code_size.json

Three walks are traced: of a fallen posture through `getup rise` (preparing, planning, filtering,
playing) and through `getup eval`, and of an encoder tick through one read of the driver. A reader
who follows a walk looks at each function once, in the order in which it is first called: a stop is
a run of such functions in one file, a return a stop in a file that was visited before. Bodies of
classes, which Python runs when it imports a file, are no functions. The walked checkout is the one
that Python imports; PYTHONPATH names another.
"""

from __future__ import annotations

import ast
import inspect
import re
import resource
import statistics
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations, groupby
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import tyro

import humanoid_getup
from robots.storage.encoding import to_json
from robots.storage.files import write_atomically

HERE = Path(humanoid_getup.__file__).parents[1]
PACKAGES = ("robots", "drivers", "humanoid_getup", "sim2real")
PLUGINS = "plugins"
_HG = {
    "application": ("commands", "__init__.py", "__init__.pyi", "library_environment.py"),
    "studio": ("studio",),
    "reporting, benchmarks": ("reporting", "benchmarks"),
    "planning, filtering, strategies": ("planning", "filtering", "strategies"),
    "posture_chains": ("posture_chains",),
    "playback, execution": ("playback", "execution"),
    "motions, clips, style": ("motions", "clips", "style"),
    "policy": ("policy",),
    "experiments, simulation, scenes": ("experiments", "simulation", "scenes"),
    "engines, progress": ("engines", "progress"),
    "robot_check, ros": ("robot_check", "ros"),
}
"""What the parts of the product hold, of its largest package."""
PROSE = {"docs": "docs/**/*.md", "top": "*.md", "plugins": "plugins/*/*.md", "README": "README.md"}
LEAST_FIELDS, MIRRORED = 4, 0.6  # of value classes that mirror each other, share of the smaller
MOST_LISTED = 12  # files that a walk comes back to most often


@dataclass(frozen=True, kw_only=True)
class Options:
    """Count a checkout; walk through the one that Python imports."""

    tree: Path = HERE
    """The checkout to count."""
    walks: bool = True
    """Trace the three walks as well."""
    test: bool = False
    """Run `make test` in the counted checkout and time it, what it installs included."""
    json: Path | None = None
    """Where figures are written."""


def count(tree: Path) -> dict[str, Any]:
    """Count lines, files, folders, functions and documented names of a checkout."""
    files = list_files(tree)
    texts = {file: file.read_text("utf-8").splitlines() for file in files}
    nodes = [node for text in texts.values() for node in ast.walk(ast.parse("\n".join(text)))]
    functions = [node for node in nodes if isinstance(node, ast.FunctionDef)]
    public = [
        node
        for node in nodes
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)) and not node.name.startswith("_")
    ]
    folders = Counter(file.parent for file in files if file.name != "__init__.py")
    tests = [
        file.read_text("utf-8")
        for folder in ("tests", *(str(f.relative_to(tree)) for f in tree.glob("plugins/*/tests")))
        for file in (tree / folder).rglob("*.py")
    ]
    return {
        "files": len(files),
        "lines": sum(map(len, texts.values())),
        "lines_not_blank": sum(bool(line.strip()) for text in texts.values() for line in text),
        "test_lines": sum(len(text.splitlines()) for text in tests),
        "test_functions": sum(len(re.findall(r"^ *def test_", text, re.M)) for text in tests),
        "words": {name: count_words(tree, pattern) for name, pattern in PROSE.items()},
        "parts": count_parts(tree, texts),
        "folders": len(folders),
        "files_of_largest_folder": max(folders.values()),
        "depth": max(len(file.relative_to(tree).parts) - 1 for file in files),
        "file_lines": spread([len(text) for text in texts.values() if len(text) > 1]),
        "function_lines": spread([f.end_lineno - f.lineno + 1 for f in functions if f.end_lineno]),
        "public_names": len(public),
        "public_names_documented": sum(ast.get_docstring(node) is not None for node in public),
        "lines_by_folder": count_by_folder(tree, texts),
        **count_doubles(files, nodes),
        "mirrored_classes": list_mirrored(nodes),
        "functions_of_more_than_5_arguments": sum(count_arguments(f) > 5 for f in functions),
        "functions_of_more_than_7_arguments": sum(count_arguments(f) > 7 for f in functions),
        "dicts_of_anything": sum(
            "\n".join(text).count("dict[str, Any]") for text in texts.values()
        ),
    }


def list_files(tree: Path) -> list[Path]:
    """List the files of Python that are installed, those of plugins included."""
    packages = [file for name in PACKAGES for file in (tree / name).rglob("*.py*")]
    packages = [file for file in packages if file.suffix in (".py", ".pyi")]
    plugins = (tree / PLUGINS).rglob("*.py")
    return packages + [file for file in plugins if "tests" not in file.relative_to(tree).parts]


def count_words(tree: Path, pattern: str) -> int:
    """Count the words of the documents that a pattern names."""
    return sum(len(file.read_text("utf-8").split()) for file in tree.glob(pattern))


def count_parts(tree: Path, texts: dict[Path, list[str]]) -> dict[str, int]:
    """Count the lines of each part of the product."""
    of_folder = {folder: part for part, folders in _HG.items() for folder in folders}
    lines = Counter()
    for file, text in texts.items():
        package, below, *_ = file.relative_to(tree).parts
        part = of_folder.get(below, package) if package == "humanoid_getup" else package
        lines[part] += len(text)
    return dict(lines)


def time_tests(tree: Path) -> float:
    """Run `make test` in a checkout; return how long it takes [s].

    Raises:
        subprocess.CalledProcessError: if a test fails.
    """
    begin = time.perf_counter()
    subprocess.run(["make", "test"], cwd=tree, check=True)
    return time.perf_counter() - begin


def count_by_folder(tree: Path, texts: dict[Path, list[str]]) -> dict[str, int]:
    """Count the lines of each folder, two levels deep."""
    lines = Counter()
    for file, text in texts.items():
        parts = file.relative_to(tree).parts[:-1]
        lines["/".join(parts[:2])] += len(text)
    return dict(sorted(lines.items()))


def count_doubles(files: list[Path], nodes: list[ast.AST]) -> dict[str, Any]:
    """Count the names of public classes and of modules that stand in several places."""
    classes = Counter(
        node.name for node in nodes if isinstance(node, ast.ClassDef) and node.name[0] != "_"
    )
    modules = Counter(file.name for file in files if file.name != "__init__.py")
    return {
        "class_names_twice": sorted(name for name, times in classes.items() if times > 1),
        "module_names_twice": sum(times > 1 for times in modules.values()),
        "constants": sum(isinstance(node, ast.Module) and count_constants(node) for node in nodes),
    }


def list_mirrored(nodes: list[ast.AST]) -> list[str]:
    """List pairs of value classes of which one declares three fifths of the other's fields."""
    fields = {
        node.name: {
            each.target.id
            for each in node.body
            if isinstance(each, ast.AnnAssign) and isinstance(each.target, ast.Name)
        }
        for node in nodes
        if isinstance(node, ast.ClassDef)
    }
    large = [(name, own) for name, own in fields.items() if len(own) >= LEAST_FIELDS]
    return [
        f"{one} and {other}: {', '.join(sorted(ours & theirs))}"
        for (one, ours), (other, theirs) in combinations(large, 2)
        if len(ours & theirs) >= MIRRORED * min(len(ours), len(theirs))
    ]


def count_constants(module: ast.Module) -> int:
    """Count the names in capitals that a module assigns at its top level."""
    targets = [
        target
        for node in module.body
        if isinstance(node, (ast.Assign, ast.AnnAssign))
        for target in (node.targets if isinstance(node, ast.Assign) else [node.target])
    ]
    return sum(isinstance(target, ast.Name) and target.id.isupper() for target in targets)


def count_arguments(function: ast.FunctionDef) -> int:
    """Count the arguments of a function without self and cls."""
    arguments = function.args
    names = [a.arg for a in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs)]
    return len(names) - (names[:1] in (["self"], ["cls"]))


def spread(values: list[int]) -> dict[str, float]:
    """Return median, 90th percentile and maximum."""
    tenth = statistics.quantiles(values, n=10, method="inclusive")[-1]
    return {"median": statistics.median(values), "p90": tenth, "max": max(values)}


def time_start(tree: Path, arguments: list[str], n: int = 5) -> float:
    """Measure the processor time of a command, the median of n runs [s]."""
    times = []
    for _ in range(n):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *arguments], cwd=tree, capture_output=True, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        times.append(after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime)
    return statistics.median(times)


@contextmanager
def traced(tree: Path) -> Iterator[dict[str, Any]]:
    """Trace the functions of a checkout that this thread calls, and count the walk at the end."""
    seen: dict[tuple[str, str], None] = {}
    roots = tuple(f"{tree / name}/" for name in PACKAGES)

    def note(frame: FrameType, event: str, _: object) -> None:
        code = frame.f_code
        # Comprehensions and lambdas belong to the function that they stand in.
        is_function = code.co_flags & inspect.CO_NEWLOCALS and code.co_name[0] != "<"
        if event == "call" and is_function and code.co_filename.startswith(roots):
            seen.setdefault((code.co_filename, code.co_qualname))

    walk: dict[str, Any] = {}
    sys.setprofile(note)
    try:
        yield walk
    finally:
        sys.setprofile(None)
    stops = [file for file, _ in groupby(file for file, _ in seen)]
    rooms = len(set(stops))
    folders = len({Path(file).parent for file in stops})
    walk |= {"functions": len(seen), "stops": len(stops), "files": rooms}
    walk |= {"returns": len(stops) - rooms, "folders": folders}
    most = Counter(str(Path(file).relative_to(tree)) for file in stops).most_common(MOST_LISTED)
    walk["most_returns"] = {file: visits - 1 for file, visits in most if visits > 1}


def walk_through_rise() -> dict[str, Any]:
    """Trace `getup rise --from prone`: fall, plan, filter, preflight, play, judge."""
    from humanoid_getup.commands.main import main

    with traced(HERE) as walk:
        code = main(("rise", "--from", "prone"))
    return walk | {"exit_code": code}


def walk_through_eval() -> dict[str, Any]:
    """Trace `getup eval robust`: falls, policy, rollouts, judge."""
    from humanoid_getup.commands.main import main

    with traced(HERE) as walk:
        code = main(("eval", "robust", "--n", "4"))
    return walk | {"exit_code": code}


def walk_through_read() -> dict[str, Any]:
    """Trace one read of the driver, from the bytes of the port to the state of the robot."""
    hg = humanoid_getup
    from drivers.dynamixel.clock import CycleClock
    from drivers.twin.simulation import Simulation
    from drivers.virtual_bus import TimeMode, VirtualPorts, VirtualRobot

    world = hg.World(hg.load_robot("op3"))
    virtual = VirtualRobot(Simulation(world))
    with VirtualPorts(virtual, time_mode=TimeMode.LOCK_STEP) as ports:
        backend = hg.DynamixelBackend(world.robot, ports.paths, clock=CycleClock())
        with backend, traced(HERE) as walk:
            state = backend.read()
    return walk | {"finite": bool(np.isfinite(state.joint_pos).all())}


WALKS: dict[str, Callable[[], dict[str, Any]]] = {
    "posture through rise": walk_through_rise,
    "posture through eval": walk_through_eval,
    "encoder tick through read": walk_through_read,
}


def main(options: Options) -> None:
    """Count, walk, print, write."""
    cases: dict[str, Any] = {"counts": count(options.tree)}
    if options.walks:
        cases["processor_s"] = {
            name: time_start(HERE, ["-m", "humanoid_getup.commands.main", name])
            for name in ("--help", "robots")
        }
        cases |= {name: walk() for name, walk in WALKS.items()}
    if options.test:
        cases["make test"] = {"wall_s": time_tests(options.tree)}
    for name, case in cases.items():
        print(f"{name}:")
        for key, value in case.items():
            lines = value if isinstance(value, list) else [value]
            print(f"  {key:24} {f'{chr(10)}{chr(32) * 27}'.join(map(str, lines))}")
    if options.json is not None:
        write_atomically(options.json, to_json({"name": "code_size", "cases": cases}))


if __name__ == "__main__":
    main(tyro.cli(Options))
