"""A virtual Dynamixel bus: servos and a board that answer byte for byte, without hardware.

What hangs on the wire is logic alone, with no clock, thread or physics of its own: `registers` is
a control table in memory, `device` obeys what every device obeys, `servo` and `board` are the
two kinds, `chain` puts several on one wire. `quirks` holds what the manual leaves open.

`wire` is the pseudo-terminal, `server` serves it in `real_time` or in `lock_step`, `faults` breaks
things on demand. `body` lets servos drive a simulation; `robot` puts it all together.
"""
