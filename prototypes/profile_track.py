"""Where the time of tracking goes: one thread, CPU time."""
import cProfile, pickle, pstats, sys, time
import numpy as np
import humanoid_getup as hg
from humanoid_getup.filtering.dynamics_filter import *
from humanoid_getup.simulation.vectorized_simulation import VecSim
from robots import TorqueLimit
robot = hg.load_robot("op3"); world = hg.World(robot)
filt = DynamicsFilter(world, torque_limit=TorqueLimit(2.0, "pwm"), threads=1)
row = pickle.load(open("/tmp/srch/a20_24.pkl", "rb"))
cands = [r.candidate for r, _ in dict(row["rounds"])[2]]
spent = [0.0]; hold = VecSim.hold
def hold_(self, t, s):
    c = time.thread_time(); hold(self, t, s); spent[0] += time.thread_time() - c
VecSim.hold = hold_
filt.roll_out(row["start"], cands[:3])
for n in (3, 9):
    spent[0] = 0; c = time.thread_time(); out = filt.roll_out(row["start"], cands[:n]); c = time.thread_time() - c
    T = len(out[0].target)
    done = sum(min(r.moving + 125, T) for r in out) / (n * T)
    print(f"{n} candidates, {T} cycles, {n*T*.008:.0f} sim-s: cpu {c:.2f}, in physics {spent[0]:.2f} ({spent[0]/c:.2f}); {1e3*(c-spent[0])/T:.2f} ms Python a cycle; steps {n*T*4/spent[0]:.0f}/s; needed share of worlds {done:.2f}", flush=True)
pr = cProfile.Profile(); pr.enable(); filt.roll_out(row["start"], cands); pr.disable()
pstats.Stats(pr).sort_stats("tottime").print_stats(14)
