"""Plan falls and say what it took: `bench_plan.py LIMIT SEED I,J,...`."""
import sys, time
import numpy as np
import humanoid_getup as hg
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.playback.preflight import preflight
from humanoid_getup.simulation.falls import sample_falls
from humanoid_getup.simulation.vectorized_simulation import VecSim
from humanoid_getup.strategies import planned_rise as pr
from humanoid_getup.strategies.plan import MotionPlan
from robots import TorqueLimit

lim, seed, sel = float(sys.argv[1]), int(sys.argv[2]), [int(a) for a in sys.argv[3].split(",")]
robot = hg.load_robot("op3"); world = hg.World(robot)
falls = sample_falls(world, dict.fromkeys(("supine", "prone", "lateral"), 20), np.random.default_rng(seed))
limit = TorqueLimit(lim, "pwm")
sim = [0.0, 0.0]
adv, hold = VecSim.advance, VecSim.hold
def advance(self, targets, h, record=(), ids=None):
    c = time.thread_time(); out = adv(self, targets, h, record, ids); sim[0] += targets.shape[0] * targets.shape[1] * .008; sim[1] += time.thread_time() - c; return out
def hold_(self, t, s):
    c = time.thread_time(); hold(self, t, s); sim[0] += self.n * s * .002; sim[1] += time.thread_time() - c
VecSim.advance, VecSim.hold = advance, hold_
planner = pr.PlannedRise(world, torque_limit=limit)
planner.filter = DynamicsFilter(world, torque_limit=limit, threads=1)  # one thread: its CPU time is honest
rows = []
for i in sel:
    sim[:] = 0, 0
    c, w = time.thread_time(), time.time()
    plan = planner.plan(falls[i].posture, np.random.default_rng([seed, i]))
    c, w = time.thread_time() - c, time.time() - w
    spent = list(sim)
    fresh, ok = 0.0, None
    if isinstance(plan, MotionPlan):
        fresh = planner.filter.check(falls[i].posture, plan.motion.joint_target, np.random.default_rng([999, i]))
        ok = preflight(world, plan.motion, voltage=12.0, torque_limit=limit)
    rows.append((plan.status.name == "STOOD", plan.robust, fresh, bool(ok and ok.passed), spent[0], spent[1], c, getattr(plan, "stand_time", np.nan)))
    print(i, falls[i].start_class, plan.status.name, f"robust {plan.robust:.2f} fresh {fresh:.2f} rounds {plan.rounds} rollouts {plan.rollouts} sim-s {spent[0]:.0f} sim-cpu {spent[1]:.1f} cpu {c:.1f} wall {w:.1f} stand {getattr(plan, 'stand_time', np.nan):.2f}", "preflight", ok and (ok.passed or str(ok)[:90]), flush=True)
r = np.array(rows, float)
print("SUM", "stood %d of %d, passed %d, fresh %.3f, fresh=1: %d, median sim-s %.0f, cpu %.2f (p90 %.1f), sim share %.2f, stand %.2f" % (r[:, 0].sum(), len(r), r[:, 3].sum(), r[:, 2].mean(), (r[:, 2] == 1).sum(), np.median(r[:, 4]), np.median(r[:, 6]), np.percentile(r[:, 6], 90), (r[:, 5] / r[:, 6]).mean(), np.nanmedian(r[:, 7])))
