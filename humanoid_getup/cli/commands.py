"""The commands of `getup`. Only the module of the chosen command is imported."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Annotated, Any, Protocol, Union

import tyro
from tyro.conf import subcommand

from humanoid_getup.cli.checks import find_value_faults, registry
from humanoid_getup.cli.errors import BadInputError

DESCRIPTION = "Get a fallen humanoid up: plan, filter through physics, play, judge."

COMMANDS: dict[str, tuple[str, str]] = {
    "rise": ("rise.RiseCommand", "Get up from a fall by a planned motion or a policy."),
    "play": ("play.Play", "Play a rising motion and judge how it ends."),
    "run": ("rise.RunPolicy", "Run a trained policy once, supervised, and judge how it ends."),
    "train": ("train.Train", "Train a get-up policy, or continue a training."),
    "eval": ("evaluate.EvalPolicy", "Evaluate a policy on settled falls, by start class."),
    "export": ("export.Export", "Export the policy of a training to one ONNX file."),
    "motions": ("", "List, build, show or play rising motions."),
    "motions list": ("motions.ListMotions", "List a robot's rising motions."),
    "motions build": ("motions.BuildMotions", "Build rising motions from keyframes."),
    "motions show": ("motions.ShowMotion", "Draw a rising motion as a film strip."),
    "motions play": ("play.Play", "Play a rising motion and judge how it ends."),
    "bench": ("", "Run a benchmark on the twin or on the virtual bus."),
    "bench rise": ("bench.BenchRise", "Rise from many settled falls."),
    "bench methods": ("bench.BenchMethods", "Compare plans and policies on the same falls."),
    "bench motions": ("bench.BenchMotions", "Play every stored motion under disturbances."),
    "bench filter": ("bench.BenchFilter", "Compare the speed of the filter with bare physics."),
    "bench faults": ("bench.BenchFaults", "Inject faults in the middle of a rise."),
    "bench kill": ("bench.BenchKill", "Kill the program in the middle of a rise."),
    "bench soak": ("bench.BenchSoak", "Rise, sit, tumble and rise again for a long time."),
    "bus": ("bus.ServeBus", "Serve a virtual Dynamixel bus until stopped."),
    "scan": ("scan.Scan", "List serial ports and the devices that answer on them."),
    "doctor": ("doctor.Doctor", "Check a robot on its bus before first torque; moves nothing."),
    "calibrate": ("calibrate.Calibrate", "Measure the zeros and signs of the servos."),
    "preflight": ("preflight.Preflight", "Judge whether a motion may be played."),
    "replay": ("replay.Replay", "Replay a flight log on the twin and compare."),
    "robots": ("robots.ListRobots", "List the robots that come with the program."),
}
"""Name: module and class, empty for a group of commands; summary."""


class Command(Protocol):
    """One command with its options."""

    def run(self) -> int:
        """Run it; return the exit code."""
        ...


@dataclass(frozen=True)
class _Unread:
    """A command that is only listed."""


def parse(arguments: Sequence[str]) -> Command:
    """Read a command line; exit with code 2 where tyro cannot read it.

    Raises:
        BadInputError: naming every option whose value does not fit.
    """
    for length in (2, 1):
        name = " ".join(arguments[:length])
        if COMMANDS.get(name, ("", ""))[0]:
            command = _read(load_command(name), f"getup {name}", arguments[length:])
            if faults := find_value_faults(command):
                raise BadInputError("; ".join(faults))
            return command
    completes = any(argument.startswith("--tyro-") for argument in arguments)
    group = arguments[0] if arguments and arguments[0] in COMMANDS else ""
    description = COMMANDS[group][1] if group else DESCRIPTION
    listed = list_commands(group, load=completes)
    _read(listed, f"getup {group}".rstrip(), arguments[bool(group) :], description)
    raise BadInputError("expected a command first: getup --help")


def load_command(name: str) -> Any:
    """Import the options of a command."""
    module, options = COMMANDS[name][0].split(".")
    return getattr(import_module(f"humanoid_getup.cli.{module}"), options)


def list_commands(group: str = "", *, load: bool = False) -> Any:
    """Return the commands of a group, or all groups and single commands, as a tyro union."""
    members: list[Any] = []
    for name, (target, summary) in COMMANDS.items():
        parent, _, own_name = name.rpartition(" ")
        if parent != group:
            continue
        if load:
            kind = load_command(name) if target else list_commands(name, load=True)
        else:
            kind = _Unread
        members.append(Annotated[kind, subcommand(own_name, description=summary)])
    return Union[tuple(members)]  # noqa: UP007  (as many as there are)


def _read(options: Any, program: str, arguments: Sequence[str], about: str | None = None) -> Any:
    return tyro.cli(
        options,
        prog=program,
        description=about,
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
        registry=registry,
    )
