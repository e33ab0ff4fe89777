"""Model files are distinguished by their root; MJCF keeps its keyframe, motors and loops."""

import re
from pathlib import Path

import pytest

from robots.model_import.importer import read_model
from robots.model_import.source import ModelImportError, ModelSource

LEGS = """<mujoco><worldbody><body name="trunk"><freejoint/><geom size="0.1"/>
<body name="a" pos="0 0 -0.2"><joint name="hip" range="-60 60"/><geom size="0.05"/>
<body name="b" pos="0 0 -0.2"><joint name="knee" range="-60 60" {knee}/><geom size="0.05"/></body>
</body></body></worldbody>{more}</mujoco>"""


def read(folder: Path, more: str = "", knee: str = "") -> ModelSource:
    path = folder / "model.xml"
    path.write_text(LEGS.format(more=more, knee=knee))
    return read_model(path)


@pytest.mark.parametrize(
    ("motor", "effort"),
    [
        ('<motor joint="hip" forcerange="-3 2"/>', 3.0),
        ('<motor joint="hip" ctrlrange="-4 4" gear="2"/>', 8.0),
        ('<position joint="hip" kp="9" gear="3" forcerange="-4 4"/>', 12.0),
        ('<general joint="hip" gear="2" gainprm="3" ctrlrange="-1 1" ctrllimited="true"/>', 6.0),
        ('<position joint="hip" kp="10" ctrlrange="-1 1"/>', None),  # a range of angles
        ('<motor joint="hip"/>', None),
    ],
)
def test_the_torque_of_a_joint_is_that_of_its_actuator(tmp_path: Path, motor: str, effort):
    source = read(tmp_path, f"<actuator>{motor}</actuator>")
    assert [*source.actuators] == ["hip"]
    assert source.actuators["hip"].effort == pytest.approx(effort)


def test_a_mesh_without_volume_does_not_refuse_a_model(tmp_path: Path):
    speck = 'vertex="0 0 0 1e-5 0 0 0 1e-5 0 0 0 1e-5"'
    path = tmp_path / "model.xml"
    path.write_text(
        LEGS.format(more=f'<asset><mesh name="speck" {speck}/></asset>', knee="").replace(
            "</body></body>", '<geom type="mesh" mesh="speck" mass="0" contype="0"/></body></body>'
        )
    )
    assert read_model(path).notes == ("meshes are treated as shells, as some have no volume",)


def test_a_hinges_point_far_off_its_body_slides_back_along_the_axis(tmp_path: Path):
    """Its place counts, for the neck and for mirror pairs; the motion is the same."""
    path = tmp_path / "model.xml"
    text = LEGS.format(more="", knee='pos="0 0 0.4" axis="0 0 1"').replace(
        '<geom size="0.05"/></body>', '<geom size="0.05" pos="0 0 -0.1"/></body>', 1
    )
    path.write_text(text)
    assert read_model(path).model.joint("knee").pos == pytest.approx([0.0, 0.0, 0.0])
    path.write_text(text.replace('pos="0 0 0.4"', 'pos="0.01 0 -0.15"'))
    assert read_model(path).model.joint("knee").pos == pytest.approx([0.01, 0.0, -0.15])


@pytest.mark.parametrize(
    ("actuator", "hinge", "expected"),
    [
        ('<position joint="knee" ctrlrange="-1 0.5"/>', "", (-1.0, 0.5)),
        ('<position joint="knee" ctrlrange="-1 0.5" gear="-2"/>', "", (-0.25, 0.5)),
        ('<position joint="knee" ctrlrange="-1 0.5" ctrllimited="false"/>', "", (-1.0, 0.5)),
        ('<position joint="knee" ctrlrange="-1 0.5"/>', 'range="-30 60"', (-0.5236, 1.0472)),
        ('<position joint="knee" ctrlrange="-3.1416 3.1416"/>', "", None),
        ('<motor joint="knee" ctrlrange="-1 0.5"/>', "", None),
    ],
)
def test_a_joint_without_range_has_that_of_its_position_actuator(
    tmp_path: Path, actuator: str, hinge: str, expected: tuple[float, float] | None
):
    path = tmp_path / "model.xml"
    text = LEGS.format(more=f"<actuator>{actuator}</actuator>", knee=hinge)
    path.write_text(text.replace('name="knee" range="-60 60"', 'name="knee"'))
    source = read_model(path)
    knee = source.model.joint("knee")
    assert bool(source.model.jnt_limited[knee.id]) == (expected is not None)
    if expected is not None:
        assert knee.range == pytest.approx(expected, abs=1e-4)
    message = ("ranges of position actuators for joints without range: knee",)
    assert source.notes == (() if hinge or expected is None else message)


def test_the_stance_is_a_keyframe_by_its_name_or_the_first(tmp_path: Path):
    keys = ""
    for name, hip in (("first", 0.1), ("Standing", 0.2)):
        keys += f'<key name="{name}" qpos="0 0 0 1 0 0 0 {hip} 0"/>'
        source = read(tmp_path, f"<keyframe>{keys}</keyframe>")
        assert source.stance == {"hip": pytest.approx(hip), "knee": 0.0}


@pytest.mark.parametrize("anchor", ["0 0 -0.4", "0.03 0.02 -0.37"])
def test_loops_name_the_bodies_that_they_join(tmp_path: Path, anchor: str):
    """The first is at the origin of the body, where MuJoCo makes no constraint of it."""
    loop = f'<equality><connect body1="trunk" body2="b" anchor="{anchor}"/></equality>'
    source = read(tmp_path, loop)
    assert [tuple(source.model.body(b).name for b in pair) for pair in source.loops] == [
        ("trunk", "b")
    ]


def test_comments_may_hold_dashes_and_lines_are_counted_with_them(tmp_path: Path):
    """As MuJoCo reads them; XML forbids two dashes."""
    path = tmp_path / "model.xml"
    comment = "<!-- hip -- knee\n -- -->\n"
    path.write_text(comment + LEGS.format(more="", knee=""))
    assert read_model(path).model.njnt == 3
    path.write_text(comment + "<mujoco><")
    with pytest.raises(ModelImportError, match="line 3, "):
        read_model(path)


XACRO = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:include filename="a"/></robot>'


def test_files_of_other_kinds_are_refused(tmp_path: Path):
    for name, content, message in (
        ("a.xacro", XACRO, "it is a xacro source, expected the URDF made of it: xacro a.xacro > "),
        ("a.XML", "<mujoco/>", "an MJCF file that ends in '.XML', expected .xml: rename it"),
    ):
        (tmp_path / name).write_text(content)
        with pytest.raises(ModelImportError, match=re.escape(f"{name}: {message}")):
            read_model(tmp_path / name)


def test_what_belongs_to_another_file_is_left_out(tmp_path: Path):
    """Sensors and contact pairs may name parts of a scene; shapes that pairs named collide."""
    more = '<contact><pair geom1="x" geom2="y"/></contact>'
    more += '<sensor><framepos objtype="site" objname="s"/></sensor>'
    geoms = '<site name="s"/><geom name="x" size="0.1" contype="0" conaffinity="0"/>'
    geoms += '<geom name="y" size="1 1 1" type="plane"/>'
    path = tmp_path / "model.xml"
    text = LEGS.format(more=more, knee="").replace("<worldbody>", f"<worldbody>{geoms}")
    path.write_text(text)
    model = read_model(path).model
    assert (model.npair, model.nsensor) == (0, 0)
    assert model.geom("x").contype == 1
