"""The commands of `getup`, one a file: their options are the fields of a dataclass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Protocol

import tyro
from tyro.conf import subcommand

from humanoid_getup.cli.bench import (
    BenchFaults,
    BenchFilter,
    BenchKill,
    BenchMethods,
    BenchMotions,
    BenchRise,
    BenchSoak,
)
from humanoid_getup.cli.bus import ServeBus
from humanoid_getup.cli.calibrate import Calibrate
from humanoid_getup.cli.doctor import Doctor
from humanoid_getup.cli.evaluate import EvalPolicy
from humanoid_getup.cli.export import Export
from humanoid_getup.cli.motions import BuildMotions, ListMotions, ShowMotion
from humanoid_getup.cli.play import Play
from humanoid_getup.cli.preflight import Preflight
from humanoid_getup.cli.replay import Replay
from humanoid_getup.cli.rise import RiseCommand, RunPolicy
from humanoid_getup.cli.robots import ListRobots
from humanoid_getup.cli.scan import Scan
from humanoid_getup.cli.train import Train

MOTIONS = (
    Annotated[ListMotions, subcommand("list")]
    | Annotated[BuildMotions, subcommand("build")]
    | Annotated[ShowMotion, subcommand("show")]
    | Annotated[Play, subcommand("play")]
)
BENCHMARKS = (
    Annotated[BenchRise, subcommand("rise")]
    | Annotated[BenchMethods, subcommand("methods")]
    | Annotated[BenchMotions, subcommand("motions")]
    | Annotated[BenchFilter, subcommand("filter")]
    | Annotated[BenchFaults, subcommand("faults")]
    | Annotated[BenchKill, subcommand("kill")]
    | Annotated[BenchSoak, subcommand("soak")]
)
COMMANDS: Any = (
    Annotated[RiseCommand, subcommand("rise")]
    | Annotated[Play, subcommand("play")]
    | Annotated[RunPolicy, subcommand("run")]
    | Annotated[Train, subcommand("train")]
    | Annotated[EvalPolicy, subcommand("eval")]
    | Annotated[Export, subcommand("export")]
    | Annotated[
        MOTIONS, subcommand("motions", description="List, build, show or play rising motions.")
    ]
    | Annotated[BENCHMARKS, subcommand("bench", description="Measure: rises, faults, soak...")]
    | Annotated[ServeBus, subcommand("bus")]
    | Annotated[Scan, subcommand("scan")]
    | Annotated[Doctor, subcommand("doctor")]
    | Annotated[Calibrate, subcommand("calibrate")]
    | Annotated[Preflight, subcommand("preflight")]
    | Annotated[Replay, subcommand("replay")]
    | Annotated[ListRobots, subcommand("robots")]
)


class Command(Protocol):
    """One command with its options."""

    def run(self) -> int:
        """Do it; return the exit code."""
        ...


def parse(arguments: Sequence[str] | None) -> Command:
    """Read a command line; leave the program with code 2 where it cannot be read."""
    return tyro.cli(
        COMMANDS,
        prog="getup",
        description="Get a fallen humanoid up: plan, filter through physics, play, judge.",
        args=arguments,
        config=(tyro.conf.OmitSubcommandPrefixes, tyro.conf.OmitArgPrefixes),
    )
