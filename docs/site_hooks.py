"""What the documentation generates: the API reference, the options of each command, links.

MkDocs calls these functions by their names (`hooks` in mkdocs.yml).
"""

import contextlib
import io
import os
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

REPOSITORY = Path(__file__).parent.parent
PACKAGES = ("humanoid_getup", "drivers", "robots", "sim2real")
API = "reference/api"
OPTIONS = re.compile(r"^<!-- options: (.+) -->$", re.MULTILINE)
LINK = re.compile(r"\[([^]]+)\]\(((?:\.\./)+[^)#]+)\)")


def list_folders() -> dict[str, list[str]]:
    """List the modules of every folder that has some, by the folder's dotted name."""
    folders: dict[str, list[str]] = {}
    for package in PACKAGES:
        for file in sorted((REPOSITORY / package).rglob("*.py")):
            *folder, name = file.relative_to(REPOSITORY).with_suffix("").parts
            if name != "__init__":
                folders.setdefault(".".join(folder), []).append(".".join((*folder, name)))
    return folders


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the generated pages to the navigation."""
    assert isinstance(config.nav, list)
    reference = next(entry["Reference"] for entry in config.nav if "Reference" in entry)
    reference.append({"Python API": [{f: f"{API}/{f}.md"} for f in list_folders()]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Generate one page of the API reference for each folder."""
    for folder, modules in list_folders().items():
        lines = [f"# {folder}", "", *(f"::: {module}\n" for module in modules)]
        files.append(File.generated(config, f"{API}/{folder}.md", content="\n".join(lines)))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, **_: Files) -> str:
    """Insert the options of commands; show links into the repository as paths."""

    def show_path(link: re.Match[str]) -> str:
        target = (Path(config.docs_dir) / page.file.src_uri).parent / link[2]
        target = Path(os.path.normpath(target))
        if target.is_relative_to(config.docs_dir):
            return link[0]
        if not target.exists():
            raise PluginError(f"{page.file.src_uri}: {link[2]} does not exist")
        return f"{link[1]} (`{target.relative_to(REPOSITORY)}`)"

    markdown = OPTIONS.sub(lambda match: f"```\n{read_options(match[1])}\n```", markdown)
    return LINK.sub(show_path, markdown)


def read_options(command: str) -> str:
    """Return what `getup COMMAND --help` prints, without the frames around it."""
    from humanoid_getup.cli.commands import parse

    text = io.StringIO()
    os.environ["COLUMNS"] = "100"
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        parse([*command.split(), "--help"])
    lines = [re.sub(r"[╭╮╰╯│─]", "", line).rstrip() for line in text.getvalue().splitlines()]
    return "\n".join(line.removeprefix(" ") for line in lines if line.strip(" -"))
