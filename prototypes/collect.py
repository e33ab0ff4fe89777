"""Collect today's plans: `collect.py LIMIT SEED OUT [FIRST LAST]`; keeps every rollout of every round."""
import pickle, sys, time
from dataclasses import replace
import numpy as np
import humanoid_getup as hg
from humanoid_getup.filtering.dynamics_filter import DynamicsFilter
from humanoid_getup.simulation.falls import sample_falls
from humanoid_getup.strategies import planned_rise as pr
from robots import TorqueLimit

lim, seed, out = float(sys.argv[1]), int(sys.argv[2]), sys.argv[3]
robot = hg.load_robot("op3"); world = hg.World(robot)
falls = sample_falls(world, dict.fromkeys(("supine", "prone", "lateral"), 20), np.random.default_rng(seed))
limit = TorqueLimit(lim, "pwm")
planner = pr.PlannedRise(world, torque_limit=limit)
planner.filter = DynamicsFilter(world, torque_limit=limit, threads=1)
kept = []
checks = []
check0, round0 = planner.filter.check, planner._round
def check(start, target, rng):
    share = check0(start, target, rng); checks.append((target, share)); return share
planner.filter.check = check
def round_(progress, candidates):
    round0(progress, candidates)
    if candidates:
        rows = []
        for r in progress.tried:
            share = next((s for t, s in checks if t is r.target), None)
            rows.append((replace(r, target=r.target[:r.moving].astype(np.float32), qpos=r.qpos[:r.moving].astype(np.float32)), share))
        kept.append((progress.rounds, rows))
planner._round = round_
sel = range(*map(int, sys.argv[4:6])) if len(sys.argv) > 4 else range(60)
for i in sel:
    kept.clear(); checks.clear()
    t = time.time()
    plan = planner.plan(falls[i].posture, np.random.default_rng([seed, i]))
    row = dict(i=i, kind=falls[i].start_class, start=falls[i].posture, plan=plan, rounds=list(kept))
    pickle.dump(row, open(f"{out}_{i:02d}.pkl", "wb"))
    print(i, falls[i].start_class, plan.status.name, f"robust {plan.robust:.2f} rounds {plan.rounds} plan {plan.plan_s:.1f} filter {plan.filter_s:.1f}",
          [(n, sum(r.stood for r, _ in rows), len(rows), [round(s, 2) for _, s in rows if s is not None]) for n, rows in kept], flush=True)
