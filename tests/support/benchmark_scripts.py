"""Loads scripts of the benchmarks folder as modules."""

import importlib.util
import sys
from types import ModuleType

import pytest
from paths import REPOSITORY


def load_script(name: str) -> ModuleType:
    """Load `benchmarks/NAME.py`, with its folder on the path while it is loaded."""
    folder = REPOSITORY / "benchmarks"
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        spec = importlib.util.spec_from_file_location(name, folder / f"{name}.py")
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # dataclasses look their module up
        spec.loader.exec_module(module)
    return module
