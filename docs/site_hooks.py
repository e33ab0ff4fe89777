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
INTRODUCTION = (
    "Most programs need `import humanoid_getup as hg` and the names below; "
    "[Use it as a library](../../how-to/use_as_library.md) shows how. The rest by folder:"
)
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


def list_public_names() -> list[tuple[str, str]]:
    """List what `import humanoid_getup as hg` gives, each with the module that it is from."""
    import humanoid_getup

    return [(name, getattr(humanoid_getup, name).__module__) for name in humanoid_getup.__all__]


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Add the generated pages to the navigation."""
    assert isinstance(config.nav, list)
    reference = next(entry["Reference"] for entry in config.nav if "Reference" in entry)
    pages = [{f: f"{API}/{f}.md"} for f in list_folders()]
    reference.append({"Python API": [f"{API}/index.md", *pages]})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Generate the API reference: the public names, then one page for each folder."""
    folders = list_folders()
    lines = ["# Python API", "", INTRODUCTION, ""]
    lines += [f"- [`{folder}`]({folder}.md)" for folder in folders]
    lines += ["", "## humanoid_getup", ""]
    lines += [f"- `hg.{name}`: [`{home}.{name}`][]" for name, home in list_public_names()]
    files.append(File.generated(config, f"{API}/index.md", content="\n".join(lines)))
    for folder, modules in folders.items():
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
    from humanoid_getup.commands.command_line import parse

    text = io.StringIO()
    os.environ["COLUMNS"] = "100"
    with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
        parse([*command.split(), "--help"])
    lines = [re.sub(r"[╭╮╰╯│─]", "", line).rstrip() for line in text.getvalue().splitlines()]
    return "\n".join(line.removeprefix(" ") for line in lines if line.strip(" -"))
