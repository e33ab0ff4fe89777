"""Results of the finished parts of a benchmark, kept in files so that it can go on later."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

from humanoid_getup.benchmarks.part import Part
from humanoid_getup.benchmarks.rise import Report
from humanoid_getup.cli.output import to_json
from robots.files import write_atomically
from robots.validation import parse_file

HINT = "a run without --resume starts over"


class PartStore:
    """A folder with a JSON file for each finished part: what it depends on, and its result."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def clear(self) -> None:
        """Remove the parts of an earlier run."""
        for path in self._folder.glob("*.json"):
            path.unlink()

    def load(self, part: Part) -> dict[str, Any] | None:
        """Return the result of a part; None if it is not finished.

        Raises:
            ValueError: if the file is damaged, or that of another benchmark.
        """
        path = self.path(part.name)
        if not path.exists():
            return None
        try:
            content = parse_file(path, "JSON", json.loads)
            depends, result = _open(content)
        except ValueError as error:
            raise ValueError(f"{path}: {error} ({HINT})") from error
        now = _plain(part.depends)
        if changed := [key for key in now if depends.get(key) != now[key]]:
            listed = ", ".join(
                f"{key} ({depends.get(key)}, now {now[key]})" if _is_short(now[key]) else key
                for key in changed
            )
            raise ValueError(f"{path}: made with another {listed}, expected the same ({HINT})")
        return result

    def run(self, part: Part, report: Report) -> dict[str, Any]:
        """Run a part, and keep its result; return it as it is kept."""
        result = _plain(part.run(report))
        self._folder.mkdir(parents=True, exist_ok=True)
        content = {
            "part": part.name,
            "depends": part.depends,
            "sha256": _hash(result),
            "result": result,
        }
        write_atomically(self.path(part.name), to_json(content))
        return result

    def path(self, name: str) -> Path:
        """Return the file of a part; names that differ have files that differ."""
        short = re.sub(r"[^a-z0-9]+", "_", name.lower()).strip("_")[:60]
        digest = hashlib.sha256(name.encode("utf-8", "replace")).hexdigest()[:6]
        return self._folder / f"{short}_{digest}.json"


def _open(content: Any) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what a part's file depends on, and its result.

    Raises:
        ValueError: if it was changed.
    """
    if not isinstance(content, dict) or not isinstance(content.get("depends"), dict):
        raise ValueError("it is not a part of a benchmark, expected the key depends")
    if content.get("sha256") != _hash(content.get("result")):
        raise ValueError("its checksum differs, expected the result as it was written")
    return content["depends"], content["result"]


def _hash(result: Any) -> str:
    return hashlib.sha256(to_json(result).encode("utf-8", "replace")).hexdigest()


def _plain(value: Any) -> Any:
    """Return a value as JSON keeps it."""
    return json.loads(to_json(value))


def _is_short(value: Any) -> bool:
    """Return whether a value tells a person more than that it differs: no checksum."""
    return not isinstance(value, str) or len(value) < 32
