"""Bad input to every command: what is given, and what the one line says."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import math
import os
import shlex
import shutil
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np
from action_files import Slot, write_action_file
from human_clips import write_human_bvh
from mcap.writer import Writer
from paths import NODDING, TINY
from small_humanoid import small_humanoid, small_urdf

from humanoid_getup.motions.motion import Motion
from humanoid_getup.scenes.named_scenes import load_scene
from robots import Robot
from robots.description.posture_file import format_posture

MOTION = "squat_to_stand"
BVH = """HIERARCHY
ROOT Hips {
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT LeftUpLeg { OFFSET 10 0 0 CHANNELS 0 JOINT LeftFoot { OFFSET 0 -100 0 CHANNELS 0 } }
  JOINT RightUpLeg { OFFSET -10 0 0 CHANNELS 0 JOINT RightFoot { OFFSET 0 -100 0 CHANNELS 0 } }
  JOINT Neck { OFFSET 0 50 0 CHANNELS 0 }
}
MOTION
Frames: 2
Frame Time: 0.5
0 10 0 0 -90 0
0 100 0 0 0 0
"""


@dataclass(frozen=True)
class Case:
    """A command line, in a folder made by `make_files`."""

    command: str
    message: tuple[str, ...]
    """Parts of the line on standard error."""
    extra: str | None = None
    """Package that the command needs; without it, the case is left out."""


def case(command: str, *message: str, extra: str | None = None) -> Case:
    return Case(command, message, extra)


GROUPS: dict[str, list[Case]] = {
    "options": [
        case("rise --from supine --robot nao", "unknown robot 'nao'", "op3"),
        case("rise --from supine --robot ''", "unknown robot"),
        case("rise --from supine --scene moon", "unknown scene 'moon'", "flat"),
        case("rise --from supine --scene slope:50", "scene slope:50", "from -30 to 30"),
        case("rise --from supine --scene beam", "scene 'beam' has no start supine, expected prone"),
        case(
            "rise --from prone --scene ball.toml",
            "unknown key ground.frictoin",
            "sphere 'ball': radius is -1, expected above 0",
        ),
        case(
            "rise --from supine --scene cave.toml",
            "scene 'cave' has no place within 1.4 m of the start where 'op3' could stand",
        ),
        case("rise --from supine --scene nowhere.toml", "nowhere.toml: No such file"),
        case("scenes sole.toml", "obstacle 'l_sole' has the name of a part of robot 'op3'"),
        case("plan --from prone --scene off.toml", "start 'prone': x is 2 to 3, expected"),
        case("scenes upside.toml", "start 'left': z is 1 to 0, expected the lower number"),
        case("motions build a a", "NAMES has 'a' twice, expected each once"),
        case("rise --from supine --bogus 1", "unknown option '--bogus': see getup rise --help"),
        case("rise --form supine", "unknown option '--form', expected --from"),
        case("rise --from", "--from has no value, expected one"),
        case("rise --balance yes", "unknown argument 'yes'"),
        case("run robust --body arms=2", "'--body', which getup rise, getup play", "has"),
        case("motions retarget", "--robot STR is missing"),
        case("bench all --n 0", "--n is 0, expected 1 to 1000000"),
        case("bench all --limit-by luck", "--limit-by is 'luck', expected current, pwm or ideal"),
        case("bench all --out text.txt", "text.txt is not a folder"),
        case("bench all --out begun --quick --resume", "benchmark.jsonl", "starts over"),
        case(
            "play squat_to_stand --without-imu",
            "robot 'op3' has an IMU (board)",
            "neither [imu] nor [bus.board]",
        ),
        case(
            "play squat_to_stand --without-imu --then sit", "--then is sit, expected hold or limp"
        ),
        case("play squat_to_stand --without-imu --scene wall", "--scene is wall, expected flat"),
        case("scenes moon", "unknown scene 'moon'"),
        case("scenes wall --picture folder", "output file folder: is a folder"),
        case("rise --from supine --at 0,0,90", "--at is given, expected a real robot"),
        case(
            "rise --backend dynamixel --port none --scene wall",
            "--scene wall on a real robot requires --at X,Y,DEG",
        ),
        case("rise --from upside", "unknown start 'upside'", "supine, prone, left, right"),
        case("rise", "--from is missing", "supine, prone, left, right"),
        case(
            "rise --from supine --backend gazebo",
            "--backend is 'gazebo', expected twin, virtual or dynamixel",
        ),
        case(
            "rise --from supine --then drop",
            "--then is 'drop', expected hold, sit, limp or hand-over",
        ),
        case("hold --then hold", "--then is 'hold', expected sit, limp or hand-over"),
        case("watch --backend dynamixel", "--backend dynamixel requires --port"),
        case("watch --seconds 0", "--seconds is 0 s, expected 0.001 to 1e+06 s"),
        case("watch --from upside", "unknown start 'upside'", "supine, prone, left, right"),
        case("watch --backend dynamixel --port /dev/x --from prone", "--from is 'prone', expected"),
        case("sit --backend dynamixel", "--backend dynamixel requires --port"),
        case("play sit_and_lie_down", "ends lying supine", "one that ends standing"),
        case("rise --from supine --method luck", "--method is 'luck', expected plan, policy"),
        case("rise --from supine --attempts 0", "--attempts is 0, expected 1 to 1000000"),
        case("rise --from supine --attempts 1.5", "--attempts is '1.5', expected a whole number"),
        case("rise --from supine --seed -1", "--seed is -1, expected 0 to 92"),
        case("rise --from supine --seed x", "--seed is 'x', expected a whole number"),
        case(
            "rise --from supine --torque-limit 0",
            "--torque-limit is 0 N·m, expected 0.001 to",
        ),
        case("rise --from supine --torque-limit -2.5", "--torque-limit is -2.5 N·m"),
        case("rise --from supine --torque-limit nan", "--torque-limit is nan N·m"),
        case("rise --from supine --torque-limit inf", "--torque-limit is inf N·m"),
        case("rise --from supine --torque-limit much", "--torque-limit is 'much'", "a number"),
        case(
            "rise --from supine --seed -1 --torque-limit 0", "--seed is -1", "--torque-limit is 0"
        ),
        case(
            "rise --from supine --torque-limit 4.2",
            "torque limit is 4.2 N·m, expected at most 4.1 N·m, the stall torque",
        ),
        case(
            "rise --from supine --torque-limit 0.003",
            "torque limit is 0.003 N·m, expected at least 0.0048 N·m, one count of the servos",
        ),
        case(
            "rise --from supine --policy robust",
            "--policy is robust, expected --method policy or auto with it",
        ),
        case(
            "rise --from supine --method policy --prefer torque --search-budget 5",
            "--prefer torque and --search-budget: expected --method plan or auto",
        ),
        case(
            "rise --from supine --no-filtering --prefer impact",
            "--prefer impact: expected filtering, not --no-filtering",
        ),
        case(
            "rise --from supine --prefer luck",
            "--prefer is 'luck', expected time, torque, impact or robustness",
        ),
        case(
            "rise --from supine --search-budget 0",
            "--search-budget is 0 s, expected 0.001 to",
        ),
        case("rise --from supine --search-budget nan", "--search-budget is nan s"),
        case("rise --from supine --search-budget long", "--search-budget is 'long'", "a number"),
        case("bench rise --prefer luck", "--prefer is 'luck'"),
        case("bench rise --search-budget -1", "--search-budget is -1 s"),
        case("motions build --prefer luck", "--prefer is 'luck', expected time, torque"),
        case("rise --from supine --limit-by luck", "--limit-by is 'luck', expected current, pwm"),
        case(
            "rise --from supine --backend virtual --limit-by ideal",
            "--limit-by is ideal, which no servo can",
        ),
        case(
            "rise --robot other_servos --from supine --limit-by current",
            "by 'current', expected 'pwm'",
            "XL430-W250",
        ),
        case("bench rise --limit-by torque", "--limit-by is 'torque'"),
        case("eval robust --n 4 --torque-limit 9", "torque limit is 9 N·m", "at most 4.1 N·m"),
        case("play moonwalk", "unknown motion 'moonwalk'", MOTION, ".npz"),
        case(f"play {MOTION} --from upside", "unknown start 'upside'"),
        case(f"play {MOTION} --torque-limit 0", "--torque-limit is 0 N·m"),
        case("run moonwalk --from supine", "unknown policy 'moonwalk'", "robust", ".onnx"),
        case("run robust", "--from is missing"),
        case("run robust --from supine --longest 0", "--longest is 0 s, expected 0.001 to 1e+06 s"),
        case("run robust --from supine --longest nan", "--longest is nan s"),
        case("rise --from supine --method policy --policy moonwalk", "unknown policy 'moonwalk'"),
        case("motions list --robot nao", "unknown robot 'nao'"),
        case("motions show moonwalk", "unknown motion 'moonwalk'"),
        case("motions build moonwalk", "unknown motion 'moonwalk'", MOTION),
        case(f"preflight {MOTION} --voltage 1e-320", "--voltage is 9.99989e-321 V, expected 1 to"),
        case("style edit sit-up --slower 1e-320 --out mine.toml", "--slower is 9.99989e-321"),
        case("rise --from supine --seed " + "9" * 30, "expected 0 to 9223372036854775807"),
        case("motions build --engine local:0", "--engine is 'local:0', expected 1 to 256 workers"),
        case("motions build --generations -3", "--generations is -3, expected 1 to 1000000"),
        case("motions build --seed -1", "--seed is -1"),
        case("motions build --seed 99999999999", "--seed is 99999999999, expected 0 to"),
        case("preflight moonwalk", "unknown motion 'moonwalk'"),
        case(f"preflight {MOTION} --voltage 0", "--voltage is 0 V, expected 1 to 100 V"),
        case(f"preflight {MOTION} --voltage nan", "--voltage is nan V"),
        case(f"preflight {MOTION} --temperature inf", "--temperature is inf °C", "-50 to 150 °C"),
        case(f"preflight {MOTION} --torque-limit -1", "--torque-limit is -1 N·m"),
        case("replay empty.mcap --threshold 0", "--threshold is 0 rad, expected 1e-09 to 10 rad"),
        case("replay empty.mcap --voltage -12", "--voltage is -12 V"),
        case("bench rise --n 0", "--n is 0, expected 1 to 1000000"),
        case("bench rise --engine cloud", "--engine is 'cloud'", "local, dask or slurm"),
        case("bench rise --engine local:0", "--engine is 'local:0', expected 1 to 256 workers"),
        case("bench all --engine local --address 10.0.0.1:1", "expected none with engine local"),
        case("bench rise --torque-limit nan", "--torque-limit is nan N·m"),
        case("bench rise --assistance 1.5", "--assistance is 1.5, expected 0 to 1"),
    ],
    "bodies": [
        case("rise --from supine --body tail=2", "--body 'tail=2': unknown part 'tail'", "arms"),
        case("rise --from supine --body arms", "arms is '', expected a factor from 0.25 to 4"),
        case("rise --from supine --body arms=0", "arms is '0', expected a factor from 0.25 to 4"),
        case("rise --from supine --body arms=-1.6", "arms is '-1.6'"),
        case("rise --from supine --body arms=nan", "arms is 'nan'"),
        case("rise --from supine --body arms=long", "arms is 'long'"),
        case("rise --from supine --body arms=9", "arms is '9', expected a factor from 0.25 to 4"),
        case("rise --from supine --body arms=2,arms=3", "arms is given twice, expected once"),
        case("rise --from supine --body arms=2,", "unknown part ''"),
        case(
            "rise --body arms=1.6 --backend dynamixel --port /dev/x",
            "--body is arms=1.6, expected none: a real robot has the body that it has",
        ),
        case("rise --from supine --body arms=1.6 --method policy", "--body is arms=1.6", "policy"),
        case("motions list --body torso=0", "torso is '0'"),
        case("scenes --body torso=0", "torso is '0'"),
        case("preflight squat_to_stand --body torso=0", "torso is '0'"),
        case("motions show long_arms.npz", "was made for the body 'arms=1.6', expected the orig"),
        case("motions show long_arms.npz --body legs=1.2", "expected 'legs=1.2' or the original"),
    ],
    "plan": [
        case("plan", "--from is missing", "supine, prone, left, right"),
        case("plan --from upside", "unknown start 'upside'"),
        case("plan --from supine --scene moon", "unknown scene 'moon'"),
        case("plan --from supine --max-checks 0", "--max-checks is 0, expected 1 to 1000000000"),
        case("plan --from supine --keep-partial", "--keep-partial: expected --out DIR"),
        case("plan --from supine --to none.json", "posture 'none.json': no such file"),
        case("plan --from supine --to motions:moonwalk@1", "unknown motion 'moonwalk'", MOTION),
        case("plan --from supine --key none.json", "posture 'none.json': no such file"),
        case("plan --from supine --key motions:moonwalk@1", "unknown motion 'moonwalk'"),
        case(f"plan --from supine --key motions:{MOTION}", "expected motions:NAME@TIME"),
        case(f"plan --from supine --key motions:{MOTION}@soon", "expected motions:NAME@TIME"),
        case(f"plan --from supine --key motions:{MOTION}@99", "99 s, expected 0 to 3.27 s"),
        case(f"plan --from supine --key motions:{MOTION}@-1", "-1 s, expected 0 to 3.27 s"),
        case("plan --from supine --key bent.json", "joint 'l_knee' is +9.000 rad"),
        case(
            "plan --from supine --key tangled.json",
            "posture tangled.json",
            "mm inside",
            "expected at most 6.0 mm",
        ),
        case(
            "plan --from walled.json --scene wall", "mm into obstacle 'wall', expected at most 5 mm"
        ),
        case("rise --from walled.json --scene wall", "mm into obstacle 'wall'"),
        case("plan --from supine --robot no_motions", "robot 'op3' has no motions"),
        case("plan --from supine --out text.txt", "text.txt is not a folder"),
        case("plan --from supine --json folder", "output file folder: is a folder"),
        case("rise --from supine --key none.json", "posture 'none.json': no such file"),
        case("rise --from supine --key motions:moonwalk@1", "unknown motion 'moonwalk'"),
        case(f"rise --from supine --key motions:{MOTION}@99", "99 s, expected 0 to 3.27 s"),
        case("rise --from supine --key bent.json", "joint 'l_knee' is +9.000 rad"),
        case("rise --from supine --key tangled.json", "posture tangled.json", "mm inside"),
        case(
            f"rise --from supine --method policy --key motions:{MOTION}@0",
            "--key: expected --method plan with it, planning and filtering",
        ),
        case(f"rise --from supine --no-filtering --key motions:{MOTION}@0", "--key: expected"),
        case("play path.npz", "motion 'path' ends neither standing nor lying"),
    ],
    "eval": [
        case("eval moonwalk", "unknown policy 'moonwalk'"),
        case("eval robust --n 5", "--n is 5, expected a multiple of 4, 4 to 1000000"),
        case("eval robust --n 0", "--n is 0"),
        case("eval robust --delay 90", "--delay is 90 ms, expected 0 to 60 ms"),
        case("eval robust --voltage 0.1", "--voltage is 0.1 V, expected 1 to 30 V"),
        case("eval robust --friction 0", "--friction is 0, expected 0.01 to 10"),
        case("eval robust --mass nan", "--mass is nan, expected 0.1 to 10"),
        case("eval robust --backlash -1", "--backlash is -1 deg, expected 0 to 10 deg"),
        case("eval robust --weak-servo 2", "--weak-servo is 2, expected 0 to 1"),
        case("eval robust --push 11", "--push is 11 m/s, expected 0 to 10 m/s"),
        case("eval robust --imu-tilt 91", "--imu-tilt is 91 deg, expected 0 to 90 deg"),
        case("eval robust --gyro-bias inf", "--gyro-bias is inf deg/s"),
        case("eval robust --variant jelly", "--variant is 'jelly', expected 1 ms steps"),
        case(
            "eval robust --n 4 --variant 'menagerie servos' --torque-limit 2",
            "--variant is 'menagerie servos', expected without torque limit",
        ),
        case("eval robust --n 4 --falls empty.npz", "empty.npz"),
        case("eval robust --n 4 --falls text.npz", "text.npz"),
        case("eval robust --n 4 --falls half.npz", "half.npz"),
        case("eval robust --n 4 --falls whole.npz", "whole.npz"),
        case("eval robust --n 4 --falls folder", "folder: is a folder, expected a file"),
        case("eval empty.onnx --n 4", "empty.onnx"),
    ],
    "style": [
        case("style show cartwheel", "unknown style 'cartwheel', expected long-sit, push-up"),
        case("style show few.toml", "few.toml: curves 1: neck_height has 2 points, expected 9"),
        case(
            "style show kneeling.toml", "neck_height ends at 0.6 of standing, expected 0.9 or more"
        ),
        case("style show wide.toml", "curves 1: side is 200° at point 1, expected 0 to 180°"),
        case("style show falling.toml", "falling.toml: duration is -5 s, expected above 0 s"),
        case("style show text.txt", "unknown style 'text.txt'"),
        case("style show texts.toml", "neck_height is", "expected a list of finite numbers"),
        case("style show short.toml", "duration is 0.005", "expected 0.1 to 60 s"),
        case(
            "style show sit-up --json both.png --picture both.png",
            "are both both.png, expected two files",
        ),
        case("style show none.toml", "style file none.toml: No such file or directory"),
        case("style show sit-up --picture folder", "folder: is a folder, expected a file"),
        case("style edit sit-up --out mine.toml", "no edit is given, expected --slower"),
        case("style edit sit-up --later 9 --out mine.toml", "make the style slower first"),
        case(
            "style edit sit-up --slower 0 --out mine.toml",
            "--slower is 0, expected 0.0001",
        ),
        case(
            "style edit sit-up --slower 2 --faster 2 --out mine.toml",
            "--slower and --faster are given, expected one of them",
        ),
        case("style edit sit-up --hold 9,1 --out mine.toml", "hold is at 9 s, expected 0 to 2.8"),
        case("style edit sit-up --hold 1,inf --out mine.toml", "--hold is 1,inf, expected a time"),
        case("style edit sit-up --faster 1000 --out mine.toml", "expected 0.1 to 60 s"),
        case("style edit sit-up --slower 2 --out mine", "expected a name that ends with .toml"),
        case("style extract moonwalk --out mine.toml", "unknown motion 'moonwalk'"),
        case("style extract empty.mcap --out mine.toml", "empty.mcap"),
        case("style extract text.txt --out mine.toml", "a file of another kind, expected .npz"),
        case(f"style extract {MOTION} --up z --out mine.toml", "--up is given, expected none with"),
        case("style extract turned.bvh --out mine.toml", "along y, expected a stand", "(--up z)"),
        case("style extract scaled.bvh --out mine.toml", "joint 'Hips' has 6 channels Xscale"),
        case(
            "style extract text.bvh --out mine.toml", "it is not a BVH file: HIERARCHY is missing"
        ),
        case("style extract text.amc --out mine.toml", "text.asf: No such file or directory"),
        case(
            f"style extract {MOTION} --begin 3 --end 1 --out mine.toml",
            "--begin is 3 s, expected before --end, 1 s",
        ),
        case(
            f"style extract {MOTION} --end 0.1 --out mine.toml",
            "nothing moves in what is extracted",
        ),
        case("style extract sit_and_lie_down --out mine.toml", "expected 0.9 or more", "--finish"),
        case("mocap import", "the clip is missing, expected FILE.bvh, or FILE.asf FILE.amc"),
        case("mocap import text.txt", "the clip is text.txt, expected FILE.bvh, or FILE.asf"),
        case("mocap import text.bvh turned.bvh", "expected FILE.bvh, or FILE.asf FILE.amc"),
        case("mocap import none.bvh", "none.bvh: No such file or directory"),
        case("mocap import empty.bvh", "it is not a BVH file: HIERARCHY is missing"),
        case("mocap import scaled.bvh", "joint 'Hips' has 6 channels Xscale"),
        case("mocap import text.amc", "text.asf: No such file or directory"),
        case("mocap import headless.bvh", "it has no neck, expected a joint lowerneck, Neck"),
        case("mocap import upright.bvh", "it has no left shoulder, expected a joint lhumerus"),
        case("mocap import human.bvh --robot human --begin 0.3", "it lasts 0.10 s, expected two"),
        case("mocap import short.bvh", "it lasts 0.00 s, expected two frames or more"),
        case(
            "mocap import human.bvh --begin 3 --end 1", "--begin is 3 s, expected before --end, 1 s"
        ),
        case("mocap import human.bvh --begin -1", "--begin is -1 s", "times from 0 s on"),
        case("mocap import human.bvh --rate 60", "--rate is given, expected none with a .bvh file"),
        case("mocap import human.bvh --out mine.bvh", "expected a name that ends with .npz"),
        case("mocap import human.bvh --out folder.npz", "folder.npz: is a folder"),
        case("mocap import human.bvh --name 'a b'", "motion name 'a b': expected 1 to 100 letters"),
        case("run robust --from supine --style sit-up", "the policy follows no style curves"),
        case("run robust --from supine --style few.toml", "few.toml: curves 1: neck_height has 2"),
        case("run robust --from supine --style planned", "follows no style curves"),
        case("rise --from supine --style sit-up", "expected --method policy with it"),
        case("eval robust --n 4 --style sit-up", "policy 'robust' follows no style curves"),
        case("eval robust --n 4 --height-map", "policy 'robust' has no height map"),
        case("eval robust --n 4 --scene flat,flat", "expected each scene once"),
        case("eval styled --n 4 --style sit-up,moon", "unknown style 'moon'"),
        case("eval styled --n 4 --style sit-up,sit-up", "expected each style once"),
        case("eval styled --n 4 --style ''", "unknown style ''"),
        case("eval robust --n 4 --scene flat,moon", "unknown scene 'moon'"),
    ],
    "train and export": [
        case("train --out mine --recipe slow", "--recipe is 'slow', expected quick, backwards,"),
        case(
            "train --robot no_motions --recipe backwards --out mine",
            "robot 'op3' has no rising motion in",
            extra="rsl_rl",
        ),
        case(
            "train --out mine --recipe styled-quick",
            "mine has no prior.npz, expected --prior",
            extra="rsl_rl",
        ),
        case(
            "train --out mine --recipe styled --prior folder --parent folder",
            "prior.npz",
            extra="rsl_rl",
        ),
        case(
            "train --out mine --prior none", "--prior is none, expected the folder of a pose prior"
        ),
        case("train --out mine --parent text.onnx", "text.onnx is not a policy", extra="rsl_rl"),
        case("prior --out mine --rises 2", "--rises is 2, expected a multiple of 4, 4 to 1000000"),
        case("prior --out text.txt", "text.txt is not a folder"),
        case("prior --out mine --engine local:0", "engine is 'local:0', expected 1 to 256"),
        case(
            "prior --out mine --policies styled",
            "policy 'styled' follows style curves",
            extra="rsl_rl",
        ),
        case("train --out mine --threads -2", "--threads is -2, expected 0 to 256"),
        case("train --out mine --iterations 0", "--iterations is 0, expected 1 to 1000000"),
        case("train --out mine --robots 0", "--robots is 0, expected 1 to 1000000"),
        case("train --out text.txt", "text.txt is not a folder"),
        case("train --out mine --device abacus", "--device is 'abacus'", extra="rsl_rl"),
        case("train --out mine --physics newton", "--physics is 'newton', expected mujoco or warp"),
        case(
            "train --robot other_solver --physics warp --out mine",
            "mujoco-warp cannot simulate this model: mjSOL_PGS is unsupported",
            extra="mujoco_warp",
        ),
        case(
            "train --out mine --parent none", "--parent is none, expected the folder of a training"
        ),
        case("export none --out policy.onnx", "none", extra="rsl_rl"),
        case("export folder --out policy.onnx", "folder", extra="rsl_rl"),
        case("export folder --out folder", "folder: is a folder, expected a file"),
    ],
    "policies of others": [
        *(
            case(f"policy import {line} --out mine", *message, extra="yaml")
            for line, *message in (
                ("none.onnx", "none.onnx: No such file"),
                ("folder", "folder"),
                ("empty.onnx", "empty.onnx: it is not an ONNX file: it holds no network"),
                ("text.onnx", "text.onnx: it is not"),
                ("their.pt", "their.pt: it is a pickle of torch, which is never opened"),
                ("bare.onnx --robot nodding", "nothing describes it, expected an ONNX file with"),
                ("bare.onnx --config text.txt", "text.txt"),
                ("bare.onnx --config ball.toml", "ball.toml: not YAML"),
                ("bare.onnx --config loop.yaml", "its aliases stand for too many values"),
                (
                    "bare.onnx --config endless.yaml --joints a,b,c",
                    "pattern '(j+)+x' could take too",
                ),
                ("their.onnx", "robot 'op3' has no right_hip_joint, head_joint, left_hip_joint"),
                ("their.onnx --rename left", "--rename is left, expected THEIRS=OURS,..."),
                ("their.onnx --robot nodding --rate 50", "every 2.5 control periods of 8 ms"),
                ("their.onnx --robot nodding --rate 62.5 --gain 99", "'r_hip' 99 (the servo:"),
                ("their.onnx --robot nodding --gain 0", "--gain is 0 N·m/rad, expected 0.001"),
                ("stiff.onnx --robot nodding", "joint_stiffness is 1 N·m/rad for every joint"),
                ("blind.onnx --robot nodding", "'base_lin_vel' is the linear velocity of the base"),
            )
        ),
        case("policy import their.onnx --out text.txt", "text.txt", extra="yaml"),
        case("policy", "expected a command first"),
        *(
            case(f"policy check robust {line}", *message)
            for line, *message in (
                ("", "--trace"),
                ("--trace none.npz", "trace none.npz: No such file"),
                ("--trace text.npz", "trace text.npz: it is not an .npz archive"),
                ("--trace whole.npz", "key 'joints' is missing; key 'gyro' is missing"),
            )
        ),
        case("policy import half.onnx --out mine", "half.onnx", extra="yaml"),
        case("policy check moonwalk --trace trace.npz", "unknown policy 'moonwalk'"),
    ],
    "ports": [
        case(
            "rise --backend dynamixel", "--backend dynamixel requires --port", "--port /dev/ttyUSB0"
        ),
        case("rise --from supine --port /dev/x", "--port is /dev/x", "virtual or dynamixel"),
        case(
            "rise --from supine --backend dynamixel --port /dev/x",
            "--from is 'supine'",
            "a real one starts as it lies",
        ),
        case(
            "rise --backend virtual --port a=/dev/x",
            "--port is a=/dev/x",
            "robot 'op3': --port main=PATH",
        ),
        case(
            "rise --backend dynamixel --port /dev/x --no-filtering",
            "--no-filtering requires a simulated robot",
        ),
        case("rise --backend dynamixel --port none", "none"),
        case("rise --backend dynamixel --port text.txt", "text.txt"),
        case("play squat_to_stand --backend dynamixel --port folder", "folder"),
        case("servo list --port none", "none"),
        case("servo list --port text.txt", "text.txt"),
        case("servo list --port none --baud 1234567", "1234567"),
        case("servo list --baud fast", "--baud is 'fast', expected a whole number"),
        case("servo list --baud 1000000 --all-bauds", "baud"),
        case("doctor", "--port is missing", "--port /dev/ttyUSB0"),
        case("doctor --port none", "none"),
        case("doctor --port a=none,b=none", "--port main=PATH"),
        case("calibrate --port none --yes", "none"),
        case("calibrate --port none --yes --joint tail", "unknown joint 'tail'"),
        case("calibrate --port none --yes --at floating", "unknown posture 'floating'"),
        case("bus --voltage -1", "voltage is -1 V, expected 1 to 48 V"),
        case("bus --latency 3", "latency is 3 s"),
        case("bus --servos XL999:1", "--servos has 'XL999:1', expected MODEL:ID with a model of"),
        case("bus --servos XL430-W250:1,1", "--servos has the id 1 twice"),
        case("bus --servos XL430-W250:300", "--servos has 'XL430-W250:300', expected an id"),
        case("bus --servos XL430-W250:253", "expected an id from 0 to 252"),
        case("bus --servos AX-12A:254", "--servos has 'AX-12A:254', expected an id from 0 to 253"),
        case(
            "bus --servos AX-12A:1,XL430-W250:2",
            "servos AX-12A, XL430-W250 speak different protocols (1.0, 2.0): give each a port",
        ),
        case("bus --servos AX-12A:1 --baud 2000000", "AX-12A: baud rate is 2000000 bit/s, exp"),
        case("bus --servos SCS0009:1", "--servos has 'SCS0009:1', expected MODEL:ID with a"),
        case("bus --servos XL430-W250:1 --load 1", "--load is '1', expected KG:M"),
        case("bus --load 1:0.1", "--load needs --servos"),
        case("bus --turn l_knee:20", "--turn needs --hold"),
        case("bus --hold high", "unknown posture 'high': expected zero, standing, or a file"),
        case("bus --hold zero --turn knee:20", "turn knee:20: unknown joint 'knee'"),
        case("bus --hold zero --turn l_knee:999", "l_knee would be at +999.0°, expected"),
        case("bus --hold zero --turn l_knee:x", "expected JOINT:DEG, an angle in degrees"),
        case("first-steps", "--port is missing, expected a serial port"),
        case("first-steps --port none", "standard input is not a terminal"),
        case("bus --servos XL430-W250:1 --baud 1", "baud is 1 bit/s, expected 9600"),
        case(
            "hold --robot desk", "robot 'desk' is servos on a bench, expected a robot with a model"
        ),
        case("doctor --robot bad-desk --port none", "id 1 is given 2 times, expected once"),
        case("servo monitor", "--port is missing", "--port /dev/ttyUSB0"),
        case("servo list --port none --baud 1", "baud is 1 bit/s, expected 9600"),
        case("servo read --port none", "NAME is missing"),
        case("servo write --port none", "NAME=COUNTS is missing"),
        case("servo write temperature_limit --port none --id 1", "expected NAME=COUNTS"),
        case("servo write temperature_limit=x --port none --id 1", "expected NAME=COUNTS"),
        case("servo id 254 --port none", "new is 254, expected 0 to 253"),
        case("servo list --port none --protocol 3.0", "--protocol", "3.0", "feetech"),
        case("servo id 2 --id -1 --port none", "--id is -1, expected 0 to 253"),
        case("servo move --port none", "expected one of --to and --by"),
        case("servo move --to 1 --by 1 --port none", "expected one of --to and --by"),
        case("servo move --to 9999 --port none", "--to is 9999 °, expected -3600 to 3600 °"),
        case("servo move --to 1 --speed 999 --port none", "--speed is 999 °/s"),
        case("servo move --by 1 --joint l_knee --port none", "--robot and --joint together"),
        case("servo move --by 1 --robot op3 --id 1 --port none", "expected --joint"),
        case("servo move --by 1 --robot op3 --joint tail --port none", "unknown joint 'tail'"),
        case("servo move --by 1 --port a,b", "--port is a,b, expected one serial port"),
        case("servo monitor --port none --seconds 1", "port none", "does not exist"),
        case("servo setup --port none", "standard input is not a terminal"),
        case(
            "servo setup --port a,b", "--port is a, b, expected for robot 'op3': --port main=PATH"
        ),
        case("bus --faults none.toml", "none.toml"),
        case("bus --faults /dev/zero", "/dev/zero", "it is a device, expected a file"),
        case("replay /dev/zero", "/dev/zero", "it is a device, expected a file"),
        case("bus --faults text.txt", "text.txt"),
        case("bus --faults wrong.toml", "wrong.toml"),
        case("bus --faults folder", "folder"),
        case("bus --link none/port", "none/port"),
        case("bus --from none.json", "posture file none.json is missing"),
    ],
    "posture files": [
        case("rise --from none.json", "posture file none.json is missing"),
        case("rise --from empty.json", "posture file empty.json: not JSON"),
        case("rise --from text.txt", "posture file text.txt: not JSON"),
        case("rise --from list.json", "posture file list.json"),
        case("rise --from supine --key no_knee.json", "joint 'l_knee' is missing"),
        case("rise --from nan_knee.json", "joint_pos.l_knee is nan", "finite"),
        case("rise --from stretched.json", "length 2.0000"),
        case("rise --from bent.json", "joint 'l_knee' is +9.000 rad", "[-1.798, +2.478] rad"),
        case("rise --from sunk.json", "100.0 mm into the ground"),
        case("rise --from high.json", "above the ground"),
        case("rise --from far.json", "position is 1e+200 m", "1000 m"),
        case("rise --from binary.json", "posture file binary.json: not UTF-8 text"),
        case("rise --from deep.json", "posture file deep.json", "nested too deep"),
        case("rise --from unreadable", "unreadable: Permission denied"),
        case("rise --from folder", "posture file folder: Is a directory"),
        case(f"play {MOTION} --from bent.json", "joint 'l_knee' is +9.000 rad"),
        case("run robust --from sunk.json", "100.0 mm into the ground"),
        case("calibrate --port none --yes --at bent.json", "joint 'l_knee' is +9.000 rad"),
    ],
    "motion files": [
        case("play none.npz", "none.npz", "No such file"),
        case("play empty.npz", "motion file empty.npz"),
        case("play text.npz", "motion file text.npz"),
        case("play half.npz", "motion file half.npz"),
        case("play flipped.npz", "motion file flipped.npz"),
        case("play pickled.npz", "motion file pickled.npz"),
        case("play other.npz", "made for 'nao' with 20 joints", "'op3' with 20"),
        case("motions show other.npz", "made for 'nao' with 20 joints"),
        case("preflight folder.npz", "motion file folder.npz"),
        case("rise --robot broken_motion --from supine", "broken_motion/motions/broken.npz"),
        case("rise --robot no_motions --from supine", "robot 'op3' has no motions"),
        case("motions build --robot wrong_keyframes", "wrong_keyframes/keyframes.toml"),
        case("motions build --robot no_keyframes", "no_keyframes/keyframes.toml is missing"),
    ],
    "keys": [
        case("motions import none.csv", "none.csv: No such file or directory"),
        case("motions import folder", "folder: a file of another kind, expected an action file"),
        case("motions import text.txt", "text.txt: a file of another kind, expected an action"),
        case("motions import text.csv", "text.csv: no keys, expected a header and one row or more"),
        case("motions import tail.csv", "unknown joint 'l_tail', expected r_sho_pitch"),
        case("motions import bent.csv", "joint 'l_knee' of key number 1 is +515.662 deg", "--clip"),
        case("motions import empty.json", "empty.json: not JSON"),
        case("motions import list.json", "list.json: expected an object with keyframes"),
        case("motions import no_knee.json", "keyframes is missing, expected a list of tables"),
        case("motions import short.bin", "short.bin: has 15 bytes, expected 131072"),
        case("motions import actions.bin", "--page is missing, expected one of 3 wave, 5 wave"),
        case("motions import actions.bin --page 9", "page 9 is empty, expected one with steps"),
        case("motions import actions.bin --page 4", "page 4 is damaged: its bytes sum to"),
        case("motions import actions.bin --page 5", "has id 2 at 5000 ticks, expected 0 to 4095"),
        case("motions import actions.bin --page 300", "--page is 300, expected 1 to 255"),
        case("motions import actions.bin --page 3,3", "--page has '3' twice, expected each once"),
        case("motions import actions.bin --page 3,4 --name wave", "--name is given with 2 pages"),
        case("motions import kick.csv --page 3", "--page is given, expected an action file"),
        case("motions import kick.csv --name a/b", "name 'a/b': expected up to 100 letters"),
        case("motions import kick.csv --start upside", "--start is 'upside', expected supine"),
        case("motions import kick.csv --out folder", "output file folder: is a folder"),
        case("motions import kick.csv --out wrong.toml", "wrong.toml: motions is missing"),
        case(
            f"motions import kick.csv --name {MOTION} --start supine --robot no_motions",
            f"motion '{MOTION}' is there already, expected another name",
        ),
        case("motions preview moonwalk", "unknown motion 'moonwalk', expected squat_to_stand"),
        case("motions preview wave --keyframes none.toml", "none.toml: No such file or directory"),
        case("motions preview wave --keyframes wrong.toml", "wrong.toml: motions is missing"),
        case(f"motions preview {MOTION} --picture folder", "output file folder: is a folder"),
        case("motions record wave --backend dynamixel", "--backend dynamixel requires --port"),
        case("motions record a/b", "name 'a/b': expected up to 100 letters"),
        case(f"motions record {MOTION}", f"motion '{MOTION}' is there already, expected another"),
        case("motions record wave --out folder", "output file folder: is a folder"),
        case(
            "motions build --robot twice_keyframes",
            "motion 'wave' is there twice",
            "key number 1: both: unknown joint 'nee', expected sho_pitch",
        ),
        case("motions build --robot bent_keyframes", "joint 'l_knee' of key number 1 is +900.000"),
        case(
            f"motions build {MOTION} --resume --robot broken_search",
            f"{MOTION}.jsonl: not JSON",
        ),
    ],
    "policy files": [
        case("run none.onnx --from supine", "none.onnx", "No such file"),
        case("run empty.onnx --from supine", "policy file empty.onnx"),
        case("run text.onnx --from supine", "policy file text.onnx"),
        case("run half.onnx --from supine", "policy file half.onnx"),
        case("run folder.onnx --from supine", "folder.onnx: Is a directory"),
        case("run unfit.onnx --from supine", "unfit.onnx is of robot 'nao'", extra="onnx"),
        case("run unfit.onnx --from left --robot op3", "made for 'nao'", extra="onnx"),
        case("run bare.onnx --from supine", "bare.onnx", extra="onnx"),
    ],
    "flight logs": [
        case("replay none.mcap", "none.mcap"),
        case("replay empty.mcap", "empty.mcap"),
        case("replay text.txt", "text.txt"),
        case("replay folder", "folder"),
        case("motions export none --trajectory t.yaml", "none"),
        case("motions export other.npz --trajectory t.yaml", "made for 'nao' with 20 joints"),
        case("motions import nowhere.yaml", "nowhere.yaml", extra="yaml"),
        case("motions import torn.yaml", "torn.yaml: not YAML", extra="yaml"),
        case("motions import text.yaml", "expected joint_names and points of", extra="yaml"),
        case("motions import tail.json", "unknown joint 'l_tail', expected r_sho_pitch"),
        case("motions import short.json", "point 2 has 1 positions, expected 2"),
        case("motions import late.json", "point 2: time_from_start is 1 s, expected after 1 s"),
        case("motions import nan.json", "positions is [nan], expected a list of finite numbers"),
        case("motions import nameless.json", "joint_names is missing, expected"),
        case("log export none.mcap --rosbag2 bag", "flight log none.mcap: No such file"),
        case("log export text.txt --rosbag2 bag", "text.txt: not an MCAP file"),
        case("log export foreign.mcap --rosbag2 bag", "damaged (it does not name its robot)"),
        case("log export nameless.mcap --rosbag2 bag", "it does not name its joints, expected"),
        case("log export nao.mcap --rosbag2 bag", "nao.mcap is of robot 'nao': give its folder"),
        case("log export nao.mcap --rosbag2 bag --robot op3", "of robot 'nao', expected 'op3'"),
    ],
    "robot folders": [
        case("robots check nao", "unknown robot 'nao'", "op3"),
        case("robots check not_toml", "not_toml/robot.toml"),
        case("robots check one_legged", "'op3' has no two legs with a knee, expected a left and"),
        case("robots check op3 --picture folder", "output file folder: is a folder"),
        case("motions discover quick --robot tiny", "unknown policy 'quick'", extra="onnx"),
        case("motions discover styled --robot op3", "follows style curves", extra="onnx"),
        case("motions discover quick --robot op3 --rises 1", "--rises is 1", extra="onnx"),
        case("motions discover --robot op3 --rises 9", "--rises is given, expected none without"),
        case("motions discover quick --robot op3 --budget 9", "--budget is given, expected none"),
        case("motions discover --robot op3 --sides right", "--sides is 'right', expected supine"),
        case("motions discover --robot op3 --budget 0", "--budget is 0 s, expected 1 to"),
        case("motions discover --robot op3 --resume", "there is no search to resume"),
        case("motions discover --robot one_legged", "no two legs with a knee"),
        case("motions retarget --robot op3", "--source is op3, the robot itself"),
        case("motions retarget --robot tiny --source nao", "unknown robot 'nao'"),
        case("motions retarget moonwalk --robot no_keyframes", "unknown motion 'moonwalk'"),
        case("motions retarget --robot one_legged", "no two legs with a knee"),
        case("motions retarget --robot tiny --source no_keyframes", "keyframes.toml is missing"),
        case("motions list --robot folder", "unknown robot 'folder'"),
        case("motions list --robot not_toml", "not_toml/robot.toml: not TOML"),
        case("motions list --robot not_text", "not_text/robot.toml: not UTF-8 text"),
        case("motions list --robot no_model", "no_model/model.xml"),
        case("motions list --robot not_xml", "not_xml/model.xml: not XML"),
        case("motions list --robot wrong_joint", "wrong_joint/robot.toml", "l_tail"),
        case(
            "motions list --robot wrong_limit",
            'limit_by is "current", expected "pwm": the XL430-W250 of joint \'r_sho_pitch\'',
        ),
        case("motions list --robot no_limit", "limit_by is 'hope', expected current, pwm"),
        case("rise --robot wrong_calibration --from supine", "wrong_calibration/calibration.toml"),
        case("calibrate --robot wrong_calibration --port none", "calibration.toml"),
    ],
    "model files": [
        case("robots import nowhere.xml --out new", "nowhere.xml: No such file", "MJCF or URDF"),
        case("robots import text.txt --out new", "text.txt: not XML"),
        case("robots import scene.sdf --out new", "its root is <sdf>, expected <mujoco> (MJCF)"),
        case("robots import one_leg.xml --out new", "expected two legs of at least 3 hinges"),
        case("robots import hangs.xml --out new", "hangs on the world by hinge 'string'"),
        case(
            "robots import mm.urdf --out new",
            "expected 0.1 to 3 m: lengths are in m, these look like mm",
        ),
        case("robots import degrees.urdf --out new", "at most 12.6 rad", "of a URDF are in rad"),
        case(
            "robots import meshes.urdf --out new",
            "mesh 'torso.stl' of link 'torso' is not found, expected it beside the model",
        ),
        case(
            "robots import many.xml --out new", "1000000000 copies of parts, expected at most 3000"
        ),
        case("robots import nan.xml --out new", "<geom> has mass 'nan', expected finite numbers"),
        case("robots import pipe.urdf --out new", "it is a FIFO, expected a file"),
        case("robots import light.urdf --out new", "link 'torso' has a mass of -1 kg"),
        case("robots import mimic.urdf --out new", "mimics 'tail', expected another joint"),
        case(
            "robots import effort.urdf --out new", "effort of <limit> is 'nan', expected a finite"
        ),
        case("robots import small.xml --out new --name ' '", "--name is ' ', expected a name of 1"),
        case("robots import small.xml --out new --name ../x", "--name is '../x', expected a name"),
        case("robots import small.xml --out ' '", "--out is ' ', expected a name of", "or --name"),
        case("robots import small.xml --out taken", "--out is taken, which is not empty"),
        case("robots import small.xml --out new --servo XM1", "--servo is 'XM1': unknown type"),
        case(
            "robots import small.xml --out new --servo XM430-W350=*tail",
            "no joint matches '*tail', expected some of left_hip_yaw_joint",
        ),
        case("robots import small.xml --out new --fix tail", "--fix is 'tail', expected one of"),
        case("robots import small.xml --out new --servo ''", "--servo is empty, expected a name"),
        case("robots import small.xml --out new --fix ,", "--fix is ',', expected a name between"),
    ],
    "outputs": [
        case("replay empty.mcap --json empty.mcap", "--json: empty.mcap is read, too, expected"),
        case("robots check tiny --picture tiny/model.xml", "model.xml is a file of the robot"),
        case("robots check tiny --json ./tiny/../tiny/robot.toml", "robot.toml is a file of the"),
        case(
            "preflight squat_to_stand --robot broken_motion "
            "--json broken_motion/motions/squat_to_stand.npz",
            "squat_to_stand.npz is a file of the robot, expected another file",
        ),
        case(
            "motions show squat_to_stand --robot broken_motion "
            "--picture broken_motion/motions/squat_to_stand.npz",
            "squat_to_stand.npz is a file of the robot, expected another file",
        ),
        case("style show kneeling.toml --json kneeling.toml", "--json: kneeling.toml is read, too"),
        case("style show few.toml short.toml --picture short.toml", "short.toml is read, too"),
        case("style edit few.toml --slower 2 --out few.toml", "--out: few.toml is read, too"),
        case("play whole.npz --json whole.npz", "--json: whole.npz is read, too"),
        case("play path.npz --json same.npz", "--json: same.npz is read, too"),
        case("preflight whole.npz --json whole.npz", "--json: whole.npz is read, too"),
        case("scenes ball.toml --picture ball.toml", "--picture: ball.toml is read, too"),
        case("plan --from bent.json --json bent.json", "--json: bent.json is read, too"),
        case(
            "plan --from prone --key far.json,bent.json --json bent.json", "bent.json is read, too"
        ),
        case("run half.onnx --from supine --json half.onnx", "--json: half.onnx is read, too"),
        case("eval robust --scene flat,ball.toml --json ball.toml", "ball.toml is read, too"),
        case("mocap import human.bvh --json human.bvh", "--json: human.bvh is read, too"),
        case("mocap import human.bvh --out same.npz --json same.npz", "--out and --json are both"),
        case("play whole.npz --out new --json new/report.json", "are both new/report.json"),
        case("rise --from supine --out text.txt", "text.txt is not a folder"),
        case("rise --from supine --out text.txt/below", "text.txt is not a folder"),
        case("rise --from supine --out loop", "loop is not a folder"),
        case("rise --from supine --out taken", "output file taken/report.json: is a folder"),
        case("rise --from supine --out " + "x" * 300, "File name too long"),
        case("rise --from supine --out new/" + "x" * 300, "File name too long"),
        case("rise --from supine --out /proc/rise", "/proc/rise"),
        case("rise --from supine --json /proc/figures.json", "/proc"),
        case("rise --from supine --json folder", "output file folder: is a folder"),
        case("rise --from supine --json ''", "the name of a file"),
        case("rise --from supine --json text.txt/below", "text.txt is not a folder"),
        case("robots --json folder", "output file folder: is a folder"),
        case("robots --json /dev/full", "output file /dev/full: No space left on device"),
        case("motions list --json circle", "output file circle"),
        case("motions list --json " + "x" * 300, "File name too long"),
        case("motions show squat_to_stand --picture folder", "folder: is a folder"),
        case("motions show squat_to_stand --picture /proc/strip.png", "/proc"),
        case("replay empty.mcap --out text.txt", "text.txt is not a folder"),
        case("motions export squat_to_stand --trajectory folder.yaml", "folder.yaml: is a folder"),
        case("motions export squat_to_stand --trajectory t.csv", "ends with .yaml, .yml or .json"),
        case("motions export squat_to_stand", "expected either --trajectory or --csv"),
        case(
            "motions export squat_to_stand --trajectory t.json --approach -1", "--approach is -1 s"
        ),
        case("robots export op3 --ros2-control taken", "is taken, which is not empty, expected"),
        case("robots export op3 --ros2-control text.txt", "text.txt is not a folder, expected"),
        case("robots export human --ros2-control new", "'human' has no servo bus: add a [bus]"),
        case("robots export nao --ros2-control new", "unknown robot 'nao'", "op3"),
        case("robots export op3 --ros2-control new --limit-by ideal", "which no servo can"),
        case("robots export op3 --ros2-control new --torque-limit 9", "expected at most 4.1 N·m"),
        case("robots export op3", "--ros2-control DIR is missing"),
        case("log export nao.mcap --rosbag2 taken", "--rosbag2 is taken, which is not empty"),
        case("log export nao.mcap --rosbag2 text.txt", "text.txt is not a folder, expected a"),
        case("eval robust --n 4 --falls text.txt/below", "text.txt is not a folder"),
        case("export folder --out text.txt/below", "text.txt is not a folder"),
        case("doctor --port none --json folder", "folder: is a folder"),
        case("servo list --port none --json folder", "folder: is a folder"),
    ],
}


def make_files(folder: Path, robot: Robot) -> None:
    """Make the damaged and wrong files that the cases name."""
    (folder / "folder").mkdir()
    (folder / "taken" / "report.json").mkdir(parents=True)
    (folder / "loop").symlink_to("nowhere")
    (folder / "circle").symlink_to("circle")
    for name in ("folder.npz", "folder.onnx"):
        (folder / name).mkdir()
    for suffix in ("npz", "onnx", "mcap", "json"):
        (folder / f"empty.{suffix}").touch()
    for name in ("text.txt", "text.npz", "text.onnx"):
        (folder / name).write_text("no numbers here")
    (folder / "wrong.toml").write_text('[[fault]]\nkind = "earthquake"\nat = -1\n')
    (folder / "ball.toml").write_text(
        "[ground]\nfrictoin = 1\n[[spheres]]\nname = 'ball'\ncenter = [0, 0, 0]\nradius = -1\n"
    )
    (folder / "cave.toml").write_text(
        "[[boxes]]\nname = 'roof'\ncenter = [0, 0, 1]\nsize = [50, 50, 0.1]\n"
        "[[starts]]\nlying = 'supine'\nz = [0, 0.8]\nsettled = true\n"
    )
    (folder / "sole.toml").write_text(
        "[[spheres]]\nname = 'l_sole'\ncenter = [0, 0, 0]\nradius = 1\n"
    )
    (folder / "off.toml").write_text(
        "[ground]\nheights = [[0, 1], [0, 0]]\n[[starts]]\nlying = 'prone'\nx = [2, 3]\n"
    )
    (folder / "begun").mkdir()
    (folder / "begun" / "benchmark.jsonl").write_text("half a piece")
    _make_styles(folder)
    (folder / "upside.toml").write_text("[[starts]]\nlying = 'left'\nz = [1, 0]\n")
    (folder / "same.npz").symlink_to("path.npz")
    (folder / "unreadable").write_text("{}")
    (folder / "unreadable").chmod(0)
    _make_postures(folder, robot)
    _make_motions(folder, robot)
    _make_logs(folder)
    _make_trajectories(folder)
    _make_keys(folder)
    _make_policies(folder, robot)
    _make_robots(folder, robot)
    _make_models(folder)


def _make_logs(folder: Path) -> None:
    """Make logs of other programs, without joint names, and of another robot."""
    nameless = {"format": "1", "robot": "op3", "period": "0.008", "started": ""}
    nao = nameless | {"robot": "nao", "joint_names": '["knee"]', "about": "{}", "start": ""}
    for name, about in (("foreign", None), ("nameless", nameless), ("nao", nao)):
        with (folder / f"{name}.mcap").open("wb") as file:
            writer = Writer(file)
            writer.start()
            if about:
                writer.add_metadata("flight", about)
            writer.finish()


def _make_trajectories(folder: Path) -> None:
    """Make trajectories of ROS with one fault each."""
    (folder / "folder.yaml").mkdir()
    (folder / "torn.yaml").write_text("joint_names: [l_knee")
    (folder / "text.yaml").write_text("no numbers here")

    def point(second: int, *angles: float) -> dict[str, object]:
        return {"positions": angles, "time_from_start": {"sec": second}}

    knee, both = ["l_knee"], ["l_knee", "r_knee"]
    for name, joints, points in (
        ("tail", ["l_tail"], [point(0, 0.0)]),
        ("short", both, [point(0, 0.0, 0.0), point(1, 0.0)]),
        ("late", knee, [point(1, 0.0), point(1, 0.5)]),
        ("nan", knee, [point(0, math.nan)]),
        ("nameless", None, [point(0, 0.0)]),
    ):
        content = {"points": points} | ({"joint_names": joints} if joints else {})
        (folder / f"{name}.json").write_text(json.dumps(content))


def _make_models(folder: Path) -> None:
    def cut_leg(spec: mujoco.MjSpec) -> None:
        spec.delete(spec.body("right_hip_yaw"))

    def hang(spec: mujoco.MjSpec) -> None:
        torso = spec.body("torso")
        spec.delete(torso.joints[0])
        torso.add_joint(name="string", type=mujoco.mjtJoint.mjJNT_HINGE)

    os.mkfifo(folder / "torso.obj")
    urdf, end = small_urdf(), small_urdf().rindex("</joint>")
    for name, text in {
        "many.xml": small_humanoid().replace(
            "<worldbody>", '<worldbody><replicate count="1000000000"><site/></replicate>'
        ),
        "nan.xml": small_humanoid().replace('mass="1"', 'mass="nan"'),
        "pipe.urdf": small_urdf(mesh="torso.obj"),
        "light.urdf": urdf.replace('mass value="1.0"', 'mass value="-1"'),
        "mimic.urdf": f'{urdf[:end]}<mimic joint="tail"/>{urdf[end:]}',
        "effort.urdf": urdf.replace('effort="4.1"', 'effort="nan"', 1),
        "small.xml": small_humanoid(),
        "scene.sdf": "<sdf/>",
        "one_leg.xml": small_humanoid(change=cut_leg),
        "hangs.xml": small_humanoid(change=hang),
        "mm.urdf": small_urdf(scale=1000.0),
        "degrees.urdf": small_urdf().replace(f'upper="{np.pi / 2.0}"', 'upper="90"'),  # the head's
        "meshes.urdf": small_urdf(mesh="torso.stl"),
    }.items():
        (folder / name).write_text(text)


def _make_styles(folder: Path) -> None:
    for name in ("text.bvh", "text.amc"):
        (folder / name).write_text("no numbers here")
    rise, right = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0], [90] * 9

    def save(
        name: str, *, height: object = rise, side: object = right, duration: float = 5
    ) -> None:
        (folder / name).write_text(
            f"leg_length = 0.9\nduration = {duration}\n[[curves]]\nneck_height = {height}\n"
            f"side_deg = {side}\nfront_deg = {right}\n"
        )

    save("few.toml", height=[0.2, 1.0])
    save("kneeling.toml", height=[*rise[:8], 0.6])
    save("wide.toml", side=[200, *right[1:]])
    save("falling.toml", duration=-5)
    save("texts.toml", height=list(map(str, rise)))
    save("short.toml", duration=0.01)
    clip = BVH.replace("OFFSET 0 -100 0", "OFFSET 0 0 -100").replace(
        "OFFSET 0 50 0", "OFFSET 0 0 50"
    )
    (folder / "turned.bvh").write_text(clip)
    (folder / "scaled.bvh").write_text(BVH.replace("Xposition", "Xscale"))
    (folder / "upright.bvh").write_text(BVH)
    write_human_bvh(folder / "human.bvh", 3)
    write_human_bvh(folder / "short.bvh", 1)
    write_human_bvh(folder / "headless.bvh", 3, without="Neck")
    (folder / "empty.bvh").touch()


def _make_postures(folder: Path, robot: Robot) -> None:
    def save(name: str, **changes: object) -> None:
        record = json.loads(format_posture(robot.standing, robot))
        knee = changes.pop("l_knee", 0.0)
        record["joint_pos"]["l_knee"] = knee
        if knee is None:
            del record["joint_pos"]["l_knee"]
        (folder / name).write_text(json.dumps(record | changes))

    x, y, z = robot.standing.position
    save("no_knee.json", l_knee=None)
    save("nan_knee.json", l_knee=float("nan"))
    save("bent.json", l_knee=9.0)
    save("stretched.json", orientation=[2.0, 0.0, 0.0, 0.0])
    save("high.json", position=[x, y, z + 5.0])
    save("far.json", position=[1e200, y, z])
    standing = json.loads(format_posture(robot.standing, robot))
    standing["position"] = [x, y, z - 0.1]
    (folder / "sunk.json").write_text(json.dumps(standing))
    (wall,) = load_scene("wall", robot).obstacles
    save("walled.json", position=[x, float(wall.position[1]), z])
    crossed = json.loads(format_posture(robot.standing, robot))
    crossed["joint_pos"]["l_hip_roll"] = 0.5
    (folder / "tangled.json").write_text(json.dumps(crossed))
    (folder / "list.json").write_text("[]")
    (folder / "binary.json").write_bytes(b"\xff\xfe\x00")
    (folder / "deep.json").write_text("[" * 100_000)


def _make_motions(folder: Path, robot: Robot) -> None:
    file = robot.folder / "motions" / f"{MOTION}.npz"
    whole = file.read_bytes()
    (folder / "whole.npz").write_bytes(whole)
    (folder / "half.npz").write_bytes(whole[: len(whole) // 2])
    middle = len(whole) // 2
    flipped = bytes(byte ^ 0xFF for byte in whole[middle : middle + 64])
    (folder / "flipped.npz").write_bytes(whole[:middle] + flipped + whole[middle + 64 :])
    np.savez(folder / "pickled.npz", time=np.array([{}], dtype=object))
    motion = Motion.load(file)
    fields = {name: getattr(motion, name) for name in motion.__dataclass_fields__}
    Motion(**{**fields, "robot": "nao"}).save(folder / "other.npz")
    Motion(**{**fields, "provenance": {"body": "arms=1.6"}}).save(folder / "long_arms.npz")
    Motion(**{**fields, "name": "path", "end_class": "other"}).save(folder / "path.npz")


def _make_keys(folder: Path) -> None:
    (folder / "text.csv").write_text("no numbers here")
    (folder / "tail.csv").write_text("time,l_tail\n0,1\n")
    (folder / "bent.csv").write_text("time,l_knee\n0,9\n")
    (folder / "kick.csv").write_text("time,l_knee\n0,1\n1,2\n")
    (folder / "short.bin").write_text("no numbers here")
    at_rest = dict.fromkeys(range(1, 21), 2048)
    pages = {3: [Slot(at_rest)], 4: [Slot(at_rest)], 5: [Slot(at_rest | {2: 5000})]}
    write_action_file(folder / "actions.bin", pages)
    content = bytearray((folder / "actions.bin").read_bytes())
    content[4 * 512 + 100] ^= 1
    (folder / "actions.bin").write_bytes(content)


def _make_policies(folder: Path, robot: Robot) -> None:
    whole = (robot.folder / "policies" / "robust.onnx").read_bytes()
    (folder / "half.onnx").write_bytes(whole[: len(whole) // 2])
    with contextlib.suppress(ModuleNotFoundError):
        from tiny_policies import contract_of, save_policy

        contract = contract_of(robot, robot="nao", mode="torque").to_json()
        save_policy(folder / "unfit.onnx", robot, contract=contract)
        save_policy(folder / "bare.onnx", robot, contract=None)
        _make_foreign_policies(folder)


def _make_foreign_policies(folder: Path) -> None:
    from foreign_policies import ENV, mjlab_metadata, save_network, weights

    (folder / "trace.json").write_text('{"robot": "op3", "joints": ["head_pan"]}')
    (folder / "their.pt").write_bytes(b"PK\x03\x04 and code")
    (folder / "endless.yaml").write_text(ENV.replace("left_hip_joint:", "(j+)+x:"))
    (folder / "loop.yaml").write_text("a: &a [*a]\n")
    for name, changes in {
        "their": {},
        "stiff": {"joint_stiffness": "1.000,1.000,1.000"},
        "blind": {"observation_names": "base_lin_vel,joint_pos"},
    }.items():
        save_network(folder / f"{name}.onnx", weights(), mjlab_metadata(**changes))


def _make_robots(folder: Path, robot: Robot) -> None:
    def copy(name: str, *left_out: str) -> Path:
        ignore = shutil.ignore_patterns("policies", *left_out)
        return Path(shutil.copytree(robot.folder, folder / name, ignore=ignore))

    (copy("broken_motion") / "motions" / "broken.npz").write_bytes(b"PK\x03\x04 and no more")
    copy("no_motions", "motions")
    copy("no_keyframes", "motions", "keyframes.toml")
    (copy("wrong_keyframes", "motions") / "keyframes.toml").write_text("motions = 3")
    wave = (
        "[[motions]]\nname = 'wave'\nstart = 'supine'\nstrategy = 'wave'\nstand_after = 1\n"
        "torque_limit = 1\nkeys = [{ both = { knee = 900 } }]\n"
    )
    twice = 2 * wave.replace("knee", "nee")
    (copy("twice_keyframes", "motions") / "keyframes.toml").write_text(twice)
    (copy("bent_keyframes", "motions") / "keyframes.toml").write_text(wave)
    search = copy("broken_search", "motions") / "unfinished"
    search.mkdir()
    (search / f"{MOTION}.jsonl").write_text("{")
    toml = copy("one_legged", "motions", "keyframes.toml") / "robot.toml"
    text = toml.read_text("utf-8").replace('["l_sole", "r_sole"]', '["l_sole"]')
    toml.write_text(text, "utf-8")
    shutil.copytree(TINY, folder / "tiny")
    shutil.copytree(NODDING, folder / "nodding")
    (copy("not_toml", "motions") / "robot.toml").write_text("name = ")
    (copy("not_text", "motions") / "robot.toml").write_bytes(b"\xff\xfe")
    (copy("no_model", "motions") / "model.xml").unlink()
    (copy("not_xml", "motions") / "model.xml").write_text("<mujoco")
    model = copy("other_solver", "motions") / "model.xml"
    text = model.read_text("utf-8").replace("<option ", '<option solver="PGS" ', 1)
    model.write_text(text, "utf-8")
    toml = copy("wrong_joint", "motions") / "robot.toml"
    toml.write_text(toml.read_text("utf-8").replace('"l_knee"', '"l_tail"'), "utf-8")
    limit, servos = 'limit_by = "current"', ("XM430-W350", "XL430-W250")
    for name, limit_by, replaced in (
        ("other_servos", 'limit_by = "pwm"', servos),
        ("wrong_limit", limit, servos),
        ("no_limit", 'limit_by = "hope"', servos[:1] * 2),
    ):
        toml = copy(name) / "robot.toml"
        text = toml.read_text("utf-8").replace("supply_voltage = 12.0", "supply_voltage = 11.1")
        toml.write_text(text.replace(limit, limit_by).replace(*replaced), "utf-8")
    (copy("wrong_calibration") / "calibration.toml").write_text("joints = 3")
    row = '[[bench]]\nid = 1\nservo = "XL430-W250"\n'
    for name, rows in (("desk", row), ("bad-desk", 2 * row)):
        (folder / name).mkdir()
        (folder / name / "robot.toml").write_text(f'name = "desk"\n[bus]\nbaud = 57600\n{rows}')


def is_possible(case: Case) -> bool:
    """Return whether a case can be tried here: root reads every file, some packages are extras."""
    if case.extra is not None and importlib.util.find_spec(case.extra) is None:
        return False
    return os.geteuid() != 0 or "unreadable" not in case.command


def run(case: Case) -> tuple[int, str, str]:
    """Run a case in this process; return exit code, standard output, standard error."""
    from humanoid_getup.commands.main import main

    out, error = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(error):
        code = main(shlex.split(case.command))
    return code, out.getvalue(), error.getvalue()
