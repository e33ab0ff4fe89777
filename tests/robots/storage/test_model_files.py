"""What would never end or take all memory is refused before MuJoCo reads a model."""

import os
import re
import time
from pathlib import Path

import pytest
from paths import TINY

from robots import RobotError, load_robot
from robots.robot import ROBOTS_FOLDER
from robots.storage.model_files import MAX_ASSET, find_file_problems


def problems_of(folder: Path, content: str) -> str:
    path = folder / "model.xml"
    path.write_text(f"<mujoco>{content}</mujoco>", "utf-8")
    return "\n".join(find_file_problems(path))


def test_pointers_of_git_lfs_are_reported_in_one_line(tmp_path: Path):
    for name in ("a.stl", "b.stl"):
        (tmp_path / name).write_text("version https://git-lfs.github.com/spec/v1\noid x\n")
    refusal = problems_of(tmp_path, '<asset><mesh file="a.stl"/><mesh file="b.stl"/></asset>')
    assert refusal == "'a.stl' is a Git LFS pointer, expected the file itself: run `git lfs pull`"


def test_the_models_of_the_package_are_within_all_limits():
    for robot in ("human", "op3", "toddlerbot", "wolfgang"):
        assert find_file_problems(ROBOTS_FOLDER / robot / "model.xml") == [], robot


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            "<worldbody><replicate count='1000'><replicate count='1000'><site/></replicate>"
            "</replicate></worldbody>",
            "it makes 1001000 copies of parts",  # 1000 * 1000 sites and 1000 inner replicates
        ),
        ("<worldbody><replicate count='1e9'><site/></replicate></worldbody>", "1000000000 copies"),
        ("<worldbody><flexcomp count='100 100 100'/></worldbody>", "it makes 1000000 copies"),
        (f"<worldbody>{'<site/>' * 20_000}</worldbody>", "it makes 20002 parts"),
        ("<asset><hfield nrow='100000' ncol='100000'/></asset>", "<hfield> has nrow '100000'"),
        ("<sensor><user dim='2000000000'/></sensor>", "<user> has dim '2000000000'"),
        ("<size nkey='2000000000'/>", "<size> has nkey '2000000000', expected at most 1000000"),
        ("<size memory='1000T'/>", "<size> has memory '1000T', expected at most 1073741824 bytes"),
        ("<worldbody><geom pos='0 NaN 0'/></worldbody>", "<geom> has pos '0 NaN 0', expected fin"),
        ("<include file='model.xml'/>", "model.xml includes itself"),
        ("<asset><model name='m' file='model.xml'/></asset>", "model.xml includes itself"),
        ("<include file='nonsense.xml'/>", "nonsense.xml: not XML (unknown encoding: nonsense)"),
        ("<include file='pipe'/>", "pipe: it is a FIFO, expected a file"),
        ("<asset><mesh file='pipe'/></asset>", "<mesh> file 'pipe': it is a FIFO"),
        ("<asset><mesh file='/elsewhere/pipe'/></asset>", "it is a FIFO"),
        ("<asset><texture fileup='pipe'/></asset>", "<texture> file 'pipe': it is a FIFO"),
        ("<compiler meshdir='parts'/><asset><mesh file='p.stl'/></asset>", "it is a FIFO"),
        ("<asset><hfield file='huge.png'/></asset>", f"more than {MAX_ASSET} bytes"),
    ],
)
def test_a_model_beyond_a_limit_is_refused(tmp_path: Path, content: str, message: str):
    (tmp_path / "parts").mkdir()
    for name in ("pipe", "parts/p.stl"):
        os.mkfifo(tmp_path / name)
    (tmp_path / "nonsense.xml").write_bytes(b'<?xml version="1.0" encoding="nonsense"?><a/>')
    with (tmp_path / "huge.png").open("wb") as file:
        file.truncate(MAX_ASSET + 1)
    assert message in problems_of(tmp_path, content)


def test_missing_meshes_are_counted_and_the_folder_is_named(tmp_path: Path):
    for names, message in (
        ("a", "'a.stl' is not found, expected in"),
        ("abc", "'a.stl' and 2 more that it names are not found"),
    ):
        files = "".join(f"<mesh file='{name}.stl'/>" for name in names)
        found = problems_of(tmp_path, f"<compiler meshdir='parts'/><asset>{files}</asset>")
        assert message in found
        assert str(tmp_path / "parts") in found


def test_a_path_that_mujoco_cannot_open_is_refused():
    path = Path(os.fsdecode(b"/no/m\xff.xml"))
    assert find_file_problems(path) == [r"its path is '/no/m\udcff.xml', expected one in UTF-8"]


def test_a_robot_folder_is_checked_as_well(tmp_path: Path):
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "robot.toml").write_text((TINY / "robot.toml").read_text())
    text = (TINY / "model.xml").read_text()
    many = '<replicate count="1000000000"><site/></replicate></worldbody>'
    (folder / "model.xml").write_text(text.replace("</worldbody>", many))
    with pytest.raises(RobotError, match="copies of parts, expected at most 3000"):
        load_robot(folder)
    (folder / "model.xml").write_text(re.sub('mass="[^"]*"', 'mass="nan"', text, count=1))
    with pytest.raises(RobotError, match="expected finite numbers"):
        load_robot(folder)


def test_comments_without_an_end_are_read_once(tmp_path: Path):
    begin = time.process_time()
    problems_of(tmp_path, 100_000 * "<!--")
    assert time.process_time() - begin < 2.0
