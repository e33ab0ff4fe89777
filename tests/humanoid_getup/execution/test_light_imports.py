"""What runs a rise imports nothing that only builds motions or draws."""

import subprocess
import sys

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
