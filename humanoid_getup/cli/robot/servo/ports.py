"""`getup servo find-port`: the port of an adapter, found by unplugging it."""

from __future__ import annotations

from drivers.service.servos.port_finder import PortFinder
from humanoid_getup.cli.options.servo import FindPort
from humanoid_getup.cli.shared.console import console_for
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.cli.shared.output import write_json
from humanoid_getup.cli.shared.prompt import open_prompt
from humanoid_getup.jobs.errors import BadInputError


def find_port(command: FindPort) -> int:
    """Find the port of an adapter while a person unplugs it."""
    console = console_for(command)
    prompt = open_prompt(console, "the input ended before the adapter was unplugged")
    if prompt is None:
        raise BadInputError("standard input is not a terminal: find-port needs a person")
    finder = PortFinder(command.among)
    prompt.tell(f"ports: {', '.join(sorted(finder.before))}")
    prompt.ask("unplug the adapter, then Enter:")
    port = finder.find()
    write_json({"port": port}, command)
    console.print(f"[bold green]{port}[/] is the adapter's port; plug it in again")
    return DID_IT
