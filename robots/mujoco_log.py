"""MuJoCo's own log: on the terminal, not in a file of the present folder."""

import mujoco


def keep_out_of_files() -> None:
    """Let MuJoCo write no MUJOCO_LOG.TXT where it warns, such as of a simulation that diverges."""
    settings = mujoco.MjLogConfig.get()
    settings.logto_file = False
    mujoco.MjLogConfig.set(settings)
