"""Descriptions of other projects' policies: what is read, from where, and what is refused."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("onnx")
pytest.importorskip("yaml")

import foreign_policies as made
import onnx
from foreign_policies import save_network
from nonempty import nonempty

from humanoid_getup.policy.foreign.description import ForeignNetwork, ForeignPolicy
from humanoid_getup.policy.foreign.reading import describe_policy, read_network
from robots.storage.yaml_text import parse_yaml


def read(metadata=None, size=15, actions=3, **options) -> ForeignPolicy:
    network = ForeignNetwork(
        model=onnx.ModelProto(), metadata=metadata or {}, observation=size, action=actions
    )
    return describe_policy(network, **options)


def read_env(folder: Path, text: str = made.ENV, **options) -> ForeignPolicy:
    (folder / "env.yaml").write_text(text)
    return read(config=folder / "env.yaml", **{"joints": made.JOINTS, **options})


def test_three_formats_that_say_the_same_read_the_same_and_name_their_sources(tmp_path: Path):
    mjlab = read(made.mjlab_metadata(), rate=made.RATE)
    microduck, isaac = read(made.microduck_metadata()), read_env(tmp_path)
    found = [mjlab, microduck, isaac]
    assert [policy.format for policy in found] == ["mjlab", "microduck", "isaac"]
    for policy in found:
        assert policy.joints == policy.moved == made.JOINTS
        assert policy.rate == pytest.approx(made.RATE)
        np.testing.assert_allclose(policy.default_pos, made.DEFAULT)
        np.testing.assert_allclose(policy.offset, made.DEFAULT)
        assert all(source for _, _, source in policy.describe())
    np.testing.assert_array_equal(mjlab.position_gain, [2.0, 3.0, 4.0])
    np.testing.assert_array_equal(isaac.position_gain, [2.0, 3.0, 4.0])
    assert microduck.p_gain == 200.0
    damped = read(made.mjlab_metadata(joint_damping="-0.1,0.2,-0.3"))  # of a MuJoCo bias
    np.testing.assert_array_equal(damped.damping, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(isaac.scale, made.SCALE)  # by patterns of names
    np.testing.assert_allclose(isaac.observation[0].scale, 0.2)
    assert isaac.sources["rate"] == "env.yaml sim.dt and decimation"
    given = read(made.mjlab_metadata(), rate=made.RATE, gain=5.0)
    assert (given.sources["rate"], given.sources["position_gain"]) == ("--rate", "--gain")
    assert (given.rate, given.position_gain.tolist()) == (made.RATE, [5.0] * 3)


def test_scales_clips_and_history_of_mjlab_are_read_a_term():
    metadata = made.mjlab_metadata(
        observation_terms_scale="0.25,1.000,[1.0, 2.0, 3.0],0.05,1.000",
        observation_terms_clip="[-inf, inf],[-1.0, 1.0],[-inf, inf],[-inf, inf],[-inf, inf]",
        observation_terms_history_length="0,2,0,0,0",
    )
    terms = read(metadata, sum(made.SIZES) + 3).observation
    assert terms[0].scale.tolist() == [0.25] * 3 and terms[2].scale.tolist() == [1.0, 2.0, 3.0]
    assert terms[1].upper == 1.0 and terms[1].history == 2


def test_isaac_limits_orders_and_counts_its_actions_and_keeps_a_history(tmp_path: Path):
    new = "joint_names: [left_.*, .*]\n    preserve_order: true\n    clip: {left_.*: [-0.4, 0.1]}"
    policy = read_env(tmp_path, made.ENV.replace("joint_names: [.*]\n", f"{new}\n"))
    right, head, left = made.JOINTS
    assert policy.joints == made.JOINTS and policy.moved == (left, right, head)
    np.testing.assert_array_equal(policy.scale, [0.5, 0.3, 0.4])
    np.testing.assert_array_equal(policy.offset, [-0.2, 0.1, 0.3])
    inf = np.inf
    np.testing.assert_array_equal(policy.limits, [[-0.4, -inf, -inf], [0.1, inf, inf]])
    text = made.ENV.replace("history_length: null", "history_length: 2")
    terms = read_env(tmp_path, text.replace(":joint_pos_rel", ":joint_pos"), size=30).observation
    assert [term.history for term in terms] == [2] * 5
    assert [term.is_offset for term in terms] == [True, True, False, True, True]
    text = made.ENV.replace(":JointPositionAction", ":RelativeJointPositionAction")
    assert read_env(tmp_path, text).mode == "offset"


def find_moved(folder: Path, pattern: str, joints: tuple[str, ...], count: int) -> tuple[str, ...]:
    """Read which joints are moved by an env.yaml with a pattern for them."""
    text = made.ENV.replace("joint_names: [.*]", f"joint_names: [{json.dumps(pattern)}]")
    size = sum(made.SIZES) - len(made.JOINTS) + count
    return read_env(folder, text, size=size, actions=count, joints=joints).moved


def test_a_pattern_that_could_take_without_end_is_refused(tmp_path: Path):
    endless = ("(j+)+x", "(?:j|jj)*x", "(.*)+", "(?x)(j+) +x", "(?x)(j+)#c\n+x", "(j*){3}")
    endless += ("j" * 300, "j?" * 40 + "x", ".*" * 9 + "x", "(j|j)" * 40 + "x", "(?:|)" * 40 + "x")
    for pattern in nonempty(endless):
        with pytest.raises(ValueError, match=r"take too long to match 'jj.* no repeated"):
            find_moved(tmp_path, pattern, (f"{60 * 'j'}_hip_y", *made.JOINTS[1:]), 3)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observation_names": "base_lin_vel,joint_pos"}, "'base_lin_vel' is the linear velocity"),
        ({"observation_names": "motion_command,joint_pos"}, "'motion_command' is unknown"),
        ({"joint_stiffness": "1.000,1.000,1.000"}, "1 N·m/rad for every joint.*--gain"),
        ({"default_joint_pos": "0.1,0.2"}, r"shape \(2,\), expected \(3,\)"),
        ({"action_scale": "much"}, "'much', expected numbers"),
        ({"observation_names": "base_ang_vel"}, r"takes 15 numbers, its terms are 3"),
        ({"observation_terms_scale": "1.0"}, "1 values for 5 observations"),
        ({"observation_terms_clip": "[1,0]" + ",[1,2]" * 4}, "clip is 1 to 0, expected a range"),
        ({"observation_terms_history_length": "inf,1,1,1,1"}, "expected 0 to 200 steps"),
        ({"joint_names": None}, "nothing describes it"),
    ],
)
def test_metadata_that_cannot_be_run_is_refused(changes, message: str):
    with pytest.raises(ValueError, match=message):
        read(made.mjlab_metadata(**changes))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("sim: {dt: 0.004}", "sim: {dt: 0}", "env.yaml sim.dt is 0, expected a number above 0"),
        ("sim: {dt: 0.004}", "", "env.yaml sim is missing"),
        (":JointPositionAction", ":JointVelocityAction", "expected one action, JointPositionAct"),
        (":projected_gravity", ":height_scan", "heights of the ground"),
        ("history_length: null", "history_length: 4000", "history is 4000"),
        ("joint_names_expr: [head_joint]", "joint_names_expr: [x]", "missing for head_joint"),
        ("actions:", "actions: [", "not YAML"),
    ],
)
def test_an_env_yaml_that_does_not_fit_is_refused(tmp_path: Path, old, new, message: str):
    with pytest.raises(ValueError, match=message):
        read_env(tmp_path, made.ENV.replace(old, new))


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


@pytest.mark.parametrize("kind", ["env.yaml", "microduck"])
def test_whatever_stands_anywhere_is_read_or_refused(tmp_path: Path, kind: str):
    text, refused = made.microduck_metadata()["microduck"], 0
    content = parse_yaml(made.ENV) if kind == "env.yaml" else json.loads(text)
    for number, place in enumerate(places_in(content)):
        for value in ODD[number % 4 :: 4]:
            changed = json.dumps(with_value(content, place, value))  # which YAML reads, too
            try:
                if kind == "env.yaml":
                    read_env(tmp_path, changed).describe()
                else:
                    read({"microduck": changed}).describe()
            except ValueError:
                refused += 1
    assert refused > 30


def test_a_pickle_and_half_a_file_are_refused(tmp_path: Path):
    for name in ("policy.pt", "policy.onnx"):
        (tmp_path / name).write_bytes(b"PK\x03\x04" + b"cos\nsystem\n")
        with pytest.raises(ValueError, match=r"never opened.*export it to ONNX"):
            read_network(tmp_path / name)
    file = save_network(tmp_path / "their.onnx", made.weights(), made.mjlab_metadata())
    content = file.read_bytes()
    for kept in (0.2, 0.7):
        file.write_bytes(content[: int(kept * len(content))])
        with pytest.raises(ValueError, match=r"not an ONNX file|not a complete ONNX file"):
            read_network(file)


def change_network(folder: Path, change) -> Path:
    file = save_network(folder / "their.onnx", made.weights(), made.mjlab_metadata())
    model = onnx.load(file)
    change(model)
    file.write_bytes(model.SerializeToString())
    return file


def set_type(value, number: int) -> None:
    value.type.tensor_type.elem_type = number


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: set_type(m.graph.input[0], 10), "^'obs' of its network is float16, expected 32"),
        (lambda m: set_type(m.graph.output[0], 77), "^'actions' of its network is of no type, exp"),
        (lambda m: m.graph.input[0].type.tensor_type.shape.dim.add(), r"shape \[0, 15, 0\], expec"),
        (lambda m: m.graph.output.add().CopyFrom(m.graph.input[0]), r"2 outputs \(actions, obs\),"),
        (lambda m: setattr(m, "ir_version", 99), r"^onnx \S+ cannot load it: .* 99 .*; expected w"),
    ],
)
def test_a_network_that_is_not_as_ours_is_refused_by_its_own_reason(tmp_path, change, message: str):
    with pytest.raises(ValueError, match=message):
        read_network(change_network(tmp_path, change))


def move_weights(model, place: str) -> None:
    (tensor,) = model.graph.initializer
    tensor.data_location = onnx.TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value=place)
    tensor.ClearField("raw_data")


def test_weights_in_a_file_beside_are_read_and_no_others(tmp_path: Path):
    """As newer exporters of torch write them."""
    (tmp_path / "weights.bin").write_bytes(np.float32(made.weights()).tobytes())
    file = change_network(tmp_path, lambda m: move_weights(m, "weights.bin"))
    (found,) = read_network(file).model.graph.initializer
    np.testing.assert_array_equal(onnx.numpy_helper.to_array(found), np.float32(made.weights()))
    for place, message in (("../weights.bin", "expected a file beside"), ("none", "No such file")):
        with pytest.raises(ValueError, match=message):
            read_network(change_network(tmp_path, lambda m, p=place: move_weights(m, p)))


def test_tensors_that_repeat_the_bytes_of_a_file_are_limited(tmp_path: Path, monkeypatch):
    def repeat(model) -> None:
        for number in range(3):
            tensor = onnx.TensorProto(name=f"t{number}", data_type=1, dims=[1000])
            tensor.data_location = onnx.TensorProto.EXTERNAL
            tensor.external_data.add(key="location", value="weights.bin")
            model.graph.initializer.append(tensor)

    monkeypatch.setattr("humanoid_getup.policy.foreign.reading.MAX_BYTES", 10_000)
    (tmp_path / "weights.bin").write_bytes(bytes(4000))
    with pytest.raises(ValueError, match="its weights have more than 10000 bytes"):
        read_network(change_network(tmp_path, repeat))
