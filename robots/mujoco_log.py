"""MuJoCo's own log: on the terminal, not in a file of the working folder."""

import mujoco


def keep_out_of_files() -> None:
    """Keep MuJoCo from writing MUJOCO_LOG.TXT when it warns, as when a simulation diverges."""
    settings = mujoco.MjLogConfig.get()
    settings.logto_file = False
    mujoco.MjLogConfig.set(settings)
