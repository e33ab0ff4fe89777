"""The commands of `getup`: only the modules of the chosen command are imported."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from importlib.metadata import version
from typing import Annotated, Any, Union

import tyro
from tyro.conf import subcommand

from humanoid_getup.commands.command import load_command
from humanoid_getup.commands.command_table import COMMANDS, DEFAULTS, SECTIONS
from humanoid_getup.commands.console import phase
from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.options import CommandRequest
from humanoid_getup.commands.parsing import in_one_line, registry
from humanoid_getup.commands.values import list_options

DESCRIPTION = "Get a fallen humanoid up: plan, filter through physics, play, judge."

HELP, VERSION = ("-h", "--help"), "--version"


@dataclass(frozen=True)
class Invocation:
    """A command and its options."""

    name: str
    options: CommandRequest

    def load(self) -> Callable[[], int]:
        """Import the function of the command, which returns the exit code."""
        with phase("loading"):
            return partial(load_command(self.name).run, self.options)


def parse(arguments: Sequence[str]) -> Invocation:
    """Read a command line; exit after help."""
    name, rest = find_command(arguments)
    if name not in COMMANDS or not is_command(name):
        return _explain(name, rest)
    with in_one_line(f"getup {name}", partial(_list_others, name)):
        options = _read(load_command(name).options, f"getup {name}", rest)
    options.check()
    return Invocation(name, options)


def is_command(name: str) -> bool:
    """Return whether a name is that of a command, not of a group."""
    return bool(COMMANDS[name].module)


def find_command(words: Sequence[str]) -> tuple[str, Sequence[str]]:
    """Return the command or group at the beginning of words, if any, and the other words."""
    for length in (2, 1):
        if len(words) >= length and (name := " ".join(words[:length])) in COMMANDS:
            rest = words[length:]
            is_alone = not rest or (rest[0].startswith("-") and rest[0] not in HELP)
            return (DEFAULTS.get(name, name) if is_alone else name), rest
    return "", words


def _explain(group: str, rest: Sequence[str]) -> Any:
    """Print the commands of a group, or of all; or completions, or the version."""
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


def _list_others(name: str, option: str) -> list[str]:
    """Name the commands of the same section that have an option, or else those of another one."""
    group = name.split()[0]
    for section in sorted(SECTIONS.values(), key=lambda names: group not in names):
        commands = [
            other for other in COMMANDS if other.split()[0] in section and is_command(other)
        ]
        if found := [
            f"getup {other}"
            for other in commands
            if option in list_options(load_command(other).options)
        ]:
            return found
    return []


def list_commands(group: str = "") -> Any:
    """Return the commands of a group, or all of them, as a tyro union: for completions."""
    members: list[Any] = []
    for name, command in COMMANDS.items():
        parent, _, own_name = name.rpartition(" ")
        if parent != group:
            continue
        kind = load_command(name).options if is_command(name) else _load_group(name)
        members.append(Annotated[kind, subcommand(own_name, description=command.summary)])
    return Union[tuple(members)]  # noqa: UP007  (as many as there are)


def _load_group(name: str) -> Any:
    """Return the commands of a group with their options."""
    members = [member for member in COMMANDS if member.startswith(f"{name} ")]
    return load_command(members[0]).options if len(members) == 1 else list_commands(name)


def _read(options: Any, program: str, arguments: Sequence[str], about: str | None = None) -> Any:
    return tyro.cli(
        options,
        prog=program,
        description=about,
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
        registry=registry,
    )
