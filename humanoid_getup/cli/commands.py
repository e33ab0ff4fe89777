"""The commands of `getup`: only the modules of the chosen command are imported."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import Annotated, Any, Union

import tyro
from tyro.conf import subcommand

from humanoid_getup.cli.checks import find_value_faults, registry
from humanoid_getup.cli.errors import BadInputError
from humanoid_getup.cli.old_spellings import modernize
from humanoid_getup.cli.options.shared import CommandOptions
from humanoid_getup.cli.output import phase

DESCRIPTION = "Get a fallen humanoid up: plan, filter through physics, play, judge."

SECTIONS = {
    "get up": ("rise", "play", "run", "sit", "hold"),
    "plan and check": ("plan", "preflight", "motions", "mocap", "scenes", "style", "plan-cache"),
    "learn": ("train", "eval", "export", "prior"),
    "robot": ("robots", "scan", "doctor", "calibrate", "bus"),
    "look": ("replay", "bench"),
}
"""Commands in the order of `getup --help`."""

COMMANDS: dict[str, tuple[str, str, str]] = {
    "rise": ("rise.Rise", "rise.rise", "Get up from a fall by a planned motion or a policy."),
    "play": ("rise.Play", "rise.play", "Play a rising motion and judge how it ends."),
    "run": ("rise.RunPolicy", "rise.run_policy", "Run a policy once and judge how it ends."),
    "plan": ("plan.Plan", "plan.plan", "Plan a path only, without physics."),
    "sit": ("stand.Sit", "stand.sit", "Sit and lie down from a stand."),
    "hold": ("stand.Hold", "stand.hold", "Hold a robot in its stand until a key is pressed."),
    "prior": ("prior.MakePrior", "prior.make_prior", "Make the pose prior of styled policies."),
    "train": ("policies.Train", "train.train", "Train a policy, or continue a training."),
    "eval": ("policies.Evaluate", "evaluate.evaluate", "Evaluate a policy on settled falls."),
    "export": ("policies.Export", "export.export", "Export the policy of a training."),
    "motions": (
        "",
        "",
        "List, build, retarget, discover, import, record, preview or show motions.",
    ),
    "motions list": ("motions.ListMotions", "motions.list_motions", "List a robot's motions."),
    "motions build": ("motions.BuildMotions", "building.build", "Build motions from keyframes."),
    "motions import": (
        "own_motions.ImportMotion",
        "importing.import_motion",
        "Add keys from another program's file.",
    ),
    "motions record": (
        "own_motions.RecordMotion",
        "hand_recording.record",
        "Record keys from a robot moved by hand.",
    ),
    "motions preview": (
        "own_motions.PreviewMotion",
        "previewing.preview",
        "Draw the keys of a motion and play them once.",
    ),
    "motions retarget": (
        "motions.RetargetMotions",
        "retarget.retarget",
        "Take the keyframes of another robot.",
    ),
    "motions discover": (
        "discover.DiscoverMotions",
        "discover.discover",
        "Make motions from the rises of a policy.",
    ),
    "motions show": ("motions.ShowMotion", "motions.show", "Draw a motion as a film strip."),
    "bench": ("", "", "Run a benchmark on the twin or on the virtual bus."),
    "bench all": (
        "bench.BenchAll",
        "bench_all.bench_all",
        "Measure a robot as one page that others can repeat.",
    ),
    "bench rise": ("bench.BenchRise", "bench.bench_rise", "Rise from many settled falls."),
    "bench methods": ("bench.BenchMethods", "bench.bench_methods", "Compare plans and policies."),
    "bench disturbed": (
        "bench.BenchDisturbed",
        "bench.bench_disturbed",
        "Rise in disturbed worlds.",
    ),
    "bench scenes": ("bench.BenchScenes", "bench.bench_scenes", "Rise in every scene."),
    "bench motions": ("bench.BenchMotions", "bench.bench_motions", "Play every motion disturbed."),
    "bench sit": ("bench.BenchSit", "bench.bench_sit", "Sit and lie down from many stands."),
    "bench filter": ("bench.BenchFilter", "bench.bench_filter", "Time the filter's physics."),
    "bench faults": ("bench.BenchFaults", "bench.bench_faults", "Inject faults during a rise."),
    "bench kill": ("bench.BenchKill", "bench.bench_kill", "Kill the program during a rise."),
    "bench soak": ("bench.BenchSoak", "bench.bench_soak", "Rise and fall for a long time."),
    "bus": ("hardware.ServeBus", "bus.serve_bus", "Serve a virtual Dynamixel bus until stopped."),
    "scan": ("hardware.Scan", "scan.scan", "List serial ports and the devices on them."),
    "doctor": ("hardware.Doctor", "doctor.doctor", "Check a robot on its bus; moves nothing."),
    "calibrate": (
        "hardware.Calibrate",
        "calibrate.calibrate",
        "Measure the zeros and signs of the servos.",
    ),
    "plan-cache": (
        "motions.ListPlanCache",
        "plan_cache.list_or_clear",
        "List the solved rises that are kept, or remove them.",
    ),
    "preflight": ("motions.Preflight", "preflight.preflight", "Judge if a motion may be played."),
    "replay": ("motions.Replay", "replay.replay_log", "Replay a flight log and compare."),
    "style": ("", "", "List, show, edit or extract styles of rising."),
    "style list": ("style.ListStyles", "style.list_styles", "List the named styles."),
    "style show": ("style.ShowStyles", "style.show", "Print and draw the curves of styles."),
    "style edit": ("style.EditStyle", "style.edit", "Raise sooner or later, slower, faster, hold."),
    "style extract": (
        "style.ExtractStyle",
        "style.extract",
        "Extract a style from a motion, a flight log or a clip.",
    ),
    "mocap": ("", "", "Import clips of motion capture."),
    "mocap import": (
        "mocap.ImportClip",
        "mocap.import_clip",
        "Make a motion of a robot from a clip.",
    ),
    "scenes": ("motions.ListScenes", "scenes.list_scenes", "List or draw the scenes."),
    "robots": ("", "", "List the robots, import one from a model file, check one."),
    "robots list": ("motions.ListRobots", "robots.list_robots", "List the installed robots."),
    "robots import": (
        "robots.ImportRobot",
        "import_robot.import_robot",
        "Make a robot folder from an MJCF or URDF file.",
    ),
    "robots check": (
        "robots.CheckRobot",
        "check_robot.check_robot",
        "Check a robot's description, and what its body can do.",
    ),
}
"""Name: options, the function that runs them, summary. A group of commands has only a summary."""


DEFAULTS = {"robots": "robots list"}
"""Commands that a group stands for when none of its own is named."""
HELP = ("-h", "--help")


@dataclass(frozen=True)
class Invocation:
    """A command and its options."""

    name: str
    options: CommandOptions

    def run(self) -> int:
        """Import the function of the command, call it, and return the exit code."""
        with phase("loading"):
            work = _load("humanoid_getup.cli", COMMANDS[self.name][1])
        return work(self.options)


def parse(arguments: Sequence[str]) -> Invocation:
    """Read a command line; exit where tyro cannot read it (code 2), or after help.

    Raises:
        BadInputError: naming every option whose value does not fit.
    """
    words = modernize(arguments)
    if words != list(arguments):
        print(f"getup: an old spelling, now: {shlex.join(['getup', *words])}", file=sys.stderr)
    name, rest = find_command(words)
    if not COMMANDS.get(name, ("", ""))[0]:
        return _explain(name, rest)
    options = _read(load_options(name), f"getup {name}", rest)
    if faults := find_value_faults(options) or options.find_faults():
        raise BadInputError("; ".join(faults))
    return Invocation(name, options)


def find_command(words: Sequence[str]) -> tuple[str, Sequence[str]]:
    """Return the command or group that words begin with, none for no such one; and the rest."""
    for length in (2, 1):
        if len(words) >= length and (name := " ".join(words[:length])) in COMMANDS:
            rest = words[length:]
            is_alone = not rest or (rest[0].startswith("-") and rest[0] not in HELP)
            return (DEFAULTS.get(name, name) if is_alone else name), rest
    return "", words


def _explain(group: str, rest: Sequence[str]) -> Any:
    """Print the commands of a group, or of all; or completions.

    Raises:
        BadInputError: if neither was asked for.
    """
    if any(word.startswith("--tyro-") for word in rest):
        _read(list_commands(), "getup", rest, DESCRIPTION)
    if rest and rest[0] in HELP:
        print(write_help(group))
        raise SystemExit(0)
    program = f"getup {group}".rstrip()
    if not rest:
        raise BadInputError(f"expected a command first: {program} --help")
    known = [name.removeprefix(group).strip() for name in COMMANDS if name.startswith(group)]
    nearest = get_close_matches(rest[0], known, n=1)
    hint = f" expected {nearest[0]}?" if nearest else ""
    raise BadInputError(f"unknown command '{rest[0]}',{hint} see {program} --help")


def write_help(group: str = "") -> str:
    """Write the commands of a group, or all in their sections, each with a summary."""
    own = [name for name in COMMANDS if name.startswith(f"{group} ")]
    sections = {"commands": own} if group else SECTIONS
    about = COMMANDS[group][-1] if group else DESCRIPTION
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
                f"  {name.removeprefix(f'{group} '):{width}}  {COMMANDS[name][-1]}{default}"
            )
    return "\n".join([*lines, "", f"{program} COMMAND --help lists the options of a command."])


def load_options(name: str) -> Any:
    """Import the options of a command."""
    return _load("humanoid_getup.cli.options", COMMANDS[name][0])


def _load(package: str, target: str) -> Any:
    module, name = target.split(".")
    return getattr(import_module(f"{package}.{module}"), name)


def list_commands(group: str = "") -> Any:
    """Return the commands of a group, or all of them, as a tyro union: for completions."""
    members: list[Any] = []
    for name, (target, _, summary) in COMMANDS.items():
        parent, _, own_name = name.rpartition(" ")
        if parent != group:
            continue
        kind = load_options(name) if target else _load_group(name)
        members.append(Annotated[kind, subcommand(own_name, description=summary)])
    return Union[tuple(members)]  # noqa: UP007  (as many as there are)


def _load_group(name: str) -> Any:
    """Return the commands of a group with their options.

    A union of one would be that one, and bear two names: a single command is taken without its own.
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
