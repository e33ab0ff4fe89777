"""Ensemble patience: one candidate tracked in K worlds at once that all get the same targets.

The rate of time along the reference is the least of the worlds (or a quantile), the virtual actuator's
torque that of the nominal world or the mean. What comes out waits for the weakest of the worlds.
"""
import pickle, sys, time
from dataclasses import replace
import numpy as np
import humanoid_getup as hg
from humanoid_getup.filtering import dynamics_filter as df
from humanoid_getup.filtering.dynamics_filter import *
from humanoid_getup.evaluation.standing import *
from robots import TorqueLimit

class EnsembleTracker(df._Tracker):
    K = 4; rate_mode = "min"; torque_mode = "nominal"
    def _proceed(self, state):
        lag = np.abs(self._last - state.joint_pos).max(axis=1)
        rate = np.clip(1.0 - (lag - self._tolerance) / self._band, self._slowest, 1.0)
        g = rate.reshape(-1, self.K)
        if self.rate_mode == "min": r = g.min(1)
        elif self.rate_mode == "mean": r = g.mean(1)
        elif self.rate_mode == "q25": r = np.quantile(g, .25, axis=1)
        else: r = g[:, 0]
        rate = np.repeat(r, self.K)
        late = state.step >= LONGEST_STRETCH * self._count
        self._phase = np.where(late, self._phase, np.minimum(self._phase + rate, self._count))
        ended = late | (self._phase >= self._count)
        self.moving[ended & (self.moving == 0)] = state.step
    def _assist(self, *a):
        t = super()._assist(*a)
        g = t.reshape(-1, self.K, t.shape[1])
        r = g.mean(1) if self.torque_mode == "mean" else g[:, 0]
        return np.repeat(r, self.K, axis=0)

def track(filt, start, candidates, K, rng, rate="min", torque="nominal"):
    world = filt.world; robot = world.robot
    refs = [filt._refer(c) for c in candidates for _ in range(K)]
    cs = [c for c in candidates for _ in range(K)]
    tr = EnsembleTracker(world, filt._limbs, start, refs, cs)
    tr.K, tr.rate_mode, tr.torque_mode = K, rate, torque
    starts, par = df.randomize_rollouts(world, df.place(robot, world.model, start), K, CHECK_DISTURBANCE, filt.torque_limit.largest(robot), rng)
    n = len(cs)
    ro, par = filt._prepare(par.tile(len(candidates)))
    trace = ro.track(np.tile(starts, (len(candidates), 1)), tr, par)
    st = measure_stance(world, trace)
    up = is_upright(st, robot)
    stood = np.array([judge(u, trace.period, hold_time=FIRST_HOLD - .1).stood for u in up]).reshape(-1, K)
    return [dict(target=trace.target[i * K], moving=tr.moving[i * K], stood=stood[i], steps=trace.target.shape[1]) for i in range(len(candidates))]

if __name__ == "__main__":
    lim, pre, sel = float(sys.argv[1]), sys.argv[2], [int(a) for a in sys.argv[3].split(",")]
    robot = hg.load_robot("op3"); world = hg.World(robot)
    filt = DynamicsFilter(world, torque_limit=TorqueLimit(lim, "pwm"), threads=1)
    P = Patience(tolerance=.15, band=.15, slowest=.2)
    confs = {"nominal": (1, "nominal", "nominal"), "min4": (4, "min", "nominal"), "min4mean": (4, "min", "mean"), "mean4": (4, "mean", "mean"), "min8": (8, "min", "mean")}
    for i in sel:
        row = pickle.load(open(f"{pre}_{i:02d}.pkl", "rb"))
        cands = []
        for n, rows in row["rounds"]:
            for r, _ in rows:
                c = r.candidate
                if c.before is None and c.patience is None and not any(c.path is d.path for d in cands): cands.append(c)
        cands = [replace(c, patience=P) for c in cands[:6]]
        line = []
        for name, (K, rm, tm) in confs.items():
            t = time.time()
            out = track(filt, row["start"], cands, K, np.random.default_rng([5, i]), rm, tm)
            dt = time.time() - t
            sh = [filt.check(row["start"], o["target"], np.random.default_rng([99, i])) if o["stood"].any() else 0. for o in out]
            print(i, row["kind"], name, "%.1fs" % dt, [(int(o["stood"].sum()), round(s, 2), round(o["moving"]*.008,1)) for o, s in zip(out, sh)], flush=True)
