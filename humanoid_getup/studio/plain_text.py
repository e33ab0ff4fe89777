"""Plain text in markdown: what a file, a log or an error says is shown, never interpreted."""

from __future__ import annotations

import html
import re

from humanoid_getup.experiments.falls import UNCLASSED

MARKUP = re.compile(r"[!-/:-@\[-`{-~]")
"""Punctuation, of which any may mean something to markdown or HTML."""
OPTION, KEPT = re.compile(r"(?<!\S)(-\S+)"), r'<span style="white-space: nowrap">\1</span>'
"""A word that begins with a hyphen, and what keeps it in one line."""
WRAPPED = "white-space: pre-wrap; overflow-wrap: anywhere"
STATUS = (
    "box-sizing: border-box; height: 5em; overflow-y: auto; padding: 0.4em 0.9em; "
    "font-size: 0.875rem; line-height: 1.4; overflow-wrap: anywhere"
)
"""Two lines; a longer text is scrolled."""
LEGEND = (
    "display: flex; flex-wrap: wrap; justify-content: center; gap: 0 1em; "
    "padding: 0 0.9em 0.6em; font-size: 0.75rem"
)


def escape(text: str) -> str:
    """Return the markdown that shows a text as it is, in one line.

    The page renders HTML within markdown, and embeds pictures that markdown names from the disk.
    """
    return MARKUP.sub(r"\\\g<0>", " ".join(text.split()))


def make_block(text: str) -> str:
    """Return the markdown that shows a text as a block of code, whose lines are wrapped."""
    shown = OPTION.sub(KEPT, html.escape(text)).replace("!", "&#33;").replace("\n", "&#10;")
    return f'<pre><code style="{WRAPPED}">{shown}</code></pre>'


def make_status(speaker: str, text: str) -> str:
    """Return the HTML of a line of a tab, in a box whose height never changes."""
    shown = html.escape(" ".join(text.split()))
    name = f"<b>{html.escape(speaker)}:</b> " if speaker else ""
    return f'<div style="{STATUS}" title="{shown}">{name}{shown}</div>'


def make_legend(values: dict[str, str], colors: dict[str, str]) -> str:
    """Return the HTML of a plot's legend: names of curves, each with its color and its value."""
    cells = (
        f'<span style="white-space: nowrap"><span style="color: {colors[name]}">■</span> '
        f"{html.escape(name)} {html.escape(value)}</span>"
        for name, value in values.items()
    )
    return f'<div style="{LEGEND}">{" ".join(cells)}</div>'


def name_side(side: str) -> str:
    """Return the words for the side on which a robot lies; it may lie on none."""
    return "on no side" if side == UNCLASSED else side
