"""The clean search on the same cases: `eval_search.py LIMIT BUDGET SEED NAME=VALUE,... FILE:ROUND:ROW ...`."""
import pickle, sys, time
import numpy as np
import humanoid_getup as hg
from humanoid_getup.filtering import search as se, variation as va
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from robots import TorqueLimit

lim, budget, seed = float(sys.argv[1]), float(sys.argv[2]), int(sys.argv[3])
for kv in filter(None, sys.argv[4].split(",")):
    k, v = kv.split("=")
    if k == "CHUNK":
        from humanoid_getup.filtering import rehearsal; rehearsal.CHUNK = int(v); continue
    mod = se if hasattr(se, k) else va; setattr(mod, k, type(getattr(mod, k))(float(v)))
robot = hg.load_robot("op3"); world = hg.World(robot)
filt = DynamicsFilter(world, torque_limit=TorqueLimit(lim, "pwm"), threads=2)
tot = []
for spec in sys.argv[5:]:
    f, rd, k = spec.rsplit(":", 2)
    row = pickle.load(open(f, "rb")); r, share = dict(row["rounds"])[int(rd)][int(k)]
    start = row["start"]; base = r.target.astype(float)
    W = filt._disturb(start, np.random.default_rng([seed, 55, row["i"]])); F = filt._disturb(start, np.random.default_rng([999, row["i"]]))
    c, w = time.process_time(), time.time()
    o = filt._search.search(W, base, budget, np.random.default_rng([seed, row["i"]]))
    c, w = time.process_time() - c, time.time() - w
    x = filt._rehearsal.play(F, [o.target]); fresh = x.stood.mean() if x.stood[0, 0] else 0
    tot.append((fresh >= 15 / 16, fresh, o.simulated, c))
    print(spec.split("_")[-1], r.candidate.connection.motion.name, f"share {o.share:.2f} fresh {fresh:.2f} gen {o.generations} sim-s {o.simulated:.0f} cpu {c:.1f} wall {w:.1f}", flush=True)
t = np.array(tot, float)
print("SUM", sys.argv[4], "solved %d of %d, mean fresh %.2f, median sim-s %.0f, cpu %.1f" % (t[:, 0].sum(), len(t), t[:, 1].mean(), np.median(t[:, 2]), np.median(t[:, 3])))
