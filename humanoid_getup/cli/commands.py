"""The commands of `getup`: only the modules of the chosen command are imported."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from importlib import import_module
from importlib.metadata import version
from typing import Annotated, Any, NamedTuple, Union

import tyro
from tyro.conf import subcommand

from humanoid_getup.cli.old_spellings import modernize
from humanoid_getup.cli.options.shared import with_json
from humanoid_getup.cli.parsing import in_one_line, registry
from humanoid_getup.cli.shared.console import phase
from humanoid_getup.jobs.errors import BadInputError
from humanoid_getup.jobs.requests.shared import JobRequest
from humanoid_getup.jobs.requests.values import list_options

DESCRIPTION = "Get a fallen humanoid up: plan, filter through physics, play, judge."

SECTIONS = {
    "get up": ("rise", "play", "run", "sit", "hold"),
    "plan and check": ("plan", "preflight", "motions", "mocap", "scenes", "style", "plan-cache"),
    "learn": ("train", "eval", "export", "prior"),
    "robot": ("robots", "scan", "doctor", "calibrate", "bus"),
    "look": ("replay", "bench"),
}
"""Commands in the order of `getup --help`; each section has a folder of its own in ``cli``."""


class TableEntry(NamedTuple):
    """A command, or a group of commands, which has a summary only."""

    summary: str
    options: str = ""
    """Class of its options: below ``cli.options``, or below ``jobs.requests``."""
    work: str = ""
    """Function that runs it, below the folder of its section."""
    json: bool = False
    """Whether its results can be written as JSON."""


COMMANDS = {
    "rise": TableEntry(
        "Get up from a fall by a planned motion or a policy.", "options.rise.Rise", "rise.rise"
    ),
    "play": TableEntry(
        "Play a rising motion and judge how it ends.", "options.rise.Play", "rise.play"
    ),
    "run": TableEntry(
        "Run a policy once and judge how it ends.", "options.rise.RunPolicy", "rise.run_policy"
    ),
    "plan": TableEntry("Plan a path only, without physics.", "options.plan.Plan", "plan.plan"),
    "sit": TableEntry("Sit and lie down from a stand.", "options.rise.Sit", "stand.sit"),
    "hold": TableEntry(
        "Hold a robot in its stand until a key is pressed.", "options.rise.Hold", "stand.hold"
    ),
    "prior": TableEntry(
        "Make the pose prior of styled policies.",
        "requests.learning.PriorRequest",
        "training.make_prior",
    ),
    "train": TableEntry(
        "Train a policy, or continue a training.",
        "requests.learning.TrainRequest",
        "training.train",
    ),
    "eval": TableEntry(
        "Evaluate a policy on settled falls.",
        "requests.learning.EvaluateRequest",
        "evaluate.evaluate",
        json=True,
    ),
    "export": TableEntry(
        "Export the policy of a training.", "requests.learning.ExportRequest", "training.export"
    ),
    "motions": TableEntry(
        "List, build, retarget, discover, import, record, preview or show motions."
    ),
    "motions list": TableEntry(
        "List a robot's motions.", "options.motions.ListMotions", "motions.list_motions"
    ),
    "motions build": TableEntry(
        "Build motions from keyframes.", "requests.motions.BuildRequest", "make_motions.build"
    ),
    "motions import": TableEntry(
        "Add keys from another program's file.",
        "requests.motions.ImportKeysRequest",
        "make_motions.import_motion",
    ),
    "motions record": TableEntry(
        "Record keys from a robot moved by hand.",
        "options.motions.RecordMotion",
        "hand_recording.record",
    ),
    "motions preview": TableEntry(
        "Draw the keys of a motion and play them once.",
        "requests.motions.PreviewRequest",
        "make_motions.preview",
    ),
    "motions retarget": TableEntry(
        "Transfer the keyframes of another robot.",
        "requests.motions.RetargetRequest",
        "make_motions.retarget",
    ),
    "motions discover": TableEntry(
        "Make motions from the rises of a policy.",
        "requests.motions.DiscoverRequest",
        "make_motions.discover",
    ),
    "motions show": TableEntry(
        "Draw a motion as a film strip.", "options.motions.ShowMotion", "motions.show"
    ),
    "bench": TableEntry("Run a benchmark on the twin or on the virtual bus."),
    "bench all": TableEntry(
        "Measure a robot as one page that others can repeat.",
        "requests.bench.BenchAll",
        "bench.bench_all",
        json=True,
    ),
    "bench rise": TableEntry(
        "Rise from many settled falls.", "requests.bench.BenchRise", "bench.bench", json=True
    ),
    "bench methods": TableEntry(
        "Compare plans and policies.",
        "requests.bench.BenchMethods",
        "bench.bench",
        json=True,
    ),
    "bench disturbed": TableEntry(
        "Rise in disturbed worlds.",
        "requests.bench.BenchDisturbed",
        "bench.bench",
        json=True,
    ),
    "bench scenes": TableEntry(
        "Rise in every scene.", "requests.bench.BenchScenes", "bench.bench", json=True
    ),
    "bench motions": TableEntry(
        "Play every motion disturbed.",
        "requests.bench.BenchMotions",
        "bench.bench",
        json=True,
    ),
    "bench sit": TableEntry(
        "Sit and lie down from many stands.",
        "requests.bench.BenchSit",
        "bench.bench",
        json=True,
    ),
    "bench filter": TableEntry(
        "Time the filter's physics.", "requests.bench.BenchFilter", "bench.bench", json=True
    ),
    "bench faults": TableEntry(
        "Inject faults during a rise.",
        "requests.bench.BenchFaults",
        "bench.bench",
        json=True,
    ),
    "bench kill": TableEntry(
        "Kill the program during a rise.", "requests.bench.BenchKill", "bench.bench", json=True
    ),
    "bench soak": TableEntry(
        "Rise and fall for a long time.", "requests.bench.BenchSoak", "bench.bench", json=True
    ),
    "bus": TableEntry(
        "Serve a virtual Dynamixel bus until stopped.", "options.hardware.ServeBus", "bus.serve_bus"
    ),
    "scan": TableEntry(
        "List serial ports and the devices on them.", "options.hardware.Scan", "scan.scan"
    ),
    "doctor": TableEntry(
        "Check a robot on its bus; moves nothing.", "options.hardware.Doctor", "doctor.doctor"
    ),
    "calibrate": TableEntry(
        "Measure the zeros and signs of the servos.",
        "options.hardware.Calibrate",
        "calibrate.calibrate",
    ),
    "plan-cache": TableEntry(
        "List the stored plans of rises, or remove them.",
        "options.motions.ListPlanCache",
        "plan_cache.list_or_clear",
    ),
    "preflight": TableEntry(
        "Check whether a motion may be played.",
        "requests.motions.PreflightRequest",
        "preflight.preflight",
        json=True,
    ),
    "replay": TableEntry(
        "Replay a flight log and compare.", "options.motions.ReplayOptions", "replay.replay_log"
    ),
    "style": TableEntry("List, show, edit or extract styles of rising."),
    "style list": TableEntry(
        "List the named styles.",
        "requests.style.ListStylesRequest",
        "style.list_styles",
        json=True,
    ),
    "style show": TableEntry(
        "Print and draw the curves of styles.",
        "requests.style.ShowStylesRequest",
        "style.show",
        json=True,
    ),
    "style edit": TableEntry(
        "Raise sooner or later, slower, faster, hold.",
        "requests.style.EditStyleRequest",
        "style.edit",
    ),
    "style extract": TableEntry(
        "Extract a style from a motion, a flight log or a clip.",
        "requests.style.ExtractRequest",
        "style.extract",
    ),
    "mocap": TableEntry("Import clips of motion capture."),
    "mocap import": TableEntry(
        "Make a motion of a robot from a clip.",
        "requests.motions.ClipRequest",
        "make_motions.import_clip",
        json=True,
    ),
    "scenes": TableEntry(
        "List or draw the scenes.",
        "requests.scenes.ScenesRequest",
        "scenes.list_scenes",
        json=True,
    ),
    "robots": TableEntry("List the robots, import one from a model file, check one."),
    "robots list": TableEntry(
        "List the installed robots.", "options.robots.ListRobots", "list_robots.list_robots"
    ),
    "robots import": TableEntry(
        "Make a robot folder from an MJCF or URDF file.",
        "requests.robots.ImportRequest",
        "import_robot.import_robot",
        json=True,
    ),
    "robots check": TableEntry(
        "Check a robot's description, and what its body can do.",
        "options.robots.CheckRobot",
        "check_robot.check_robot",
    ),
}
DEFAULTS = {"robots": "robots list"}
"""Default commands of groups."""
HELP, VERSION = ("-h", "--help"), "--version"


@dataclass(frozen=True)
class Invocation:
    """A command and its options."""

    name: str
    options: JobRequest

    def load(self) -> Callable[[], int]:
        """Import the function of the command, which returns the exit code."""
        with phase("loading"):
            return partial(load_work(self.name), self.options)


def parse(arguments: Sequence[str]) -> Invocation:
    """Read a command line; exit after help.

    Raises:
        BadInputError: naming every option that is unknown or missing, or whose value does not fit.
    """
    words = modernize(arguments)
    if words != list(arguments):
        print(f"getup: an old spelling, now: {shlex.join(['getup', *words])}", file=sys.stderr)
    name, rest = find_command(words)
    if name not in COMMANDS or not COMMANDS[name].options:
        return _explain(name, rest)
    with in_one_line(f"getup {name}", partial(_list_others, name)):
        options = _read(load_options(name), f"getup {name}", rest)
    options.check()
    return Invocation(name, options)


def find_command(words: Sequence[str]) -> tuple[str, Sequence[str]]:
    """Return the command or group at the beginning of words, if any, and the other words."""
    for length in (2, 1):
        if len(words) >= length and (name := " ".join(words[:length])) in COMMANDS:
            rest = words[length:]
            is_alone = not rest or (rest[0].startswith("-") and rest[0] not in HELP)
            return (DEFAULTS.get(name, name) if is_alone else name), rest
    return "", words


def _explain(group: str, rest: Sequence[str]) -> Any:
    """Print the commands of a group, or of all; or completions, or the version.

    Raises:
        BadInputError: if neither was asked for.
    """
    if any(word.startswith("--tyro-") for word in rest):
        _read(list_commands(), "getup", rest, DESCRIPTION)
    if rest and rest[0] == VERSION and not group:
        if rest[1:]:
            raise BadInputError(f"unknown argument '{rest[1]}': see getup --help")
        print(f"getup {version('humanoid-getup')}")
        raise SystemExit(0)
    if rest and rest[0] in HELP:
        print(write_help(group))
        raise SystemExit(0)
    program = f"getup {group}".rstrip()
    if not rest:
        raise BadInputError(f"expected a command first: {program} --help")
    kind = "option" if rest[0].startswith("-") else "command"
    known = [name.removeprefix(group).strip() for name in COMMANDS if name.startswith(group)]
    known += [*HELP] if group else [*HELP, VERSION]
    nearest = get_close_matches(rest[0], known, n=1)
    hint = f" expected {nearest[0]}?" if nearest else ""
    raise BadInputError(f"unknown {kind} '{rest[0]}',{hint} see {program} --help")


def write_help(group: str = "") -> str:
    """Write the commands of a group, or all in their sections, each with a summary."""
    own = [name for name in COMMANDS if name.startswith(f"{group} ")]
    sections = {"commands": own} if group else SECTIONS
    about = COMMANDS[group].summary if group else DESCRIPTION
    program = f"getup {group}".rstrip()
    width = max(
        len(name.removeprefix(f"{group} ")) for names in sections.values() for name in names
    )
    lines = [f"usage: {program} COMMAND [OPTIONS]", "", about]
    for heading, names in sections.items():
        lines += ["", heading]
        for name in names:
            default = " The default." if name in DEFAULTS.values() else ""
            lines.append(
                f"  {name.removeprefix(f'{group} '):{width}}  {COMMANDS[name].summary}{default}"
            )
    lines += ["", f"{program} COMMAND --help lists the options of a command."]
    return "\n".join(lines if group else [*lines, f"{program} {VERSION} prints the version."])


def load_options(name: str) -> type[JobRequest]:
    """Import the options of a command."""
    command = COMMANDS[name]
    package = "cli" if command.options.startswith("options.") else "jobs"
    options = _load(f"{package}.{command.options}")
    return with_json(options) if command.json else options


def _list_others(name: str, option: str) -> list[str]:
    """Name the commands of the same section that have an option."""
    group = name.split()[0]
    section = next(names for names in SECTIONS.values() if group in names)
    return [
        f"getup {other}"
        for other in COMMANDS
        if other.split()[0] in section and COMMANDS[other].options
        if option in list_options(load_options(other))
    ]


def load_work(name: str) -> Callable[[JobRequest], int]:
    """Import the function that runs a command."""
    group = name.split()[0]
    section = next(heading for heading, names in SECTIONS.items() if group in names)
    return _load(f"cli.{section.replace(' ', '_')}.{COMMANDS[name].work}")


def _load(target: str) -> Any:
    module, _, name = target.rpartition(".")
    return getattr(import_module(f"humanoid_getup.{module}"), name)


def list_commands(group: str = "") -> Any:
    """Return the commands of a group, or all of them, as a tyro union: for completions."""
    members: list[Any] = []
    for name, command in COMMANDS.items():
        parent, _, own_name = name.rpartition(" ")
        if parent != group:
            continue
        kind = load_options(name) if command.options else _load_group(name)
        members.append(Annotated[kind, subcommand(own_name, description=command.summary)])
    return Union[tuple(members)]  # noqa: UP007  (as many as there are)


def _load_group(name: str) -> Any:
    """Return the commands of a group with their options.

    A union of one type is that type, so a single command is returned without a name of its own.
    """
    members = [member for member in COMMANDS if member.startswith(f"{name} ")]
    return load_options(members[0]) if len(members) == 1 else list_commands(name)


def _read(options: Any, program: str, arguments: Sequence[str], about: str | None = None) -> Any:
    return tyro.cli(
        options,
        prog=program,
        description=about,
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
        registry=registry,
    )
