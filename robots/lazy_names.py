"""Names of a package that are imported when they are first used, as its stub lists them."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any


def attach_stub(
    package: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return ``__getattr__``, ``__dir__`` and ``__all__`` of a package with a .pyi beside its file.

    Each line of the stub is one import: ``from module import name as name``.
    """
    lines = Path(file).with_suffix(".pyi").read_text("utf-8").splitlines()
    homes = {words[-1]: words[1] for words in map(str.split, lines) if words[:1] == ["from"]}

    def load(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(homes[name]), name)
        setattr(sys.modules[package], name, value)
        return value

    return load, lambda: sorted({*vars(sys.modules[package]), *homes}), sorted(homes)
