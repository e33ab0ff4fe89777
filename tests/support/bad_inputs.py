"""Bad input to every command: what is given, and what the one line says."""

from __future__ import annotations

import contextlib
import importlib.util
import io
import json
import math
import os
import re
import shlex
import shutil
from dataclasses import dataclass, replace
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


TABLE = """
# options
rise --from supine --robot nao | unknown robot 'nao' | op3
rise --from supine --robot '' | unknown robot
rise --from supine --scene moon | unknown scene 'moon' | flat
rise --from supine --scene slope:50 | scene slope:50 | from -30 to 30
rise --from supine --scene beam | scene 'beam' has no start supine, expected prone
rise --from prone --scene ball.toml
    | unknown key ground.frictoin | sphere 'ball': radius is -1, expected above 0
rise --from supine --scene cave.toml
    | scene 'cave' has no place within 1.4 m of the start where 'op3' could stand
rise --from supine --scene nowhere.toml | nowhere.toml: No such file
scenes sole.toml | obstacle 'l_sole' has the name of a part of robot 'op3'
plan --from prone --scene off.toml | start 'prone': x is 2 to 3, expected
scenes upside.toml | start 'left': z is 1 to 0, expected the lower number
motions build a a | NAMES has 'a' twice, expected each once
rise --from supine --bogus 1 | unknown option '--bogus': see getup rise --help
rise --form supine | unknown option '--form', expected --from
rise --from | --from has no value, expected one
rise --balance yes | unknown argument 'yes'
run robust --body arms=2 | '--body', which getup rise, getup play | has
motions retarget | --robot STR is missing
bench all --n 0 | --n is 0, expected 1 to 1000000
bench all --limit-by luck | --limit-by is 'luck', expected current, pwm or ideal
bench all --out text.txt | text.txt is not a folder
bench all --out begun --quick --resume | benchmark.jsonl | is no ledger
play squat_to_stand --without-imu | robot 'op3' has an IMU (board) | neither [imu] nor [bus.board]
play squat_to_stand --without-imu --then sit | --then is sit, expected hold or limp
play squat_to_stand --without-imu --scene wall | --scene is wall, expected flat
scenes moon | unknown scene 'moon'
scenes wall --picture folder | output file folder: is a folder
rise --from supine --at 0,0,90 | --at is given, expected a real robot
rise --backend dynamixel --port none --scene wall
    | --scene wall on a real robot requires --at X,Y,DEG
rise --from upside | unknown start 'upside' | supine, prone, left, right
rise | --from is missing | supine, prone, left, right
rise --from supine --backend gazebo | --backend is 'gazebo', expected twin, virtual or dynamixel
rise --from supine --then drop | --then is 'drop', expected hold, sit, limp or hand-over
hold --then hold | --then is 'hold', expected sit, limp or hand-over
watch --backend dynamixel | --backend dynamixel requires --port
watch --seconds 0 | --seconds is 0 s, expected 0.001 to 1e+06 s
watch --from upside | unknown start 'upside' | supine, prone, left, right
watch --backend dynamixel --port /dev/x --from prone | --from is 'prone', expected
sit --backend dynamixel | --backend dynamixel requires --port
play sit_and_lie_down | ends lying supine | one that ends standing
rise --from supine --method luck | --method is 'luck', expected plan, policy
rise --from supine --attempts 0 | --attempts is 0, expected 1 to 1000000
rise --from supine --attempts 1.5 | --attempts is '1.5', expected a whole number
rise --from supine --seed -1 | --seed is -1, expected 0 to 92
rise --from supine --seed x | --seed is 'x', expected a whole number
rise --from supine --torque-limit 0 | --torque-limit is 0 N·m, expected 0.001 to
rise --from supine --torque-limit -2.5 | --torque-limit is -2.5 N·m
rise --from supine --torque-limit nan | --torque-limit is nan N·m
rise --from supine --torque-limit inf | --torque-limit is inf N·m
rise --from supine --torque-limit much | --torque-limit is 'much' | a number
rise --from supine --seed -1 --torque-limit 0 | --seed is -1 | --torque-limit is 0
rise --from supine --torque-limit 4.2
    | torque limit is 4.2 N·m, expected at most 4.1 N·m, the stall torque
rise --from supine --torque-limit 0.003
    | torque limit is 0.003 N·m, expected at least 0.0048 N·m, one count of the servos
rise --from supine --policy robust | --policy is robust, expected --method policy or auto with it
rise --from supine --method policy --prefer torque --search-budget 5
    | --prefer torque and --search-budget: expected --method plan or auto
rise --from supine --no-filtering --prefer impact
    | --prefer impact: expected filtering, not --no-filtering
rise --from supine --prefer luck
    | --prefer is 'luck', expected time, torque, impact, robustness or natural
rise --from supine --search-budget 0 | --search-budget is 0 s, expected 0.001 to
rise --from supine --search-budget nan | --search-budget is nan s
rise --from supine --search-budget long | --search-budget is 'long' | a number
bench rise --prefer luck | --prefer is 'luck'
bench rise --search-budget -1 | --search-budget is -1 s
motions build --prefer luck | --prefer is 'luck', expected time, torque
rise --from supine --limit-by luck | --limit-by is 'luck', expected current, pwm
rise --from supine --backend virtual --limit-by ideal | --limit-by is ideal, which no servo can
rise --robot other_servos --from supine --limit-by current
    | by 'current', expected 'pwm' | XL430-W250
bench rise --limit-by torque | --limit-by is 'torque'
eval robust --n 4 --torque-limit 9 | torque limit is 9 N·m | at most 4.1 N·m
play moonwalk | unknown motion 'moonwalk' | squat_to_stand | .npz
play squat_to_stand --from upside | unknown start 'upside'
play squat_to_stand --torque-limit 0 | --torque-limit is 0 N·m
run moonwalk --from supine | unknown policy 'moonwalk' | robust | .onnx
run robust | --from is missing
run robust --from supine --longest 0 | --longest is 0 s, expected 0.001 to 1e+06 s
run robust --from supine --longest nan | --longest is nan s
rise --from supine --method policy --policy moonwalk | unknown policy 'moonwalk'
motions list --robot nao | unknown robot 'nao'
motions show moonwalk | unknown motion 'moonwalk'
motions build moonwalk | unknown motion 'moonwalk' | squat_to_stand
preflight squat_to_stand --voltage 1e-320 | --voltage is 1e-320 V, expected 1 to
rise --from supine --seed 999999999999999999999999999999 | expected 0 to 9223372036854775807
motions build --engine local:0 | --engine is 'local:0', expected 1 to 256 workers
motions build --generations -3 | --generations is -3, expected 1 to 1000000
motions build --seed -1 | --seed is -1
motions build --seed 99999999999 | --seed is 99999999999, expected 0 to
preflight moonwalk | unknown motion 'moonwalk'
preflight squat_to_stand --voltage 0 | --voltage is 0 V, expected 1 to 100 V
preflight squat_to_stand --voltage nan | --voltage is nan V
preflight squat_to_stand --temperature inf | --temperature is inf °C | -50 to 150 °C
preflight squat_to_stand --torque-limit -1 | --torque-limit is -1 N·m
replay empty.mcap --threshold 0 | --threshold is 0 rad, expected 1e-09 to 10 rad
replay empty.mcap --voltage -12 | --voltage is -12 V
bench rise --n 0 | --n is 0, expected 1 to 1000000
bench rise --engine cloud | --engine is 'cloud' | local, dask or slurm
bench rise --engine local:0 | --engine is 'local:0', expected 1 to 256 workers
bench all --engine local --address 10.0.0.1:1 | expected none with engine local
bench rise --torque-limit nan | --torque-limit is nan N·m
# bodies
rise --from supine --body tail=2 | --body 'tail=2': unknown part 'tail' | arms
rise --from supine --body arms | arms is '', expected a factor from 0.25 to 4
rise --from supine --body arms=0 | arms is '0', expected a factor from 0.25 to 4
rise --from supine --body arms=-1.6 | arms is '-1.6'
rise --from supine --body arms=nan | arms is 'nan'
rise --from supine --body arms=long | arms is 'long'
rise --from supine --body arms=9 | arms is '9', expected a factor from 0.25 to 4
rise --from supine --body arms=2,arms=3 | arms is given twice, expected once
rise --from supine --body arms=2, | unknown part ''
rise --body arms=1.6 --backend dynamixel --port /dev/x
    | --body is arms=1.6, expected none: a real robot has the body that it has
rise --from supine --body arms=1.6 --method policy | --body is arms=1.6 | policy
rise --from supine --load l_hand | load is 'l_hand', expected NAME:KG,... with each name once
rise --from supine --load l_hand: | load is 'l_hand:', expected NAME:KG
rise --from supine --load l_hand:much | load is 'l_hand:much', expected NAME:KG
rise --from supine --load l_hand:1, | load is 'l_hand:1,', expected NAME:KG
rise --from supine --load l_hand:1,l_hand:2 | load is 'l_hand:1,l_hand:2' | each name once
rise --from supine --load l_hand:nan | load l_hand is nan kg, expected above 0 and up to 3.15 kg
rise --from supine --load l_hand:0 | load l_hand is 0 kg, expected above 0 and up to 3.15 kg for op3
rise --from supine --load l_hand:-1 | load l_hand is -1 kg, expected above 0
rise --from supine --load l_hand:4 | load l_hand is 4 kg | up to 3.15 kg for op3
rise --from supine --load tail:1
    | load on unknown 'tail' | of op3, such as left_hand, right_hand, l_el_link, r_el_link
bench rise --load tail:1 | load on unknown 'tail'
bus --load tail:1 | load on unknown 'tail'
motions list --body torso=0 | torso is '0'
scenes --body torso=0 | torso is '0'
preflight squat_to_stand --body torso=0 | torso is '0'
motions show long_arms.npz | was made for the body 'arms=1.6', expected the orig
motions show long_arms.npz --body legs=1.2 | expected 'legs=1.2' or the original
# plan
plan | --from is missing | supine, prone, left, right
plan --from upside | unknown start 'upside'
plan --from supine --scene moon | unknown scene 'moon'
plan --from supine --max-checks 0 | --max-checks is 0, expected 1 to 1000000000
plan --from supine --to none.json | posture 'none.json': no such file
plan --from supine --to motions:moonwalk@1 | unknown motion 'moonwalk' | squat_to_stand
plan --from supine --key none.json | posture 'none.json': no such file
plan --from supine --key motions:moonwalk@1 | unknown motion 'moonwalk'
plan --from supine --key motions:squat_to_stand | expected motions:NAME@TIME
plan --from supine --key motions:squat_to_stand@soon | expected motions:NAME@TIME
plan --from supine --key motions:squat_to_stand@99 | 99 s, expected 0 to 3.27 s
plan --from supine --key motions:squat_to_stand@-1 | -1 s, expected 0 to 3.27 s
plan --from supine --key bent.json | joint 'l_knee' is +9.000 rad
plan --from supine --key tangled.json | posture tangled.json | mm inside | expected at most 6.0 mm
plan --from walled.json --scene wall | mm into obstacle 'wall', expected at most 5 mm
rise --from walled.json --scene wall | mm into obstacle 'wall'
plan --from supine --robot no_motions | robot 'op3' has no motions
plan --from supine --out text.txt | text.txt is not a folder
plan --from supine --json folder | output file folder: is a folder
rise --from supine --key none.json | posture 'none.json': no such file
rise --from supine --key motions:moonwalk@1 | unknown motion 'moonwalk'
rise --from supine --key motions:squat_to_stand@99 | 99 s, expected 0 to 3.27 s
rise --from supine --key bent.json | joint 'l_knee' is +9.000 rad
rise --from supine --key tangled.json | posture tangled.json | mm inside
rise --from supine --method policy --key motions:squat_to_stand@0
    | --key: expected --method plan with it, planning and filtering
rise --from supine --no-filtering --key motions:squat_to_stand@0 | --key: expected
play path.npz | motion 'path' ends neither standing nor lying
# eval
eval moonwalk | unknown policy 'moonwalk'
eval robust --n 5 | --n is 5, expected a multiple of 4, 4 to 1000000
eval robust --n 0 | --n is 0
eval robust --delay 90 | --delay is 90 ms, expected 0 to 60 ms
eval robust --voltage 0.1 | --voltage is 0.1 V, expected 1 to 30 V
eval robust --friction 0 | --friction is 0, expected 0.01 to 10
eval robust --mass nan | --mass is nan, expected 0.1 to 10
eval robust --backlash -1 | --backlash is -1 deg, expected 0 to 10 deg
eval robust --weak-servo 2 | --weak-servo is 2, expected 0 to 1
eval robust --push 11 | --push is 11 m/s, expected 0 to 10 m/s
eval robust --imu-tilt 91 | --imu-tilt is 91 deg, expected 0 to 90 deg
eval robust --gyro-bias inf | --gyro-bias is inf deg/s
eval robust --variant jelly | --variant is 'jelly', expected 1 ms steps
eval robust --n 4 --falls empty.npz | empty.npz
eval robust --n 4 --falls text.npz | text.npz
eval robust --n 4 --falls half.npz | half.npz
eval robust --n 4 --falls whole.npz | whole.npz
eval robust --n 4 --falls folder | folder: is a folder, expected a file
eval empty.onnx --n 4 | empty.onnx
# style
style show cartwheel | unknown style 'cartwheel', expected half-kneel, long-sit
style show few.toml | few.toml: curves 1: neck_height has 2 points, expected 9
style show kneeling.toml | neck_height ends at 0.7 of standing, expected 0.9 or more
style show wide.toml | curves 1: side is 200° at point 1, expected 0 to 180°
style show falling.toml | falling.toml: duration is -5 s, expected above 0 s
style show text.txt | unknown style 'text.txt'
style show texts.toml | neck_height is | expected a list of finite numbers
style show short.toml | duration is 0.005 | expected 0.1 to 60 s
style show sit-up --json both.png --picture both.png | are both both.png, expected two files
style show none.toml | style file none.toml: No such file or directory
style show sit-up --picture folder | folder: is a folder, expected a file
style extract moonwalk --out mine.toml | unknown motion 'moonwalk'
style extract empty.mcap --out mine.toml | empty.mcap
style extract text.csv --out mine.toml | a file of another kind, expected .npz
style extract squat_to_stand --up z --out mine.toml | --up is given, expected none with
style extract human.bvh --rate 60 --out mine.toml | --rate is given, expected none with human.bvh
style extract giant.bvh --out mine.toml | its body is 18.75 units tall, expected 1 to 2.2 m
style extract bent.bvh --out mine.toml | its body stands along no axis | --up gives
style extract upright.bvh --unit feet --out mine.toml | --unit is feet, expected m, cm, mm, inch
style extract scaled.bvh --out mine.toml | joint 'Hips' has 6 channels Xscale
style extract text.bvh --out mine.toml | it is not a BVH file: HIERARCHY is missing
style extract text.amc --out mine.toml | text.asf: No such file or directory
style extract squat_to_stand --begin 3 --end 1 --out mine.toml
    | --begin is 3 s, expected before --end, 1 s
style extract squat_to_stand --end 0.1 --out mine.toml | nothing moves in what is extracted
style extract sit_and_lie_down --out mine.toml | expected 0.9 or more | --finish
mocap import | the clip is missing, expected a .bvh, .amc, .json or .txt file, or FILE.asf
mocap import text.csv | the clip is text.csv, expected a .bvh, .amc
mocap import text.bvh upright.bvh | or FILE.asf FILE.amc
mocap import text.txt | text.txt: not a motion of DeepMimic
mocap import list.json | list.json: not a motion of DeepMimic (Expected `object`
mocap import deep.json | deep.json: not a motion of DeepMimic
mocap import binary.json | binary.json: not UTF-8 text
mocap import none.bvh | none.bvh: No such file or directory
mocap import empty.bvh | it is not a BVH file: HIERARCHY is missing
mocap import scaled.bvh | joint 'Hips' has 6 channels Xscale
mocap import text.amc | text.asf: No such file or directory
mocap import headless.bvh | it has no neck, expected a joint lowerneck, Neck
mocap import upright.bvh | it has no left shoulder, expected a joint lhumerus
mocap import human.bvh --robot human --begin 0.3 | it lasts 0.10 s, expected two
mocap import human.bvh --seed 3 | --seed or --search-budget is given, expected --physics
mocap import short.bvh | it lasts 0.00 s, expected two frames or more
mocap import human.bvh --begin 3 --end 1 | --begin is 3 s, expected before --end, 1 s
mocap import human.bvh --begin -1 | --begin is -1 s | times from 0 s on
mocap import human.bvh --rename Hips | --rename is Hips, expected FROM=TO,...
mocap import human.bvh --rename Tail=Neck | it has no joint 'Tail' to rename, but Hips, Spine1
mocap import human.bvh --rate 60 | --rate is given, expected none with a .bvh file
mocap import human.bvh --out mine.bvh | expected a name that ends with .npz
mocap import human.bvh --out folder.npz | folder.npz: is a folder
mocap import human.bvh --name 'a b' | motion name 'a b': expected 1 to 100 letters
run robust --from supine --style sit-up | the policy follows no style curves
run robust --from supine --style few.toml | few.toml: curves 1: neck_height has 2
run robust --from supine --style planned | follows no style curves
rise --from supine --style sit-up | expected --method policy with it
eval robust --n 4 --style sit-up | policy 'robust' follows no style curves
eval robust --n 4 --height-map | policy 'robust' has no height map
eval robust --n 4 --scene flat,flat | expected each scene once
eval styled --n 4 --style sit-up,moon | unknown style 'moon'
eval styled --n 4 --style sit-up,sit-up | expected each style once
eval styled --n 4 --style '' | unknown style ''
eval robust --n 4 --scene flat,moon | unknown scene 'moon'
# train and export
train --out mine --recipe slow | --recipe is 'slow', expected quick, backwards,
[rsl_rl] train --robot no_motions --recipe backwards --out mine
    | robot 'op3' has no rising motion in
[rsl_rl] train --out mine --recipe styled-quick | mine has no prior.npz, expected --prior
[rsl_rl] train --out mine --recipe styled --prior folder --parent folder | prior.npz
train --out mine --prior none | --prior is none, expected the folder of a pose prior
[rsl_rl] train --out mine --parent text.onnx | text.onnx is not a policy
prior --out mine --rises 2 | --rises is 2, expected a multiple of 4, 4 to 1000000
prior --out text.txt | text.txt is not a folder
prior --out mine --engine local:0 | engine is 'local:0', expected 1 to 256
[rsl_rl] prior --out mine --policies styled | policy 'styled' follows style curves
train --out mine --threads -2 | --threads is -2, expected 0 to 256
train --out mine --iterations 0 | --iterations is 0, expected 1 to 1000000
train --out mine --robots 0 | --robots is 0, expected 1 to 1000000
train --out text.txt | text.txt is not a folder
[rsl_rl] train --out mine --device abacus | --device is 'abacus'
train --out mine --physics newton | --physics is 'newton', expected mujoco or warp
[mujoco_warp] train --robot other_solver --physics warp --out mine
    | mujoco-warp cannot simulate this model: mjSOL_PGS is unsupported
train --out mine --parent none | --parent is none, expected the folder of a training
[rsl_rl] export none --out policy.onnx | none
[rsl_rl] export folder --out policy.onnx | folder
export folder --out folder | folder: is a folder, expected a file
# policies of others
[yaml] policy import none.onnx --out mine | none.onnx: No such file
[yaml] policy import folder --out mine | folder
[yaml] policy import empty.onnx --out mine | empty.onnx: it is not an ONNX file: it holds no network
[yaml] policy import text.onnx --out mine | text.onnx: it is not
[yaml] policy import their.pt --out mine | their.pt: it is a pickle of torch, which is never opened
[yaml] policy import bare.onnx --robot nodding --out mine
    | nothing describes it, expected an ONNX file with
[yaml] policy import bare.onnx --config text.txt --out mine | text.txt
[yaml] policy import bare.onnx --config ball.toml --out mine | ball.toml: not YAML
[yaml] policy import bare.onnx --config loop.yaml --out mine | its aliases stand for too many values
[yaml] policy import bare.onnx --config endless.yaml --joints a,b,c --out mine
    | pattern '(j+)+x' could take too
[yaml] policy import their.onnx --out mine
    | robot 'op3' has no right_hip_joint, head_joint, left_hip_joint
[yaml] policy import their.onnx --rename left --out mine
    | --rename is left, expected THEIRS=OURS,...
[yaml] policy import their.onnx --robot nodding --rate 50 --out mine
    | every 2.5 control periods of 8 ms
[yaml] policy import their.onnx --robot nodding --rate 62.5 --gain 99 --out mine
    | 'r_hip' 99 (the servo:
[yaml] policy import their.onnx --robot nodding --gain 0 --out mine
    | --gain is 0 N·m/rad, expected 0.001
[yaml] policy import stiff.onnx --robot nodding --out mine
    | joint_stiffness is 1 N·m/rad for every joint
[yaml] policy import blind.onnx --robot nodding --out mine
    | 'base_lin_vel' is the linear velocity of the base
[yaml] policy import their.onnx --out text.txt | text.txt
policy | expected a command first
policy check robust | --trace
policy check robust --trace none.npz | trace none.npz: No such file
policy check robust --trace text.npz | trace text.npz: it is not an .npz archive
policy check robust --trace whole.npz | key 'joints' is missing; key 'gyro' is missing
[yaml] policy import half.onnx --out mine | half.onnx
policy check moonwalk --trace trace.npz | unknown policy 'moonwalk'
# ports
rise --backend dynamixel | --backend dynamixel requires --port | --port /dev/ttyUSB0
rise --from supine --port /dev/x | --port is /dev/x | virtual or dynamixel
rise --from supine --backend dynamixel --port /dev/x
    | --from is 'supine' | a real one starts as it lies
rise --backend virtual --port a=/dev/x | --port is a=/dev/x | robot 'op3': --port main=PATH
rise --backend dynamixel --port /dev/x --no-filtering | --no-filtering requires a simulated robot
rise --backend dynamixel --port none | none
rise --backend dynamixel --port text.txt | text.txt
play squat_to_stand --backend dynamixel --port folder | folder
servo list --port none | none
servo list --port text.txt | text.txt
servo list --port none --baud 1234567 | 1234567
servo list --baud fast | --baud is 'fast', expected a whole number
servo list --baud 1000000 --all-bauds | baud
doctor | --port is missing | --port /dev/ttyUSB0
doctor --port none | none
doctor --port a=none,b=none | --port main=PATH
calibrate --port none --yes | none
calibrate --port none --yes --joint tail | unknown joint 'tail'
calibrate --port none --yes --at floating | unknown posture 'floating'
bus --voltage -1 | voltage is -1 V, expected 1 to 48 V
bus --latency 3 | latency is 3 s
bus --servos XL999:1 | --servos has 'XL999:1', expected MODEL:ID with a model of
bus --servos XL430-W250:1,1 | --servos has the id 1 twice
bus --servos XL430-W250:300 | --servos has 'XL430-W250:300', expected an id
bus --servos XL430-W250:253 | expected an id from 0 to 252
bus --servos AX-12A:254 | --servos has 'AX-12A:254', expected an id from 0 to 253
bus --servos AX-12A:1,XL430-W250:2
    | servos AX-12A, XL430-W250 speak different protocols (1.0, 2.0): give each a port
bus --servos AX-12A:1 --baud 2000000 | AX-12A: baud rate is 2000000 bit/s, exp
bus --servos SCS0009:1 | --servos has 'SCS0009:1', expected MODEL:ID with a
bus --servos XL430-W250:1 --load 1 | --load is '1', expected KG:M
bus --load 1:0.1 | load on unknown '1', expected a body or site of op3
bus --turn l_knee:20 | --turn needs --hold
bus --robot tiny --hold high | unknown posture 'high': expected zero, standing, or a file
bus --robot tiny --hold zero --turn knee:20 | turn knee:20: unknown joint 'knee'
bus --robot tiny --hold zero --turn l_hip:999 | l_hip would be at +999.0°, expected
bus --robot tiny --hold zero --turn l_hip:x | expected JOINT:DEG, an angle in degrees
first-steps | --port is missing, expected a serial port
first-steps --port none | standard input is not a terminal
bus --servos XL430-W250:1 --baud 1 | baud is 1 bit/s, expected 9600
hold --robot desk | robot 'desk' is servos on a bench, expected a robot with a model
doctor --robot bad-desk --port none | id 1 is given 2 times, expected once
servo monitor | --port is missing | --port /dev/ttyUSB0
servo list --port none --baud 1 | baud is 1 bit/s, expected 9600
servo read --port none | NAME is missing
servo write --port none | NAME=COUNTS is missing
servo write temperature_limit --port none --id 1 | expected NAME=COUNTS
servo write temperature_limit=x --port none --id 1 | expected NAME=COUNTS
servo id 254 --port none | new is 254, expected 0 to 253
servo list --port none --protocol 3.0 | --protocol | 3.0 | feetech
servo id 2 --id -1 --port none | --id is -1, expected 0 to 253
servo move --port none | expected one of --to and --by
servo move --to 1 --by 1 --port none | expected one of --to and --by
servo move --to 9999 --port none | --to is 9999 °, expected -3600 to 3600 °
servo move --to 1 --speed 999 --port none | --speed is 999 °/s
servo move --by 1 --joint l_knee --port none | --robot and --joint together
servo move --by 1 --robot op3 --id 1 --port none | expected --joint
servo move --by 1 --robot op3 --joint tail --port none | unknown joint 'tail'
servo move --by 1 --port a,b | --port is a,b, expected one serial port
identify servo --port none --id 1 | --load is missing, expected --port, --id, --load together
identify servo --load 0.3:0.1 | --port and --id is missing
identify servo --port none --id 1 --load 0.3 | --load is '0.3', expected KG:M | such as 0.2:0.1
identify servo --port none --id 1 --load 0.3:0.1 | port none | does not exist
identify servo --port none --id 1 --load 0.3:0.1 --out . | --out is ., which is not empty
servo monitor --port none --seconds 1 | port none | does not exist
servo setup --port none | standard input is not a terminal
servo setup --port a,b | --port is a, b, expected for robot 'op3': --port main=PATH
replay /dev/zero | /dev/zero | it is a device, expected a file
bus --robot tiny --link none/port | none/port
bus --robot tiny --from none.json | posture file none.json is missing
# posture files
rise --from none.json | posture file none.json is missing
rise --from empty.json | posture file empty.json: not JSON
rise --from text.txt | posture file text.txt: not JSON
rise --from list.json | posture file list.json
rise --from supine --key no_knee.json | joint 'l_knee' is missing
rise --from nan_knee.json | joint_pos.l_knee is nan | finite
rise --from stretched.json | length 2.0000
rise --from bent.json | joint 'l_knee' is +9.000 rad | [-1.798, +2.478] rad
rise --from sunk.json | 100.0 mm into the ground
rise --from high.json | above the ground
rise --from far.json | position is 1e+200 m | 1000 m
rise --from binary.json | posture file binary.json: not UTF-8 text
rise --from deep.json | posture file deep.json | nested too deep
rise --from unreadable | unreadable: Permission denied
rise --from folder | posture file folder: Is a directory
play squat_to_stand --from bent.json | joint 'l_knee' is +9.000 rad
run robust --from sunk.json | 100.0 mm into the ground
calibrate --port none --yes --at bent.json | joint 'l_knee' is +9.000 rad
# motion files
play none.npz | none.npz | No such file
play empty.npz | motion file empty.npz
play text.npz | motion file text.npz
play half.npz | motion file half.npz
play flipped.npz | motion file flipped.npz
play pickled.npz | motion file pickled.npz
play other.npz | made for 'nao' with 20 joints | 'op3' with 20
motions show other.npz | made for 'nao' with 20 joints
preflight folder.npz | motion file folder.npz
rise --robot broken_motion --from supine | broken_motion/motions/broken.npz
rise --robot no_motions --from supine | robot 'op3' has no motions
motions build --robot wrong_keyframes | wrong_keyframes/keyframes.toml
motions build --robot no_keyframes | no_keyframes/keyframes.toml is missing
# keys
motions import none.csv | none.csv: No such file or directory
motions import folder | folder: a file of another kind, expected an action file
motions import text.txt | text.txt: a file of another kind, expected an action
motions import text.csv | text.csv: no keys, expected a header and one row or more
motions import tail.csv | unknown joint 'l_tail', expected r_sho_pitch
motions import bent.csv | joint 'l_knee' of key number 1 is +515.662 deg | --clip
motions import empty.json | empty.json: not JSON
motions import list.json | list.json: expected an object with keyframes
motions import no_knee.json | keyframes is missing, expected a list of tables
motions import short.bin | short.bin: has 15 bytes, expected 131072
motions import actions.bin | --page is missing, expected one of 3 wave, 5 wave
motions import actions.bin --page 9 | page 9 is empty, expected one with steps
motions import actions.bin --page 4 | page 4 is damaged: its bytes sum to
motions import actions.bin --page 5 | has id 2 at 5000 ticks, expected 0 to 4095
motions import actions.bin --page 300 | --page is 300, expected 1 to 255
motions import actions.bin --page 3,3 | --page has '3' twice, expected each once
motions import actions.bin --page 3,4 --name wave | --name is given with 2 pages
motions import kick.csv --page 3 | --page is given, expected an action file
motions import kick.csv --name a/b | name 'a/b': expected up to 100 letters
motions import kick.csv --start upside | --start is 'upside', expected supine
motions import kick.csv --out folder | output file folder: is a folder
motions import kick.csv --out wrong.toml | wrong.toml: motions is missing
motions import kick.csv --name squat_to_stand --start supine --robot no_motions
    | motion 'squat_to_stand' is there already, expected another name
motions preview moonwalk | unknown motion 'moonwalk', expected squat_to_stand
motions preview wave --keyframes none.toml | none.toml: No such file or directory
motions preview wave --keyframes wrong.toml | wrong.toml: motions is missing
motions preview squat_to_stand --picture folder | output file folder: is a folder
motions record wave --backend dynamixel | --backend dynamixel requires --port
motions record a/b | name 'a/b': expected up to 100 letters
motions record squat_to_stand | motion 'squat_to_stand' is there already, expected another
motions record wave --out folder | output file folder: is a folder
motions build --robot twice_keyframes
    | motion 'wave' is there twice | key number 1: both: unknown joint 'nee', expected sho_pitch
motions build --robot bent_keyframes | joint 'l_knee' of key number 1 is +900.000
motions build squat_to_stand --resume --robot broken_search | squat_to_stand.jsonl: not JSON
# policy files
run none.onnx --from supine | none.onnx | No such file
run empty.onnx --from supine | policy file empty.onnx
run text.onnx --from supine | policy file text.onnx
run half.onnx --from supine | policy file half.onnx
run folder.onnx --from supine | folder.onnx: Is a directory
[onnx] run unfit.onnx --from supine | unfit.onnx is of robot 'nao'
[onnx] run unfit.onnx --from left --robot op3
    | policy file unfit.onnx: robot: made for 'nao' | action mode: 'torque'
[onnx] run bare.onnx --from supine | bare.onnx
# flight logs
replay none.mcap | none.mcap
replay empty.mcap | empty.mcap
replay text.txt | text.txt
replay folder | folder
motions export none --trajectory t.yaml | none
motions export other.npz --trajectory t.yaml | made for 'nao' with 20 joints
log export none.mcap --rosbag2 bag | flight log none.mcap: No such file
log export text.txt --rosbag2 bag | text.txt: not an MCAP file
log export foreign.mcap --rosbag2 bag | damaged (it does not name its robot)
log export nameless.mcap --rosbag2 bag | it does not name its joints, expected
log export nao.mcap --rosbag2 bag | nao.mcap is of robot 'nao': give its folder
log export nao.mcap --rosbag2 bag --robot op3 | of robot 'nao', expected 'op3'
# robot folders
robots check nao | unknown robot 'nao' | op3
robots check not_toml | not_toml/robot.toml
robots check one_legged | 'op3' has no two legs with a knee, expected a left and
robots check op3 --picture folder | output file folder: is a folder
[onnx] motions discover quick --robot tiny | unknown policy 'quick'
[onnx] motions discover styled --robot op3 | follows style curves
[onnx] motions discover quick --robot op3 --rises 1 | --rises is 1
motions discover --robot op3 --rises 9 | --rises is given, expected none without
motions discover quick --robot op3 --budget 9 | --budget is given, expected none
motions discover quick --resume --torque-limit 2
    | --resume is given, expected none with a policy | --torque-limit is
motions discover --robot op3 --sides right | --sides is 'right', expected supine
motions discover --robot op3 --budget 0 | --budget is 0 s, expected 1 to
motions discover --robot op3 --resume | there is no search to resume
motions discover --robot one_legged | no two legs with a knee
motions retarget --robot op3 | --source is op3, the robot itself
motions retarget --robot tiny --source nao | unknown robot 'nao'
motions retarget moonwalk --robot no_keyframes | unknown motion 'moonwalk'
motions retarget --robot one_legged | no two legs with a knee
motions retarget --robot tiny --source no_keyframes | keyframes.toml is missing
motions list --robot folder | unknown robot 'folder'
motions list --robot not_toml | not_toml/robot.toml: not TOML
motions list --robot not_text | not_text/robot.toml: not UTF-8 text
motions list --robot no_model | no_model/model.xml
motions list --robot not_xml | not_xml/model.xml: not XML
motions list --robot wrong_joint | wrong_joint/robot.toml | l_tail
motions list --robot wrong_limit
    | limit_by is "current", expected "pwm": the XL430-W250 of joint 'r_sho_pitch'
motions list --robot no_limit | limit_by is 'hope', expected current, pwm
rise --robot wrong_calibration --from supine | wrong_calibration/calibration.toml
calibrate --robot wrong_calibration --port none | calibration.toml
# model files
robots import nowhere.xml --out new | nowhere.xml: No such file | MJCF or URDF
robots import text.txt --out new | text.txt: not XML
robots import scene.sdf --out new | its root is <sdf>, expected <mujoco> (MJCF)
robots import one_leg.xml --out new | expected two legs of at least 3 hinges
robots import hangs.xml --out new | hangs on the world by hinge 'string'
robots import mm.urdf --out new | expected 0.1 to 3 m: lengths are in m, these look like mm
robots import degrees.urdf --out new | at most 12.6 rad | of a URDF are in rad
robots import meshes.urdf --out new
    | mesh 'torso.stl' of link 'torso' is not found, expected it beside the model
robots import many.xml --out new | 1000000000 copies of parts, expected at most 3000
robots import nan.xml --out new | <geom> has mass 'nan', expected finite numbers
robots import pipe.urdf --out new | it is a FIFO, expected a file
robots import light.urdf --out new | link 'torso' has a mass of -1 kg
robots import mimic.urdf --out new | mimics 'tail', expected another joint
robots import effort.urdf --out new | effort of <limit> is 'nan', expected a finite
robots import small.xml --out new --name ' ' | --name is ' ', expected a name of 1
robots import small.xml --out new --name ../x | --name is '../x', expected a name
robots import small.xml --out ' ' | --out is ' ', expected a name of | or --name
robots import small.xml --out taken | --out is taken, which is not empty
robots import small.xml --out new --servo XM1 | --servo is 'XM1': unknown type
robots import small.xml --out new --servo XM430-W350=*tail
    | no joint matches '*tail', expected some of left_hip_yaw_joint
robots import small.xml --out new --fix tail | --fix is 'tail', expected one of
robots import small.xml --out new --servo '' | --servo is empty, expected a name
robots import small.xml --out new --fix , | --fix is ',', expected a name between
# outputs
replay empty.mcap --json empty.mcap | --json: empty.mcap is read, too, expected
robots check tiny --picture tiny/model.xml | model.xml is a file of the robot
robots check tiny --json ./tiny/../tiny/robot.toml | robot.toml is a file of the
preflight squat_to_stand --robot broken_motion --json broken_motion/motions/squat_to_stand.npz
    | squat_to_stand.npz is a file of the robot, expected another file
motions show squat_to_stand --robot broken_motion --picture broken_motion/motions/squat_to_stand.npz
    | squat_to_stand.npz is a file of the robot, expected another file
style show kneeling.toml --json kneeling.toml | --json: kneeling.toml is read, too
style show few.toml short.toml --picture short.toml | short.toml is read, too
play whole.npz --json whole.npz | --json: whole.npz is read, too
play path.npz --json same.npz | --json: same.npz is read, too
preflight whole.npz --json whole.npz | --json: whole.npz is read, too
scenes ball.toml --picture ball.toml | --picture: ball.toml is read, too
plan --from bent.json --json bent.json | --json: bent.json is read, too
plan --from prone --key far.json,bent.json --json bent.json | bent.json is read, too
run half.onnx --from supine --json half.onnx | --json: half.onnx is read, too
eval robust --scene flat,ball.toml --json ball.toml | ball.toml is read, too
mocap import human.bvh --json human.bvh | --json: human.bvh is read, too
mocap import human.bvh --out same.npz --json same.npz | --out and --json are both
play whole.npz --out new --json new/report.json | are both new/report.json
rise --from supine --out text.txt | text.txt is not a folder
rise --from supine --out text.txt/below | text.txt is not a folder
rise --from supine --out loop | loop is not a folder
rise --from supine --out taken | output file taken/report.json: is a folder
rise --from supine --out LONG | File name too long
rise --from supine --out new/LONG | File name too long
rise --from supine --out /proc/rise | /proc/rise
rise --from supine --json /proc/figures.json | /proc
rise --from supine --json folder | output file folder: is a folder
rise --from supine --json '' | the name of a file
rise --from supine --json text.txt/below | text.txt is not a folder
robots --json folder | output file folder: is a folder
robots --json /dev/full | output file /dev/full: No space left on device
motions list --json circle | output file circle
motions list --json LONG | File name too long
motions show squat_to_stand --picture folder | folder: is a folder
motions show squat_to_stand --picture /proc/strip.png | /proc
replay empty.mcap --out text.txt | text.txt is not a folder
motions export squat_to_stand --trajectory folder.yaml | folder.yaml: is a folder
motions export squat_to_stand --trajectory t.csv | ends with .yaml, .yml or .json
motions export squat_to_stand | expected either --trajectory or --csv
motions export squat_to_stand --trajectory t.json --approach -1 | --approach is -1 s
log export nao.mcap --rosbag2 taken | --rosbag2 is taken, which is not empty
log export nao.mcap --rosbag2 text.txt | text.txt is not a folder, expected a
eval robust --n 4 --falls text.txt/below | text.txt is not a folder
export folder --out text.txt/below | text.txt is not a folder
doctor --port none --json folder | folder: is a folder
servo list --port none --json folder | folder: is a folder
"""
"""Groups of command lines, each with parts of the one line that refuses it.

In brackets stands a package without which a case is left out; LONG is a name of 300 letters.
"""


def read_table(text: str) -> dict[str, list[Case]]:
    """Read the groups; an indented line goes on with the one before."""
    groups: dict[str, list[Case]] = {}
    for line in text.replace("\n    ", " ").replace("LONG", "x" * 300).strip().splitlines():
        if line.startswith("# "):
            cases = groups.setdefault(line[2:], [])
            continue
        command, *message = line.split(" | ")
        extra, bracket, rest = command.rpartition("] ")
        cases.append(Case(rest, tuple(message), extra[1:] if bracket else None))
    return groups


GROUPS = read_table(TABLE)


TEXTS = {
    "text.txt text.npz text.onnx text.csv text.bvh text.amc short.bin": "no numbers here",
    "empty.npz empty.onnx empty.mcap empty.json empty.bvh": "",
    "wrong.toml": '[[fault]]\nkind = "earthquake"\nat = -1\n',
    "ball.toml": "[ground]\nfrictoin = 1\n[[spheres]]\nname = 'ball'\ncenter = [0, 0, 0]\n"
    "radius = -1\n",
    "cave.toml": "[[boxes]]\nname = 'roof'\ncenter = [0, 0, 1]\nsize = [50, 50, 0.1]\n"
    "[[starts]]\nlying = 'supine'\nz = [0, 0.8]\nsettled = true\n",
    "sole.toml": "[[spheres]]\nname = 'l_sole'\ncenter = [0, 0, 0]\nradius = 1\n",
    "off.toml": "[ground]\nheights = [[0, 1], [0, 0]]\n[[starts]]\nlying = 'prone'\nx = [2, 3]\n",
    "upside.toml": "[[starts]]\nlying = 'left'\nz = [1, 0]\n",
    "begun/benchmark.jsonl": "half a piece",
    "list.json": "[]",
    "deep.json": "[" * 100_000,
    "tail.csv": "time,l_tail\n0,1\n",
    "bent.csv": "time,l_knee\n0,9\n",
    "kick.csv": "time,l_knee\n0,1\n1,2\n",
    "loop.yaml": "a: &a [*a]\n",
    "trace.json": '{"robot": "op3", "joints": ["head_pan"]}',
    "scene.sdf": "<sdf/>",
    "giant.bvh": re.sub(r"(OFFSET -?\d+ -?\d+)0 0", r"\1 0", BVH),
    "bent.bvh": BVH.replace("OFFSET 0 50 0", "OFFSET 0 0 50"),
    "scaled.bvh": BVH.replace("Xposition", "Xscale"),
    "upright.bvh": BVH,
}


def make_files(folder: Path, robot: Robot) -> None:
    """Make the damaged and wrong files that the cases name."""
    for name in ("folder", "folder.npz", "folder.onnx", "folder.yaml", "taken/report.json"):
        (folder / name).mkdir(parents=True)
    for names, text in TEXTS.items():
        for name in names.split():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_text(text)
    for name, target in (("loop", "nowhere"), ("circle", "circle"), ("same.npz", "path.npz")):
        (folder / name).symlink_to(target)
    (folder / "binary.json").write_bytes(b"\xff\xfe\x00")
    (folder / "unreadable").write_text("{}")
    (folder / "unreadable").chmod(0)
    for make in (_make_styles, _make_logs, _make_actions, _make_models):
        make(folder)
    for make in (_make_postures, _make_motions, _make_policies, _make_robots):
        make(folder, robot)


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


def _make_models(folder: Path) -> None:
    def cut_leg(spec: mujoco.MjSpec) -> None:
        spec.delete(spec.body("right_hip_yaw"))

    def hang(spec: mujoco.MjSpec) -> None:
        torso = spec.body("torso")
        spec.delete(torso.joints[0])
        torso.add_joint(name="string", type=mujoco.mjtJoint.mjJNT_HINGE)

    os.mkfifo(folder / "torso.obj")
    small, urdf = small_humanoid(), small_urdf()
    copies = '<worldbody><replicate count="1000000000"><site/></replicate>'
    for name, text in {
        "small.xml": small,
        "many.xml": small.replace("<worldbody>", copies),
        "nan.xml": small.replace('mass="1"', 'mass="nan"'),
        "one_leg.xml": small_humanoid(change=cut_leg),
        "hangs.xml": small_humanoid(change=hang),
        "pipe.urdf": small_urdf(mesh="torso.obj"),
        "meshes.urdf": small_urdf(mesh="torso.stl"),
        "light.urdf": urdf.replace('mass value="1.0"', 'mass value="-1"'),
        "mimic.urdf": '<mimic joint="tail"/></joint>'.join(urdf.rsplit("</joint>", 1)),
        "effort.urdf": urdf.replace('effort="4.1"', 'effort="nan"', 1),
        "mm.urdf": small_urdf(scale=1000.0),
        "degrees.urdf": urdf.replace(f'upper="{np.pi / 2.0}"', 'upper="90"'),  # the head's
    }.items():
        (folder / name).write_text(text)


def _make_styles(folder: Path) -> None:
    rise, right = [0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0], [90] * 9
    for name, changes in {
        "few": {"neck_height": [0.2, 1.0]},
        "kneeling": {"neck_height": [*rise[:8], 0.6]},
        "wide": {"side_deg": [200, *right[1:]]},
        "falling": {"duration": -5},
        "texts": {"neck_height": list(map(str, rise))},
        "short": {"duration": 0.01},
    }.items():
        whole = {"duration": 5, "neck_height": rise, "side_deg": right, "front_deg": right}
        duration, *curve = [f"{key} = {value}\n" for key, value in (whole | changes).items()]
        text = f"leg_length = 0.9\n{duration}[[curves]]\n{''.join(curve)}"
        (folder / f"{name}.toml").write_text(text)
    write_human_bvh(folder / "human.bvh", 3)
    write_human_bvh(folder / "short.bvh", 1)
    write_human_bvh(folder / "headless.bvh", 3, without="Neck")


def _make_postures(folder: Path, robot: Robot) -> None:
    x, y, z = robot.standing.position
    (wall,) = load_scene("wall", robot).obstacles
    for name, joints, changes in (
        ("no_knee", {"l_knee": None}, {}),
        ("nan_knee", {"l_knee": math.nan}, {}),
        ("bent", {"l_knee": 9.0}, {}),
        ("tangled", {"l_hip_roll": 0.5}, {}),
        ("stretched", {}, {"orientation": [2.0, 0.0, 0.0, 0.0]}),
        ("high", {}, {"position": [x, y, z + 5.0]}),
        ("far", {}, {"position": [1e200, y, z]}),
        ("sunk", {}, {"position": [x, y, z - 0.1]}),
        ("walled", {}, {"position": [x, float(wall.position[1]), z]}),
    ):
        record = json.loads(format_posture(robot.standing, robot)) | changes
        angles = record["joint_pos"] | joints
        record["joint_pos"] = {key: angle for key, angle in angles.items() if angle is not None}
        (folder / f"{name}.json").write_text(json.dumps(record))


def _make_motions(folder: Path, robot: Robot) -> None:
    file = robot.folder / "motions" / "squat_to_stand.npz"
    whole = file.read_bytes()
    middle = len(whole) // 2
    flipped = bytes(byte ^ 0xFF for byte in whole[middle : middle + 64])
    (folder / "whole.npz").write_bytes(whole)
    (folder / "half.npz").write_bytes(whole[:middle])
    (folder / "flipped.npz").write_bytes(whole[:middle] + flipped + whole[middle + 64 :])
    np.savez(folder / "pickled.npz", time=np.array([{}], dtype=object))
    motion = Motion.load(file)
    replace(motion, robot="nao").save(folder / "other.npz")
    replace(motion, provenance={"body": "arms=1.6"}).save(folder / "long_arms.npz")
    replace(motion, name="path", end_class="other").save(folder / "path.npz")


def _make_actions(folder: Path) -> None:
    """Make an action file with a page that is damaged and one that turns too far."""
    at_rest = dict.fromkeys(range(1, 21), 2048)
    pages = {3: [Slot(at_rest)], 4: [Slot(at_rest)], 5: [Slot(at_rest | {2: 5000})]}
    write_action_file(folder / "actions.bin", pages)
    content = bytearray((folder / "actions.bin").read_bytes())
    content[4 * 512 + 100] ^= 1
    (folder / "actions.bin").write_bytes(content)


def _make_policies(folder: Path, robot: Robot) -> None:
    whole = (robot.folder / "policies" / "robust.onnx").read_bytes()
    (folder / "half.onnx").write_bytes(whole[: len(whole) // 2])
    (folder / "their.pt").write_bytes(b"PK\x03\x04 and code")
    if importlib.util.find_spec("onnx") is None:
        return
    from foreign_policies import ENV, mjlab_metadata, save_network, weights
    from tiny_policies import contract_of, save_policy

    contract = contract_of(robot, robot="nao", mode="torque").to_json()
    save_policy(folder / "unfit.onnx", robot, contract=contract)
    save_policy(folder / "bare.onnx", robot, contract=None)
    (folder / "endless.yaml").write_text(ENV.replace("left_hip_joint:", "(j+)+x:"))
    for name, changes in {
        "their": {},
        "stiff": {"joint_stiffness": "1.000,1.000,1.000"},
        "blind": {"observation_names": "base_lin_vel,joint_pos"},
    }.items():
        save_network(folder / f"{name}.onnx", weights(), mjlab_metadata(**changes))


WAVE = (
    "[[motions]]\nname = 'wave'\nstart = 'supine'\nstrategy = 'wave'\nstand_after = 1\n"
    "torque_limit = 1\nkeys = [{ both = { knee = 900 } }]\n"
)
WEAK = (("supply_voltage = 12.0", "supply_voltage = 11.1"), ("XM430-W350", "XL430-W250"))
CURRENT = 'limit_by = "current"'
COPIES: dict[str, tuple[str, str | bytes, tuple[tuple[str, str], ...]]] = {
    "broken_motion": ("motions/broken.npz", b"PK\x03\x04 and no more", ()),
    "wrong_keyframes": ("keyframes.toml", "motions = 3", ()),
    "twice_keyframes": ("keyframes.toml", 2 * WAVE.replace("knee", "nee"), ()),
    "bent_keyframes": ("keyframes.toml", WAVE, ()),
    "broken_search": ("unfinished/squat_to_stand.jsonl", "{", ()),
    "not_toml": ("robot.toml", "name = ", ()),
    "not_text": ("robot.toml", b"\xff\xfe", ()),
    "not_xml": ("model.xml", "<mujoco", ()),
    "other_solver": ("model.xml", "", (("<option ", '<option solver="PGS" '),)),
    "one_legged": ("robot.toml", "", (('["l_sole", "r_sole"]', '["l_sole"]'),)),
    "wrong_joint": ("robot.toml", "", (('"l_knee"', '"l_tail"'),)),
    "other_servos": ("robot.toml", "", (*WEAK, (CURRENT, 'limit_by = "pwm"'))),
    "wrong_limit": ("robot.toml", "", WEAK),
    "no_limit": ("robot.toml", "", ((CURRENT, 'limit_by = "hope"'),)),
    "wrong_calibration": ("calibration.toml", "joints = 3", ()),
}
"""Copies of the robot, each with a file of which all or some text is replaced."""


def _make_robots(folder: Path, robot: Robot) -> None:
    for name in (*COPIES, "no_motions", "no_keyframes", "no_model"):
        hidden = ["policies", *["keyframes.toml"] * (name in ("no_keyframes", "one_legged"))]
        hidden += ["motions"] * (name not in ("broken_motion", "other_servos"))
        shutil.copytree(robot.folder, folder / name, ignore=shutil.ignore_patterns(*hidden))
    (folder / "no_model" / "model.xml").unlink()
    for name, (file, content, changes) in COPIES.items():
        path = folder / name / file
        path.parent.mkdir(exist_ok=True)
        text = content or path.read_bytes()
        data = text.encode() if isinstance(text, str) else text
        for old, new in changes:
            assert old.encode() in data, (name, old)
            data = data.replace(old.encode(), new.encode())
        path.write_bytes(data)
    shutil.copytree(TINY, folder / "tiny")
    shutil.copytree(NODDING, folder / "nodding")
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
