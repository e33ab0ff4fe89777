"""The pages of the documentation, and what tests look for in them."""

import re
from pathlib import Path

from paths import REPOSITORY

PAGES = sorted(
    [*REPOSITORY.glob("*.md"), *(REPOSITORY / "docs").rglob("*.md")],
    key=lambda page: page.as_posix(),
)
COMMAND = re.compile(r"^ *(getup (?:.*\\\n)*.+)$|`(getup [^`]+)`", re.MULTILINE)
LINK = re.compile(r"!?\[[^]]*\]\(([^)\s]+)\)")
PLACEHOLDER = re.compile(r"\b[A-Z]{3,}\b")


def name_of(page: Path) -> str:
    return page.relative_to(REPOSITORY).as_posix()


def list_commands(page: Path) -> list[str]:
    """List the `getup` lines of a page with options, but for those with PLACEHOLDERS."""
    found = [block or inline for block, inline in COMMAND.findall(page.read_text("utf-8"))]
    lines = [" ".join(line.replace("\\\n", " ").split()) for line in found]
    return [
        line
        for line in lines
        if " -" in line and " --help" not in line and not PLACEHOLDER.search(line)
    ]


def list_links(page: Path) -> list[str]:
    """List the targets of links and pictures within the repository."""
    text = re.sub(r"```.*?```", "", page.read_text("utf-8"), flags=re.DOTALL)
    return [link for link in LINK.findall(text) if "://" not in link]


def list_anchors(page: Path) -> set[str]:
    """List the anchors of a page's headings, as MkDocs and code forges make them."""
    headings = re.findall(r"^#+ (.+)$", page.read_text("utf-8"), re.MULTILINE)
    plain = (re.sub(r"[^\w\s-]", "", heading).strip().lower() for heading in headings)
    return {re.sub(r"\s", "-", heading) for heading in plain}
