"""The Keyframes tab: keys are authored, mirrored, played in physics, stored and opened again."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from studio_page import StudioPage, open_studio

pytest.importorskip("viser")

from humanoid_getup.commands.errors import BadInputError
from humanoid_getup.motions.keyframes import Keyframes
from humanoid_getup.motions.keyframes_file import KEYFRAMES, load_keyframes
from humanoid_getup.studio.edit_keys import KeyEditor
from robots import Robot

if TYPE_CHECKING:
    from playwright.sync_api import Browser

ROUNDED = np.radians(0.1)  # of an angle in a file


def assert_same(found: Keyframes, expected: Keyframes) -> None:
    np.testing.assert_allclose(found.keys, expected.keys, atol=ROUNDED)
    np.testing.assert_allclose(found.duration, expected.duration, atol=1e-3)
    assert (found.name, found.start_class) == (expected.name, expected.start_class)


def add_squat(window: StudioPage, height: str) -> None:
    window.type("Height [%]", height)
    window.click("Squat")
    window.see(f"A balanced squat at {height[0]}")
    window.click("Add key")


def test_a_rise_is_authored_mirrored_played_stored_and_opened_again(
    browser: "Browser", tmp_path: Path
):
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        robot, editor = studio.page.world.robot, studio.page.tabs["Keyframes"].editor
        window.open_tab("Keyframes")
        window.type("Motion name", "up")
        window.choose("Starts", "squat")
        window.type("Height [%]", "75")
        window.click("Squat")
        window.see("A balanced squat at 7")
        window.click("New")
        window.see("up begins with the present pose.")
        add_squat(window, "90")
        window.see("up, squat to standing")
        window.type("Duration [s]", "0.7")
        window.see_value("Key", "2: 0.70 s (+0.70)")
        authored = editor.keyframes
        assert len(authored.keys) == 3
        assert authored.duration[0] == 0.7

        window.click("Play keys")
        window.see("As it should: stood after")
        take = studio.page.timeline.take
        assert take.name == "up"
        assert take.ghost.shape == take.qpos.shape
        assert [mark.text for mark in take.marks] == ["key 1", "key 2", "key 3"]

        window.click("Mirror motion")
        window.see("up_mirrored, squat to standing")
        window.type("Keyframes file", "mine.toml")
        window.click("Store")
        window.see("Stored up_mirrored in mine.toml.")
        command = f"getup motions preview up_mirrored --keyframes {tmp_path / 'mine.toml'}"
        window.see(command)
        window.click("Undo")
        window.see("up, squat to standing")
        window.click("Store")
        window.see("Stored up in mine.toml.")
        stored = load_keyframes(tmp_path / "mine.toml", robot)
        assert [each.name for each in stored] == ["up_mirrored", "up"]

        window.click("Delete")
        window.choose("From", "mine.toml")
        window.choose("Motion", "up")
        window.click("Open")
        window.see("Opened up of mine.toml.")
        assert_same(editor.keyframes, authored)
        window.take_picture(tmp_path / "keyframes.png")


def test_another_programs_keys_are_imported_and_a_pickle_is_not_opened(
    browser: "Browser", tmp_path: Path, op3: Robot
):
    knees = "time,l_knee,r_knee\n0,1.7,-1.7\n0.8,1.0,-1.0\n"
    (tmp_path / "keys.csv").write_text(knees, "utf-8")
    (tmp_path / "keys.pkl").write_bytes(b"cos\nsystem\n(S'exit 1'\ntR.")
    with open_studio(browser, folder=(tmp_path,)) as (studio, window):
        window.open_tab("Keyframes")
        window.page.get_by_text("Import", exact=True).first.click()
        window.type("Keyframes file", "mine.toml")
        window.type("Key file", "keys.pkl")
        window.click("Import")
        window.see("a file of another kind, expected an action file")
        assert not (tmp_path / "mine.toml").exists()
        window.type("Key file", "keys.csv")
        window.click("Import")
        window.see("Imported: keys")
        (stored,) = load_keyframes(tmp_path / "mine.toml", op3)
        assert_same(studio.page.tabs["Keyframes"].editor.keyframes, stored)

        own = op3.folder / KEYFRAMES
        before = own.read_bytes()
        window.type("Keyframes file", str(own))
        window.click("Store")
        window.see(f"{own}: expected a file in {tmp_path}")
        assert own.read_bytes() == before


# Laws of the edits, without the page -----------------------------------------------------------


@pytest.fixture(scope="module")
def motions(op3: Robot) -> list[Keyframes]:
    return load_keyframes(op3.folder / KEYFRAMES, op3)


def edit(robot: Robot, motion: Keyframes) -> KeyEditor:
    editor = KeyEditor(robot)
    editor.open(motion)
    return editor


places = st.integers(0, 15)


@settings(max_examples=30)
@given(place=places, key=st.integers(0, 20))
def test_a_key_that_is_inserted_and_deleted_leaves_the_others_and_two_mirrors_the_motion(
    op3: Robot, motions: list[Keyframes], place: int, key: int
):
    motion = motions[place]
    editor = edit(op3, motion)
    editor.mirror()
    editor.mirror()
    again = editor.keyframes
    np.testing.assert_array_equal(again.keys, motion.keys)
    assert (again.name, again.start_class) == (motion.name, motion.start_class)
    assert (again.end_class, *again.duration) == (motion.end_class, *motion.duration)
    after = key % editor.count
    editor.insert(after, op3.standing.joint_pos)
    longer = editor.keyframes
    assert len(longer.keys) == len(longer.duration) + 1 == len(motion.keys) + 1
    np.testing.assert_array_equal(longer.keys[after + 1], op3.standing.joint_pos)
    editor.delete(after + 1)
    shorter = editor.keyframes
    np.testing.assert_array_equal(shorter.keys, motion.keys)
    assert np.all(shorter.duration >= motion.duration)
    editor.undo()
    assert editor.keyframes is longer


def test_the_stance_at_the_end_of_a_rise_is_not_a_key_to_change(
    op3: Robot, motions: list[Keyframes]
):
    motion = motions[0]
    editor = edit(op3, motion)
    stance = editor.count
    for change in (
        lambda: editor.delete(stance),
        lambda: editor.put(stance, motion.keys[0]),
        lambda: editor.swap(stance - 1, stance),
        lambda: editor.time(0, 1.0),
        lambda: editor.time(1, 0.0),
        lambda: editor.begin("no name", "supine", "standing", motion.keys[0]),
    ):
        with pytest.raises(BadInputError, match=r"expected|duration"):
            change()
    assert editor.keyframes is motion
