"""A robot's computer needs no learning framework: the core packages never import one."""

import subprocess
import sys

PROGRAM = """
import importlib, pkgutil, sys
extras = {"viser", "mjviser", "trimesh", "websockets", "mink", "qpsolvers", "av"}
extras |= {"mcap_ros2", "yaml", "mujoco_warp"}
for package in ("robots", "drivers", "humanoid_getup"):
    path = importlib.import_module(package).__path__
    for module in pkgutil.walk_packages(path, f"{package}."):
        if module.name.startswith("humanoid_getup.policy.foreign."):
            continue  # of the extra `policies`; `policy import` alone imports them
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as error:
            if error.name not in extras:
                raise
learning = {"torch", "onnx", "gymnasium", "rsl_rl", "tensordict", "sim2real"}
print(len(sys.modules.keys() & learning), sorted(sys.modules.keys() & learning))
imported = "humanoid_getup.commands.learn.train", "drivers.dynamixel.backend"
print(*(name in sys.modules for name in imported))
"""


def test_no_module_of_the_core_imports_a_learning_framework():
    result = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    assert result.stdout.splitlines() == ["0 []", "True True"], result.stderr
