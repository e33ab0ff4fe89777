"""Folders that tests read."""

from pathlib import Path

REPOSITORY = Path(__file__).parents[2]
TINY = REPOSITORY / "tests" / "robots" / "tiny"
NODDING = REPOSITORY / "tests" / "robots" / "nodding"
SHARED = REPOSITORY.parent / "shared"
"""Facts and recordings beside a checkout; tests that read them skip where it is missing."""
