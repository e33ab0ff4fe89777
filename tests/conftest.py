import os

from humanoid_getup.cli import choose_gl

choose_gl(os.environ)  # before anything imports MuJoCo
