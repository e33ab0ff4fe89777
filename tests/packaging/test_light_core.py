"""A robot's computer needs no learning framework, and a rise no optimizer."""

import subprocess
import sys

PROGRAM = """
import importlib, pkgutil, sys
extras = {"viser", "mjviser", "websockets", "mink", "qpsolvers", "av"}
extras |= {"mcap_ros2", "yaml", "mujoco_warp"}
for package in ("robots", "drivers", "humanoid_getup"):
    path = importlib.import_module(package).__path__
    for module in pkgutil.walk_packages(path, f"{package}."):
        if module.name.startswith("humanoid_getup.policy.foreign."):
            continue  # of the extra `policies`; `policy import` alone imports them
        if module.name == "humanoid_getup.commands.motions.harvest_policy":
            continue  # of policies; `motions discover POLICY` alone imports it
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


HEAVY = (
    "cma",
    "scipy.stats",
    "matplotlib.pyplot",
    "humanoid_getup.motions.build",
    "humanoid_getup.motions.keyframes",
    "humanoid_getup.motions.optimization",
)
USED = (
    "execution.get_up",
    "strategies.planned_rise",
    "strategies.learned_rise",
    "strategies.stored_motion",
    "strategies.choice",
)


def test_getting_up_imports_neither_an_optimizer_nor_statistics_nor_plots():
    imports = "; ".join(f"import humanoid_getup.{module}" for module in USED)
    program = f"import sys; {imports}; print(*[m for m in {HEAVY} if m in sys.modules])"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []
