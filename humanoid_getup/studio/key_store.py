"""Key store: keyframes files from which motions are opened, and in which they are stored."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.commands.files import shorten_path
from humanoid_getup.commands.inputs import find_keyframes
from humanoid_getup.commands.motions.build_motions import BuildRequest
from humanoid_getup.commands.motions.import_keys import AddedKeys, ImportKeysRequest, import_keys
from humanoid_getup.commands.motions.preview_motion import PreviewRequest
from humanoid_getup.commands.options import write_command
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KEYFRAMES
from humanoid_getup.studio.edit_keys import store_keyframes
from humanoid_getup.studio.page import Page
from humanoid_getup.studio.plain_text import make_block

MOST_UNDONE = 100
"""Number of states that are kept."""
OWN: str = "the robot"
"""Source of the robot's own keyframes."""
SUFFIX = ".toml"
NO_MOTION: str = "none"
KINDS = "A .csv table, a .json animation or a .bin action file; pickles are not opened."
CLIP = "Angles outside a joint's range become its end, instead of being refused."


class KeyDraft:
    """One motion at a time; every change can be undone."""

    def __init__(self) -> None:
        self._states: list[Keyframes] = []
        self.when_changed: list[Callable[[Keyframes], None]] = []
        """Called after every change."""

    @property
    def keyframes(self) -> Keyframes:
        """Return the motion."""
        if not self._states:
            raise ValueError("no motion yet, expected one that was opened, or New")
        return self._states[-1]

    def put(self, keyframes: Keyframes) -> None:
        """Replace the motion by another state of it, or by another motion."""
        self._states = [*self._states, keyframes][-MOST_UNDONE:]
        self._tell()

    def undo(self) -> None:
        """Return to the state before."""
        if len(self._states) < 2:
            raise ValueError("nothing to undo")
        self._states.pop()
        self._tell()

    def _tell(self) -> None:
        for update in self.when_changed:
            update(self.keyframes)


class KeyStore:
    """Elements that open, store and import motions."""

    def __init__(self, page: Page, draft: KeyDraft, opened: Callable[[Keyframes], None]) -> None:
        """Add the elements that open motions, for which ``opened`` is called then."""
        self._page, self._draft, self._opened = page, draft, opened
        self._stored: Keyframes | None = None
        self._file: Path | None = None  # in which it is stored; None for the robot's own
        gui = page.gui
        with gui.add_folder("Open"):
            self._source = gui.add_dropdown("From", (OWN,))
            self._name = gui.add_dropdown("Motion", (NO_MOTION,))
            page.add_button("Open", self._open)
        self._source.on_update(page.answer(self._list_motions))
        self._list_files()
        page.answer(self._list_motions)(None)

    def add_storing(self) -> None:
        """Add the elements that store the motion."""
        gui = self._page.gui
        self._target = gui.add_text("Keyframes file", KEYFRAMES)
        self._page.add_button("Store", self._store)
        self._command = gui.add_markdown("")
        self._draft.when_changed.append(lambda _: self._show_command())
        self._show_command()

    def add_import(self) -> None:
        """Add the elements that import another program's keys."""
        gui = self._page.gui
        self._foreign = gui.add_text("Key file", "", hint=KINDS)
        self._pages = gui.add_text("Pages", "", hint="Of an action file, such as 1,2.")
        self._clip = gui.add_checkbox("Limit angles", False, hint=CLIP)
        self._page.add_button("Import", self._import)

    # Open -------------------------------------------------------------------------------------

    def _list_files(self) -> None:
        self._source.options = (OWN, *self._page.folders.list_files(SUFFIX))

    def _list_motions(self) -> None:
        self._name.options = (NO_MOTION,)
        if self._source.value == OWN and not (self._page.world.robot.folder / KEYFRAMES).exists():
            return
        names = tuple(keyframes.name for keyframes in self._load())
        self._name.options = names or (NO_MOTION,)

    def _load(self, *names: str) -> list[Keyframes]:
        return find_keyframes(self._page.world.robot, names, self._find_source())

    def _find_source(self) -> Path | None:
        source = self._source.value
        return None if source == OWN else self._page.folders.resolve(source)

    def _open(self) -> None:
        (keyframes,) = self._load(self._name.value)
        self._stored, self._file = keyframes, self._find_source()
        self._opened(keyframes)
        self._page.say(f"Opened {keyframes.name} of {self._source.value}.")

    # Store ------------------------------------------------------------------------------------

    def _store(self) -> None:
        keyframes, path = self._draft.keyframes, self._find_target()
        store_keyframes(path, keyframes, self._page.world.robot)
        self._stored, self._file = keyframes, path
        self._list_files()
        self._show_command()
        self._page.say(f"Stored {keyframes.name} in {self._page.folders.name(path)}.")

    def _find_target(self) -> Path:
        path = self._page.folders.resolve(self._target.value)
        if path.suffix != SUFFIX:
            raise BadInputError(
                f"keyframes file {path.name}: expected a name that ends with {SUFFIX}"
            )
        return path

    def _show_command(self) -> None:
        """Show the commands that play and build the motion as it is stored."""
        lines = self._write_commands()
        text = make_block("\n".join(lines)) if lines else "A command plays stored keys."
        self._command.content = text

    def _write_commands(self) -> list[str]:
        if self._stored is None or self._draft.keyframes is not self._stored:
            return []
        name, robot, own = self._stored.name, self._page.request.robot, self._is_own
        file = None if own or self._file is None else shorten_path(self._file)
        preview = PreviewRequest(name=name, robot=robot, keyframes=file)
        lines = [write_command("motions preview", preview)]
        if own:
            lines.append(write_command("motions build", BuildRequest(names=(name,), robot=robot)))
        return lines

    @property
    def _is_own(self) -> bool:
        """Return whether the motion is stored among the robot's own."""
        own = (self._page.world.robot.folder / KEYFRAMES).resolve()
        return self._file is None or self._file == own

    # Import -----------------------------------------------------------------------------------

    def _import(self) -> None:
        request = ImportKeysRequest(
            robot=self._page.request.robot,
            file=self._page.folders.resolve(self._foreign.value),
            page=parse_pages(self._pages.value),
            clip=self._clip.value,
            out=self._find_target(),
        )
        self._page.say(f"Keys of {request.file.name} are imported …")
        self._page.run(import_keys, request, self._show_added)

    def _show_added(self, added: AddedKeys) -> None:
        """Open the first motion that was added, and tell how each ends."""
        robot, trials = self._page.world.robot, added.trials
        (keyframes,) = find_keyframes(robot, [trials[0].keyframes.name], added.file)
        self._stored, self._file = keyframes, added.file
        self._list_files()
        self._opened(keyframes)
        told = [f"{trial.keyframes.name} {trial.describe()}" for trial in trials]
        notes = [note for imported in added.imported for note in imported.notes]
        self._page.say(f"Imported: {'; '.join([*told, *notes])}.")


def parse_pages(text: str) -> tuple[int, ...]:
    """Parse the numbers of pages, divided by commas."""
    try:
        return tuple(int(word) for word in text.split(",")) if text.strip() else ()
    except ValueError as error:
        raise BadInputError(f"pages: {text!r}, expected numbers such as 1,2") from error
