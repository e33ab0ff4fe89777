"""`getup scenes`: list the scenes, and draw where robots lie in them."""

from __future__ import annotations

from collections.abc import Sequence

from humanoid_getup.cli.shared.console import console_for, make_table, showing
from humanoid_getup.cli.shared.exit_codes import DID_IT
from humanoid_getup.cli.shared.output import find_json_target, write_json
from humanoid_getup.experiments.starts.falls import CLASSES
from humanoid_getup.jobs.requests.scenes import ScenesRequest
from humanoid_getup.jobs.show_scenes import DescribedScene, show_scenes


def list_scenes(command: ScenesRequest) -> int:
    """Print a table or JSON of the scenes, and draw one or all if a picture is requested."""
    with showing(command) as report:
        found = show_scenes(command, report)
    write_json(found, command)
    if find_json_target(command) is None:
        _print(found.scenes)
    return DID_IT


def _print(rows: Sequence[DescribedScene]) -> None:
    texts = ("scene", "starts", "about")
    table = make_table((*texts, "obstacles", "friction"), left=texts)
    for row in rows:
        starts = "any" if row.starts == tuple(CLASSES) else ", ".join(row.starts)
        table.add_row(row.name, starts, row.about, str(row.obstacles), f"{row.friction:g}")
    console_for().print(table)
