"""Plain text in markdown: what a file, a log or an error says is shown, never interpreted."""

from __future__ import annotations

import html
import re
from collections.abc import Sequence

MARKUP = re.compile(r"[!-/:-@\[-`{-~]")
"""Punctuation, of which any may mean something to markdown or HTML."""


def escape(text: str) -> str:
    """Return the markdown that shows a text as it is, in one line.

    The page renders HTML within markdown, and embeds pictures that markdown names from the disk.
    """
    return MARKUP.sub(r"\\\g<0>", " ".join(text.split()))


def make_block(text: str) -> str:
    """Return the markdown that shows a text as a block of code."""
    shown = html.escape(text).replace("!", "&#33;").replace("\n", "&#10;")
    return f"<pre><code>{shown}</code></pre>"


def make_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return the markdown of a table; numbers, in all columns but the first, are to the right."""
    rule = ["---", *["--:"] * (len(headings) - 1)]
    lines = [map(escape, headings), rule, *(map(escape, row) for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)
