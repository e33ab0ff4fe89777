import os

from hypothesis import settings

from humanoid_getup.cli import choose_gl

choose_gl(os.environ)  # before anything imports MuJoCo

# One seed, and no deadline: two cores are shared with other tests.
settings.register_profile("tests", deadline=None, derandomize=True)
settings.load_profile("tests")
