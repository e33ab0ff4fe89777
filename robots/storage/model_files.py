"""Checks of model files before MuJoCo reads them: their references and their size.

MuJoCo opens whatever file a model names, and makes as many parts as it says. Content that would
take unlimited time or memory, such as a billion replicates or a mesh that is a FIFO, is found here
first.
"""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from math import prod
from pathlib import Path

import mujoco

from robots.storage.files import check_file, describe, read_bounded
from robots.storage.validation import shown

MAX_MODEL = 32 * 2**20  # bytes of an XML file, and of all that it includes together
MAX_ASSET = 64 * 2**20  # bytes of a mesh or another file that a model names
MAX_ASSETS = 512 * 2**20  # bytes of all of them together
MOST_PARTS = 20_000  # elements, of which a robot of 30 joints has some hundred
MOST_COPIES = 3_000  # of them made by replicates, grids and models in models: MuJoCo is slow there
MOST_LEVELS = 20  # of files that include or attach each other
MODEL_ERRORS = (ValueError, RuntimeError, MemoryError, mujoco.FatalError)
"""Errors that MuJoCo raises for a model that it cannot read or compile."""
SIZES = {
    ("hfield", "nrow", "ncol"): 4_000_000,
    ("texture", "width", "height"): 2**26,
    ("user", "dim"): 10_000,
    ("mesh", "params"): 1_000_000,
}
"""Attributes whose product is the size of an element, and the largest product."""
MOST_OF_SIZE = 1_000_000  # what any attribute of <size> may be, but the memory
MOST_SAMPLES = 10_000  # of a delay
MAX_MEMORY = 2**30  # bytes
NUMBER = re.compile(r"[-+]?\d+(\.\d*)?(e[-+]?\d+)?", re.IGNORECASE)
MEMORY = re.compile(r"(\d+)([KMGTPE]?)", re.IGNORECASE)
COMMENT = re.compile(rb"<!--.*?(?:-->|\Z)", re.DOTALL)  # one without end is sought once
POINTER = b"version https://git-lfs.github.com/"
POINTER_PROBLEM = "is a Git LFS pointer, expected the file itself: run `git lfs pull`"
NONE = "nan"
PREFIXES = " KMGTPE"
FOLDERS = ("meshdir", "assetdir", "texturedir")


def find_file_problems(path: Path) -> list[str]:
    """Find why MuJoCo should not read a model file: what it names, and how much it would make.

    Ordinary mistakes are left to MuJoCo, whose messages are better; but for missing files, of
    which it names one, without the folder.
    """
    try:
        str(path).encode("utf-8")
    except UnicodeEncodeError:
        return [f"its path is {shown(str(path))}, expected one in UTF-8"]
    return _ModelFiles(path.parent).check(path)


def parse_xml(content: bytes) -> ET.Element:
    """Parse XML; comments may hold ``--``, as MuJoCo permits. Pointers of Git LFS are refused."""
    if content.startswith(POINTER):
        raise ValueError(f"it {POINTER_PROBLEM}")
    try:
        return ET.fromstring(COMMENT.sub(lambda found: b"\n" * found[0].count(b"\n"), content))
    except (ET.ParseError, LookupError) as error:  # the latter of an unknown encoding
        raise ValueError(f"not XML ({error})") from error


def is_pointer(path: Path) -> bool:
    """Tell whether a file is a pointer of Git LFS instead of the file itself."""
    if not path.is_file():  # a FIFO would keep a reader waiting
        return False
    with path.open("rb") as file:
        return file.read(len(POINTER)) == POINTER


class _ModelFiles:
    """A model file and all that it includes or attaches."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._bytes = 0
        self._assets: dict[Path, int] = {}
        self._counted: dict[Path, tuple[int, int]] = {}
        self._open: list[Path] = []
        self._problems: list[str] = []
        self._pointers: list[str] = []
        self._folders: dict[Path, None] = {}
        self._names: dict[str, Path] = {}

    def check(self, path: Path) -> list[str]:
        parts, copies = self._count_file(path)
        if copies > MOST_COPIES:
            self._problems.append(
                f"it makes {copies} copies of parts, expected at most {MOST_COPIES}"
            )
        elif parts > MOST_PARTS:
            self._problems.append(f"it makes {parts} parts, expected at most {MOST_PARTS}")
        if (total := sum(self._assets.values())) > MAX_ASSETS:
            self._problems.append(
                f"its meshes and images have {total} bytes, expected at most {MAX_ASSETS}"
            )
        if self._pointers:  # the first stands for all
            self._problems.append(f"{shown(self._pointers[0])} {POINTER_PROBLEM}")
        # A <compiler> counts for all that is included, so all folders are looked through.
        missing = [
            name
            for name in self._names
            if not any(place.exists() for place in _places([*self._folders], name))
        ]
        if missing:
            first, others = missing[0], len(missing) - 1
            more = f" and {others} more that it names are" if others else " is"
            self._problems.append(
                f"{shown(first)}{more} not found, expected in {self._names[first]}"
            )
        return list(dict.fromkeys(self._problems))

    def _count_file(self, path: Path) -> tuple[int, int]:
        if path in self._open or len(self._open) > MOST_LEVELS:
            self._problems.append(f"{path.name} includes itself, or too many others")
            return 0, 0
        try:
            content = read_bounded(path, MAX_MODEL - self._bytes)
            root = parse_xml(content)
        except (OSError, ValueError) as error:
            included = f"{path.name}: " if self._open else ""  # the caller names the model itself
            self._problems.append(f"{included}{describe(error)}")
            return 0, 0
        self._bytes += len(content)
        self._open.append(path)
        folders = [path.parent, self._folder]
        given = [e.get(k, "") for e in root.iter("compiler") for k in FOLDERS]
        own = [path.parent / folder for folder in given if folder]
        folders += own
        self._folders |= dict.fromkeys([*folders, *(self._folder / f for f in given if f)])
        models = {
            model.get("name", ""): self._count_all(folders, model) for model in root.iter("model")
        }
        for element in root.iter():
            self._check_sizes(element)
            self._check_numbers(element)
            self._check_assets(element, folders, (own or folders)[0])
        counts = self._count(root, folders, models)
        self._open.pop()
        return counts

    def _count_all(self, folders: list[Path], element: ET.Element) -> tuple[int, int]:
        found = next((f for f in _places(folders, element.get("file", "")) if f.exists()), None)
        if found is None:
            return 1, 0
        if found not in self._counted:
            self._counted[found] = self._count_file(found)
        return self._counted[found]

    def _count(
        self, root: ET.Element, folders: list[Path], models: dict[str, tuple[int, int]]
    ) -> tuple[int, int]:
        """Count the parts and copies that an element makes, without recursion."""
        parts, copies = 0, 0
        stack = [(root, 1)]
        while stack:
            element, times = stack.pop()
            own, copied, inside = 1, 0, times
            if element.tag == "include":
                own, copied = self._count_all(folders, element)
            elif element.tag == "attach":
                own = copied = models.get(element.get("model", ""), (1, 0))[0]
            elif element.tag == "flexcomp":
                own = copied = _multiply(element.get("count", "1"))
            elif element.tag == "replicate":
                inside *= _multiply(element.get("count", "1"))
            parts += times * own
            copies += times * own if times > 1 else copied
            stack += [(child, inside) for child in element]
        return parts, copies

    def _check_sizes(self, element: ET.Element) -> None:
        limits = {keys[1:]: most for keys, most in SIZES.items() if keys[0] == element.tag}
        limits |= {("nsample",): MOST_SAMPLES}
        if element.tag == "size":
            limits |= {(key,): MOST_OF_SIZE for key in element.attrib if key != "memory"}
            memory = MEMORY.fullmatch(element.get("memory", ""))
            power = PREFIXES.index(memory[2].upper() or " ") if memory else 0
            if memory and int(memory[1]) * 1024**power > MAX_MEMORY:
                self._problems.append(
                    f"<size> has memory {shown(memory[0])}, expected at most {MAX_MEMORY} bytes"
                )
        for keys, most in limits.items():
            amount = prod(_multiply(element.get(key, "")) for key in keys)
            if amount > most:
                given = " ".join(f"{key} {shown(element.get(key))}" for key in keys)
                self._problems.append(
                    f"<{element.tag}> has {given}, expected at most {most}"
                    + (" together" if len(keys) > 1 else "")
                )

    def _check_numbers(self, element: ET.Element) -> None:
        """Find nan, which MuJoCo treats as an attribute that is left out."""
        for key, text in element.items():
            if key != "name" and NONE in text.lower().split():
                self._problems.append(
                    f"<{element.tag}> has {key} {shown(text)}, expected finite numbers"
                )

    def _check_assets(self, element: ET.Element, folders: list[Path], expected: Path) -> None:
        if element.tag in ("include", "model"):
            return
        for name in (value for key, value in element.items() if key.startswith("file")):
            if name:
                self._names.setdefault(name, expected)
            for place in _places(folders, name):
                if not place.exists():
                    continue
                try:
                    self._assets[place.resolve()] = check_file(place, MAX_ASSET)
                    if is_pointer(place):
                        self._pointers.append(name)
                except (OSError, ValueError) as error:
                    self._problems.append(f"<{element.tag}> file {shown(name)}: {describe(error)}")


def _places(folders: list[Path], name: str) -> Iterator[Path]:
    """List where MuJoCo may look for a file of a model; it may also leave its folder out."""
    for each in (name, Path(name).name):
        yield from dict.fromkeys(folder / each for folder in folders if each)


def _multiply(numbers: str) -> int:
    """Multiply the numbers of an attribute; texts and numbers below one count as one."""
    found = (abs(float(word)) for word in numbers.split() if NUMBER.fullmatch(word))
    return prod(int(min(max(number, 1.0), 1e12)) for number in found)
