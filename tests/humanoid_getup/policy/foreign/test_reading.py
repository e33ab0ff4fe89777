"""Descriptions of other projects' policies: what is read, from where, and what is refused."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")
pytest.importorskip("yaml")

import foreign_policies as made
from foreign_policies import save_network

from humanoid_getup.policy.foreign.description import (
    ForeignFormat,
    ForeignPolicy,
    ForeignPolicyError,
    Given,
    NetworkShape,
)
from humanoid_getup.policy.foreign.reading import describe_policy, read_network
from robots.storage.yaml_text import parse_yaml


def read(folder: Path, metadata=None, config: dict[str, str] | None = None, **options):
    """Read a policy from files with these texts."""
    size = options.pop("size", sum(made.SIZES))
    file = save_network(folder / "their.onnx", made.weights(size), metadata)
    files = [folder / name for name in config or {}]
    for path, text in zip(files, (config or {}).values(), strict=True):
        path.write_text(text)
    kind = options.pop("kind", None)
    return describe_policy(read_network(file).shape, kind, files, Given(**options))


def read_deploy(folder: Path, text: str = made.DEPLOY, **options) -> ForeignPolicy:
    options = {"joints": made.MOTORS, "size": made.DEPLOY_SIZE, **options}
    return read(folder, config={"deploy.yaml": text}, **options)


def read_legged(folder: Path, text: str = made.LEGGED, **options) -> ForeignPolicy:
    config = {"tiny_config.py": text, "base_config.py": made.LEGGED_BASE}
    return read(folder, config=config, size=sum(made.SIZES) + 3, **options)


def test_five_formats_that_say_the_same_read_the_same(tmp_path: Path):
    """All five are guessed; names, postures and rates are those of one robot."""
    found = [
        read(tmp_path, made.mjlab_metadata(), rate=made.RATE),
        read(tmp_path, made.microduck_metadata()),
        read_deploy(tmp_path),
        read(tmp_path, config={"env.yaml": made.ENV}, joints=made.JOINTS),
        read_legged(tmp_path),
    ]
    assert [policy.format for policy in found] == list(ForeignFormat)
    for policy in found:
        assert policy.joints == policy.moved == made.JOINTS
        assert policy.rate == pytest.approx(made.RATE)
        np.testing.assert_allclose(policy.default_pos, made.DEFAULT)
        np.testing.assert_allclose(policy.offset, made.DEFAULT)
    gains = [policy.position_gain for policy in found if policy.position_gain is not None]
    np.testing.assert_array_equal(gains, [[2.0, 3.0, 4.0]] * 3 + [[2.0, 3.0, 2.0]])


def test_a_deploy_yaml_orders_gains_as_the_motors_and_scales_as_the_simulator(tmp_path: Path):
    """The first joint is motor 1, whose gain is 2; the first scale is its own."""
    policy = read_deploy(tmp_path)
    np.testing.assert_allclose(policy.position_gain, [2.0, 3.0, 4.0])
    np.testing.assert_allclose(policy.damping, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(policy.scale, made.SCALE)
    assert [term.history for term in policy.observation] == [3, 1, 2, 1, 1]
    assert policy.observation[2].upper == 0.01


def test_an_env_yaml_matches_joints_by_patterns(tmp_path: Path):
    policy = read(tmp_path, config={"env.yaml": made.ENV}, joints=made.JOINTS)
    np.testing.assert_allclose(policy.scale, made.SCALE)
    np.testing.assert_allclose(policy.observation[0].scale, [0.2, 0.2, 0.2])


def find_moved(folder: Path, pattern: str, joints: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Read which joints are moved by an env.yaml with a pattern for them."""
    file, old = folder / "env.yaml", "joint_names: [.*]"
    file.write_text(made.ENV.replace(old, f"joint_names: [{json.dumps(pattern)}]"))
    size = sum(made.SIZES) - len(made.JOINTS) + count
    shape = NetworkShape(metadata={}, observation=size, action=count)
    return describe_policy(shape, None, [file], Given(joints=joints)).moved


ENDLESS = ("(j+)+x", "(?:j|jj)*x", "(.*)+", "(?x)(j+) +x", "(?x)(j+)#c\n+x", "(j*){3}", "j" * 300)
ENDLESS += ("j?" * 40 + "x", ".*" * 9 + "x", "(j|j)" * 40 + "x", "(?:|)" * 40 + "x")


@pytest.mark.parametrize("pattern", ENDLESS)
def test_a_pattern_that_could_take_without_end_is_refused(tmp_path: Path, pattern: str):
    with pytest.raises(ForeignPolicyError, match=r"could take too long to match 'jj.* no repeated"):
        find_moved(tmp_path, pattern, (f"{60 * 'j'}_hip_y", *made.JOINTS[1:]), 3)


USUAL = (".*", ".*_hip_.*", "[lr].*", "(left|right)_(hip|knee)_.*", "^(?!head).*$", "(left_)?.*")
USUAL += (".*(left|right).*(hip|knee).*", "left_hip_joint|head_joint|right_hip_joint", r"\w+")


@pytest.mark.parametrize("pattern", USUAL)
def test_patterns_as_isaac_lab_has_them_are_matched(tmp_path: Path, pattern: str):
    wanted = tuple(joint for joint in made.JOINTS if re.fullmatch(pattern, joint))
    assert find_moved(tmp_path, pattern, made.JOINTS, len(wanted)) == wanted


def test_a_relative_action_of_isaac_is_added_to_the_measured_angle(tmp_path: Path):
    text = made.ENV.replace(":JointPositionAction", ":RelativeJointPositionAction")
    policy = read(tmp_path, config={"env.yaml": text}, joints=made.JOINTS)
    assert policy.mode == "offset"


def test_legged_gym_is_parsed_and_not_run(tmp_path: Path):
    """The file would remove itself."""
    policy = read_legged(tmp_path)
    assert (tmp_path / "tiny_config.py").exists()
    np.testing.assert_allclose(policy.observation[0].scale, 0.25)
    assert policy.observation[0].upper == pytest.approx(400.0)  # clipped to 100 after its scale
    assert policy.sources["joints"].startswith("assumed")


def test_scales_clips_and_history_of_mjlab_are_read_a_term(tmp_path: Path):
    metadata = made.mjlab_metadata(
        observation_terms_scale="0.25,1.000,[1.0, 2.0, 3.0],0.05,1.000",
        observation_terms_clip="[-inf, inf],[-1.0, 1.0],[-inf, inf],[-inf, inf],[-inf, inf]",
        observation_terms_history_length="0,2,0,0,0",
    )
    policy = read(tmp_path, metadata, rate=made.RATE, size=sum(made.SIZES) + 3)
    scales = [term.scale.tolist() for term in policy.observation]
    assert scales[0] == [0.25] * 3 and scales[2] == [1.0, 2.0, 3.0]
    assert policy.observation[1].upper == 1.0 and policy.observation[1].history == 2


def test_a_command_of_unknown_size_takes_what_is_left(tmp_path: Path):
    metadata = made.mjlab_metadata(observation_names="base_ang_vel,pose_command,joint_pos")
    policy = read(tmp_path, metadata, size=3 + 4 + 3)
    assert [term.size for term in policy.observation] == [3, 4, 3]


def test_every_field_names_its_source(tmp_path: Path):
    described = read(tmp_path, made.mjlab_metadata()).describe()
    sources = {field: source for field, _, source in described}
    assert sources["joints"] == "ONNX metadata joint_names"
    assert sources["rate"] == "assumed"
    assert all(sources.values())
    told = {field: source for field, _, source in read_deploy(tmp_path).describe()}
    assert told["rate"] == "deploy.yaml step_dt"


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observation_names": "base_lin_vel,joint_pos"}, "'base_lin_vel' is the linear velocity"),
        ({"observation_names": "motion_command,joint_pos"}, "'motion_command' is unknown"),
        ({"observation_names": "gait_phase,joint_pos"}, "'gait_phase' is unknown"),
        ({"joint_stiffness": "1.000,1.000,1.000"}, "1 N·m/rad for every joint.*--gain"),
        ({"default_joint_pos": "0.1,0.2"}, r"shape \(2,\), expected \(3,\)"),
        ({"default_joint_pos": "0.1,nan,0.1"}, "holds nan"),
        ({"action_scale": "much"}, "'much', expected numbers"),
        ({"observation_names": "base_ang_vel"}, r"takes 15 numbers, its terms are 3"),
        ({"observation_names": "a_command,b_command"}, "sizes of observations a_command"),
        ({"observation_terms_scale": "1.0"}, "1 values for 5 observations"),
        ({"joint_names": None}, "nothing describes it"),
    ],
)
def test_metadata_that_cannot_be_run_is_refused(tmp_path: Path, changes, message: str):
    with pytest.raises(ForeignPolicyError, match=message):
        read(tmp_path, made.mjlab_metadata(**changes))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("joint_ids_map: [1, 2, 0]", "joint_ids_map: [1, 1, 0]", "each motor's number once"),
        ("stiffness: [4.0, 2.0, 3.0]", "stiffness: [2.0]", "stiffness has 1 numbers, expected 3"),
        ("step_dt: 0.016", "step_dt: 0", "step_dt is 0, expected above 0"),
        ("step_dt: 0.016", "", "deploy.yaml step_dt is missing"),
        ("  JointPositionAction:", "  JointVelocityAction:", "expected JointPositionAction"),
        ("projected_gravity:", "height_scan:", "heights of the ground"),
        ("history_length: 3", "history_length: 4000", "history is 4000"),
        ("clip: [-0.02, 0.01]", "clip: [1.0, 0.5]", "clip is 1 to 0.5"),
        ("actions:", "actions: [", "not YAML"),
    ],
)
def test_a_deploy_yaml_that_does_not_fit_is_refused(tmp_path: Path, old, new, message: str):
    with pytest.raises(ForeignPolicyError, match=message):
        read_deploy(tmp_path, made.DEPLOY.replace(old, new), kind=ForeignFormat.UNITREE)


def test_formats_without_names_ask_for_them(tmp_path: Path):
    with pytest.raises(ForeignPolicyError, match=r"expected 3 names.*--joints"):
        read_deploy(tmp_path, joints=())
    with pytest.raises(ForeignPolicyError, match=r"order of the joints.*--joints"):
        read(tmp_path, config={"env.yaml": made.ENV})


def test_legged_gym_without_its_base_class_names_what_to_give(tmp_path: Path):
    config = {"tiny_config.py": made.LEGGED}
    with pytest.raises(ForeignPolicyError, match=r"LeggedRobotCfg; add the file of that class"):
        read(tmp_path, config=config, size=sum(made.SIZES) + 3)


def test_legged_gym_with_the_velocity_of_the_base_is_refused(tmp_path: Path):
    config = {"tiny_config.py": made.LEGGED, "base_config.py": made.LEGGED_BASE}
    with pytest.raises(ForeignPolicyError, match="linear velocity of the base"):
        read(tmp_path, config=config, size=sum(made.SIZES) + 6)


@pytest.mark.parametrize("name", ["policy.pt", "policy.onnx"])
def test_a_pickle_is_refused_unopened(tmp_path: Path, name: str):
    file = tmp_path / name
    file.write_bytes(b"PK\x03\x04" + b"cos\nsystem\n")
    with pytest.raises(ForeignPolicyError, match=r"never opened.*export it to ONNX"):
        read_network(file)


@pytest.mark.parametrize("kept", [0.2, 0.7])
def test_half_a_file_is_refused(tmp_path: Path, kept: float):
    file = save_network(tmp_path / "their.onnx", made.weights(), made.mjlab_metadata())
    content = file.read_bytes()
    file.write_bytes(content[: int(kept * len(content))])
    with pytest.raises(ForeignPolicyError, match=r"not an ONNX file|not a complete ONNX file"):
        read_network(file)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: set_type(m.graph.input[0], 10), "^'obs' of its network is float16, expected 32"),
        (lambda m: set_type(m.graph.output[0], 10), "^'actions' of its network is float16, expect"),
        (lambda m: set_type(m.graph.output[0], 77), "^'actions' of its network is of no type, exp"),
        (
            lambda m: m.graph.input[0].type.tensor_type.shape.dim.add(),
            r"shape \[0, 15, 0\], expected",
        ),
        (lambda m: m.graph.output.add().CopyFrom(m.graph.input[0]), r"2 outputs \(actions, obs\),"),
        (lambda m: setattr(m, "ir_version", 99), r"^onnx \S+ cannot load it: .* 99 .*; expected w"),
    ],
)
def test_a_network_that_is_not_as_ours_is_refused_by_its_own_reason(
    tmp_path: Path, change, message
):
    import onnx

    file = save_network(tmp_path / "their.onnx", made.weights(), made.mjlab_metadata())
    model = onnx.load(file)
    change(model)
    file.write_bytes(model.SerializeToString())
    with pytest.raises(ForeignPolicyError, match=message):
        read_network(file)


def set_type(value, number: int) -> None:
    value.type.tensor_type.elem_type = number


@pytest.mark.parametrize(
    ("name", "message"),
    [("weights.bin", None), ("../weights.bin", "expected a file beside"), ("none", "No such file")],
)
def test_weights_in_a_file_beside_are_read_and_no_others(tmp_path: Path, name: str, message):
    """As newer exporters of torch write them."""
    import onnx

    file = save_network(tmp_path / "their.onnx", made.weights(), made.mjlab_metadata())
    model = onnx.load(file)
    (tensor,) = model.graph.initializer
    (tmp_path / "weights.bin").write_bytes(tensor.raw_data)
    tensor.data_location = onnx.TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value=name)
    tensor.ClearField("raw_data")
    file.write_bytes(model.SerializeToString())
    if message:
        with pytest.raises(ForeignPolicyError, match=message):
            read_network(file)
        return
    (found,) = read_network(file).model.graph.initializer
    np.testing.assert_array_equal(onnx.numpy_helper.to_array(found), np.float32(made.weights()))


def test_tensors_that_repeat_the_bytes_of_a_file_are_limited(tmp_path: Path, monkeypatch):
    import onnx

    monkeypatch.setattr("humanoid_getup.policy.foreign.reading.MAX_BYTES", 10_000)
    model = onnx.load(save_network(tmp_path / "their.onnx", made.weights()))
    (tmp_path / "weights.bin").write_bytes(bytes(4000))
    for number in range(3):
        tensor = onnx.TensorProto(name=f"t{number}", data_type=1, dims=[1000])
        tensor.data_location = onnx.TensorProto.EXTERNAL
        tensor.external_data.add(key="location", value="weights.bin")
        model.graph.initializer.append(tensor)
    (tmp_path / "their.onnx").write_bytes(model.SerializeToString())
    with pytest.raises(ForeignPolicyError, match="its weights have more than 10000 bytes"):
        read_network(tmp_path / "their.onnx")


def places_in(value, place=()):
    """Yield the places of all values in nested tables and lists."""
    yield place
    items = value.items() if isinstance(value, dict) else ()
    for key, inner in enumerate(value) if isinstance(value, list) else items:
        yield from places_in(inner, (*place, key))


def with_value(content, place, value):
    if not place:
        return value
    copy = dict(content) if isinstance(content, dict) else list(content)
    copy[place[0]] = with_value(content[place[0]], place[1:], value)
    return copy


ODD = (None, 0, -5.5, 10**400, math.inf, math.nan, "x", [], [1], [None], {}, {"a": 1}, True)
ODD += ("(", "j{99999999999}", "(?a)(?u)j")  # malformed patterns


@pytest.mark.parametrize("kind", ["deploy.yaml", "env.yaml", "microduck"])
def test_whatever_stands_anywhere_is_read_or_refused(tmp_path: Path, kind: str):
    metadata = made.microduck_metadata()
    text = {"deploy.yaml": made.DEPLOY, "env.yaml": made.ENV}.get(kind)
    content = parse_yaml(text, keeps_tagged=True) if text else json.loads(metadata["microduck"])
    file, refused = tmp_path / "config.yaml", 0
    size = made.DEPLOY_SIZE if kind == "deploy.yaml" else sum(made.SIZES)
    for place in places_in(content):
        for value in ODD:
            changed = json.dumps(with_value(content, place, value))  # which YAML reads, too
            file.write_text(changed)
            shape = NetworkShape(metadata={"microduck": changed}, observation=size, action=3)
            try:
                given = Given(joints=made.MOTORS)
                describe_policy(shape, None, [file] if text else [], given).describe()
            except ForeignPolicyError:
                refused += 1
    assert refused > 200


@pytest.mark.parametrize("text", ["inf", "nan", "[1,2]", "-3"])
def test_a_history_that_is_no_number_of_steps_is_refused(tmp_path: Path, text: str):
    metadata = made.mjlab_metadata(observation_terms_history_length=f"{text},1,1,1,1")
    with pytest.raises(ForeignPolicyError, match="expected 0 to 200 steps"):
        read(tmp_path, metadata)


def test_isaac_limits_and_orders_its_actions(tmp_path: Path):
    new = "joint_names: [left_.*, .*]\n    preserve_order: true\n    clip: {left_.*: [-0.4, 0.1]}"
    env = made.ENV.replace("joint_names: [.*]\n", f"{new}\n")
    policy = read(tmp_path, config={"env.yaml": env}, joints=made.JOINTS)
    right, head, left = made.JOINTS
    assert policy.joints == made.JOINTS and policy.moved == (left, right, head)
    np.testing.assert_array_equal(policy.scale, [0.5, 0.3, 0.4])
    np.testing.assert_array_equal(policy.offset, [-0.2, 0.1, 0.3])
    np.testing.assert_array_equal(policy.lower, [-0.4, -np.inf, -np.inf])
    np.testing.assert_array_equal(policy.upper, [0.1, np.inf, np.inf])


def test_classes_that_inherit_many_times_are_read_once(tmp_path: Path):
    bases = [f"class C{k + 1}({', '.join([f'C{k}'] * 6)}): x = 1" for k in range(18)]
    text = "\n".join(["class C0: x = 1", *bases, made.LEGGED.replace("import os", "class C: pass")])
    assert read_legged(tmp_path, text.replace("os.remove(__file__)", "")).joints == made.JOINTS
