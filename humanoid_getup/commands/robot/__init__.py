"""Commands of section robot: describe, check, calibrate and watch a robot; serve a virtual one."""
