"""Ways to search, side by side: `ways.py WAY LIMIT FILE:ROUND:ROW ...`; a budget in simulated seconds."""
import pickle, sys, time
from dataclasses import replace
import cma, numpy as np
import humanoid_getup as hg
from humanoid_getup.filtering.dynamics_filter import *
from humanoid_getup.filtering.reference import align_motion, resample
from rehearsal_v0 import Rehearsal, RECORDED
from humanoid_getup.simulation.rollout import randomize_rollouts
from humanoid_getup.simulation.world import count_substeps
from robots import TorqueLimit, quaternion
from robots.kinematics import place

BUDGET = 1500.0
robot = hg.load_robot("op3"); world = hg.World(robot); dt = robot.control_period
lay = robot.layout(world.model); HOLDN = count_substeps(world.model, dt)
names = list(robot.joint_names)
PAIRS = ["sho_pitch", "sho_roll", "el", "hip_roll", "hip_pitch", "knee", "ank_pitch"]
def directions():
    B = []
    for p in PAIRS:
        v = np.zeros(robot.n); v[names.index("l_" + p)] = 1.0
        B.append(v + robot.mirror_joints(v))
    return np.array(B)
B = directions()
rehs = {}
def reh(n):
    if n not in rehs: rehs[n] = Rehearsal(world, n, threads=2)
    return rehs[n]

class Case:
    def __init__(self, row, r, lim):
        self.row, self.r, self.lim = row, r, lim
        self.base = r.target.astype(float)
        self.start = place(robot, world.model, row["start"])
        self.spent = 0.0
    def worlds(self, n, seed):
        s, p = randomize_rollouts(world, self.start, n, CHECK_DISTURBANCE, self.lim, np.random.default_rng(seed))
        return s, replace(p, pwm_limited=np.full(n, True))
    def play(self, targets, W, give_up=False, which=None):
        """(S) targets in the worlds W (starts, parameters), all pairs -> Rehearsed of S*K"""
        s, p = W
        if which is not None:
            s = s[which]; p = take(p, which)
        K, S = len(s), len(targets)
        o = reh(S * K).play(np.tile(s, (S, 1)), [t for t in targets for _ in range(K)], p.tile(S), give_up=give_up)
        self.spent += o.simulated
        return o
    def fresh(self, target):
        spent = self.spent
        o = self.play([target], self.worlds(16, [999, self.row["i"]]))
        self.spent = spent
        return o
def take(p, which):
    from dataclasses import fields
    return type(p)(**{f.name: getattr(p, f.name)[which] for f in fields(p)})

def limit_speed(t, first):
    t = np.clip(t, robot.lower, robot.upper); reach = robot.max_velocity * dt * .99
    out = np.empty_like(t); last = first
    for k in range(len(t)):
        last = np.clip(t[k], last - reach, last + reach); out[k] = last
    return out
S_ = 6
DIM = S_ + S_ * len(B)
def make(base, x, first):
    """S tempos (log) and mirrored offsets at S knots (zero at both ends)"""
    T = len(base); kt = np.linspace(0, T - 1, S_ + 1)
    dur = np.diff(kt) * np.exp(0.3 * np.clip(x[:S_], -2.5, 2.5)); new = np.concatenate([[0], np.cumsum(dur)])
    L = int(np.ceil(new[-1])) + 1
    src = np.interp(np.arange(L), new, kt)
    lo = src.astype(int); hi = np.minimum(lo + 1, T - 1); w = (src - lo)[:, None]
    t = base[lo] * (1 - w) + base[hi] * w
    ko = np.linspace(0, T - 1, S_ + 2)
    off = np.zeros((S_ + 2, len(B))); off[1:-1] = 0.15 * x[S_:].reshape(S_, -1)
    o = np.stack([np.interp(src, ko, c) for c in off.T], 1) @ B
    return limit_speed(t + o, first)

def graded(o, K):
    st = o.stood.reshape(-1, K).mean(1); pr = o.progress.reshape(-1, K).mean(1)
    return st, -(st + pr) + 0.02 * o.rms_torque.reshape(-1, K).mean(1)

def accept(case, target):
    o = case.play([target], case.worlds(16, [55, case.row["i"]]), give_up=True)
    return o.stood[0] and o.stood.mean() >= 15 / 16, o.stood.mean() if o.stood[0] else 0.

def way_cma(case, K=4, pop=12, seed=1):
    W = case.worlds(K, [7, seed]); first = robot_first(case)
    es = cma.CMAEvolutionStrategy(np.zeros(DIM), 0.4, dict(popsize=pop, verbose=-9, seed=seed, CMA_diagonal=True))
    best = None; gen = 0; X = None
    while case.spent < BUDGET:
        X = es.ask(); 
        if gen == 0: X[0] = np.zeros(DIM)
        T = [make(case.base, x, first) for x in X]
        st, cost = graded(case.play(T, W), K)
        es.tell(X, list(cost)); gen += 1; b = int(np.argmin(cost))
        for b in np.argsort(cost)[:2]:
            if st[b] == 1.0:
                ok, sh = accept(case, T[b])
                if best is None or sh > best[0]: best = (sh, T[b])
                if ok: return T[b], gen
    return (best[1] if best else None), gen

def robot_first(case): return case.start[lay.qpos]

def way_race(case, K=16, pop=10, seed=1, tempo=True):
    """(1+lambda) with the incumbent's worst worlds first, survivors in all"""
    rng = np.random.default_rng(seed); W = case.worlds(K, [55, case.row["i"]]); first = robot_first(case)
    x = np.zeros(DIM); sigma = 0.5
    o = case.play([case.base], W, which=np.arange(8))
    st = o.stood.copy(); hard = np.argsort(np.where(np.arange(8) == 0, -1, st + o.progress), kind="stable")[:3]
    inc = np.mean(st + o.progress); inc_hard = None; best = (0.0, None); gen = 0
    inc_hard = np.mean((st + o.progress)[hard])
    while case.spent < BUDGET:
        gen += 1
        # sparse perturbations: one stretch of tempo and offsets at one knot, or all tempos
        X = []
        for _ in range(pop):
            d = rng.normal(size=DIM)
            k = rng.integers(S_)
            m = np.zeros(DIM); m[k] = 1; m[S_ + k * len(B): S_ + (k + 1) * len(B)] = 1
            if rng.random() < .3: m[:S_] = 1; m[S_:] = 0
            if rng.random() < .3: m[:] = .6
            X.append(x + sigma * 1.5 * d * m)
        T = [make(case.base, q, first) for q in X]
        o = case.play(T, W, which=hard)
        sc = (o.stood + o.progress).reshape(pop, -1).mean(1)
        order = np.argsort(-sc)
        moved = False
        for b in order[:2]:
            if sc[b] <= inc_hard: break
            if o.stood.reshape(pop, -1)[b].all():
                rest = case.play([T[b]], W)
                share = rest.stood.mean() if rest.stood[0] else 0
                if share > best[0]: best = (share, T[b])
                if share >= 15 / 16 and rest.stood[0]: return T[b], gen
                full = rest.stood + rest.progress
                if share >= best[0]:
                    x, moved = X[b], True
                    hard = np.argsort(np.where(np.arange(K) == 0, -1, full), kind="stable")[:3]; inc_hard = full[hard].mean()
                    break
            else:
                x, inc_hard, moved = X[b], sc[b], True; break
        sigma = np.clip(sigma * (1.3 if moved else 0.85), .15, 1.0)
    return best[1], gen

def reference(case):
    """per cycle of the base: gravity in the torso, root height, joint angles of the planned reference."""
    c = case.r.candidate; m = c.connection.motion
    path = resample(c.path, c.tempo, dt); p, q = align_motion(m, c.connection.frame, path.posture(-1))
    f = c.connection.frame
    ori = np.concatenate([path.orientation, q[f:]]); z = np.concatenate([path.position[:, 2], p[f:, 2]]); jp = np.concatenate([path.joint_pos, m.joint_pos[f:]])
    # phase by re-tracking one world
    filt = DynamicsFilter(world, torque_limit=TorqueLimit(case.lim, "pwm"), threads=1)
    ref = filt._refer(c)
    ref_t = ref.target
    # monotone match of recorded targets to the reference (the rate is within .2 and 1)
    ph = np.zeros(len(case.base)); k = 0.0
    cand = np.linspace(0.2, 1.0, 9)
    for i in range(1, len(case.base)):
        pos = np.minimum(k + cand, len(ref_t) - 1); lo = pos.astype(int); hi = np.minimum(lo + 1, len(ref_t) - 1); w = (pos - lo)[:, None]
        e = np.abs(ref_t[lo] * (1 - w) + ref_t[hi] * w - case.base[i]).sum(1)
        k = pos[int(np.argmin(e - 1e-6 * cand))]; ph[i] = k
    idx = np.minimum(np.round(ph).astype(int), len(ori) - 1)
    return quaternion.gravity_in_body(ori[idx]), z[idx], jp[idx]

def way_samcon(case, S=24, keep=4, K=3, window=0.25, seed=1, sigma=0.12, rounds=3):
    first = robot_first(case)
    nominal = case.r.stood
    if nominal:
        q = case.r.qpos.astype(float); G = quaternion.gravity_in_body(q[:, lay.root_orientation]); Z = q[:, lay.root_qpos + 2]; J = q[:, lay.qpos]
    else: G, Z, J = reference(case)
    T = len(case.base); w = round(window / dt); best = (0, None)
    base = case.base; hold = round(0.8 / dt)
    pad = lambda a: np.concatenate([a, np.repeat(a[-1:], hold + 2 * w, 0)])
    Gp, Zp, Jp, Bp = pad(G), pad(Z), pad(J), pad(base)
    for rnd in range(rounds):
        rng = np.random.default_rng([seed, rnd])
        s, p = case.worlds(K, [70 + rnd, seed]); R = reh(S * K); sim = R.sim
        sim.set_parameters(sim.everyone, p.tile(S)); sim.place(sim.everyone, np.tile(s, (S, 1)))
        state = sim.batch.state.copy().reshape(S, K, -1)[:1].repeat(keep, 0)  # (keep, K, ns)
        last = np.tile(first, (keep, 1)); offs = np.zeros((keep, len(B))); hist = [[] for _ in range(keep)]; acc = np.zeros(keep)
        for k in range(0, T + hold, w):
            parent = np.arange(S) % keep
            new = offs[parent] * 0.7 + rng.normal(scale=sigma, size=(S, len(B))) * (rng.random((S, len(B))) < .5)
            new[:keep] = offs * (0.7 if True else 1)   # continue without a new offset
            if k >= T - 2 * w: new = new * 0.5
            ramp = np.linspace(1 / w, 1, w)[:, None]
            tg = np.array([Bp[k:k + w] + ((1 - ramp) * offs[parent[i]] + ramp * new[i]) @ B for i in range(S)])
            tg = np.array([limit_speed(t, last[parent[i]]) for i, t in enumerate(tg)])
            sim.batch.state[:] = state[parent].reshape(S * K, -1)
            sim.advance(np.repeat(tg, K, 0), HOLDN); case.spent += S * K * w * dt
            q = sim.qpos
            e = min(k + w, len(Gp) - 1)
            g = quaternion.gravity_in_body(q[:, lay.root_orientation])
            c = 2.0 * ((g - Gp[e]) ** 2).sum(1) + 30.0 * (q[:, lay.root_qpos + 2] - Zp[e]) ** 2 + 0.1 * ((q[:, lay.qpos] - Jp[e]) ** 2).mean(1) + 0.02 * (sim.qvel[:, lay.root_dof + 3: lay.root_dof + 6] ** 2).mean(1)
            c = c.reshape(S, K); c = 0.5 * c.mean(1) + 0.5 * c.max(1) + 0.05 * (new ** 2).mean(1)
            tot = 0.5 * acc[parent] + c
            order = np.argsort(tot)[:keep]
            snap = sim.batch.state.copy().reshape(S, K, -1)
            state = snap[order]; last = tg[order, -1]; acc = tot[order]
            hist = [hist[parent[o]] + [tg[o]] for o in order]; offs = new[order]
        for h in hist[:2]:
            t = np.concatenate(h)
            ok, sh = accept(case, t)
            if sh > best[0]: best = (sh, t)
            if ok: return t, rnd + 1
        if case.spent > BUDGET: break
    return best[1], rnd + 1

if __name__ == "__main__":
    way, lim = sys.argv[1], float(sys.argv[2])
    for spec in sys.argv[3:]:
        f, rd, k = spec.rsplit(":", 2)
        row = pickle.load(open(f, "rb")); r, share = dict(row["rounds"])[int(rd)][int(k)]
        case = Case(row, r, lim)
        if r.candidate.before is not None: continue
        o0 = case.fresh(case.base); c = time.process_time()
        target, gen = globals()["way_" + way](case)
        c = time.process_time() - c; spent = case.spent
        o1 = case.fresh(target) if target is not None else None
        fmt = lambda o: "none" if o is None else f"{o.stood.mean() if o.stood[0] else 0:.2f}({o.stood.mean():.2f}) rms {o.rms_torque.mean():.2f} peak {o.peak_torque.mean():.2f} imp {np.median(o.impact):.2f} ov {1e3*o.overlap.max():.1f} t {np.nanmedian(o.stand_time) if o.stood.any() else 0:.1f}"
        solved = o1 is not None and o1.stood[0] and o1.stood.mean() >= 15 / 16
        print(way, spec.split("_")[-1], r.candidate.connection.motion.name, "SOLVED" if solved else "not", f"gen {gen} sim-s {spent:.0f} cpu {c:.1f}", "|", fmt(o0), "->", fmt(o1), flush=True)
