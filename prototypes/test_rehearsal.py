"""Does the early end change a verdict? Compare with whole rollouts."""
import pickle,glob,sys,time,numpy as np
import humanoid_getup as hg
from humanoid_getup.filtering.dynamics_filter import *
from humanoid_getup.filtering.rehearsal import Rehearsal
from humanoid_getup.simulation.rollout import randomize_rollouts
from robots import TorqueLimit
from robots.kinematics import place
robot=hg.load_robot('op3'); world=hg.World(robot); lim=TorqueLimit(2.0,'pwm')
filt=DynamicsFilter(world,torque_limit=lim,threads=1); reh=Rehearsal(world,16,threads=1)
tot=np.zeros(5); agree=n=0
for f in sys.argv[1:]:
    r=pickle.load(open(f,'rb'))
    for x,s in r['rounds'][1][1]:
        if not x.stood: continue
        t=x.target.astype(float); rng=lambda: np.random.default_rng([3,r['i']])
        starts,par=randomize_rollouts(world,place(robot,world.model,r['start']),16,CHECK_DISTURBANCE,2.0,rng())
        par=replace(par,pwm_limited=np.full(16,True))
        c=time.process_time(); o=reh.play(starts,[t]*16,par); c=time.process_time()-c
        w=hold_last(t,len(t)+round(3.3/.008)); ro,_=filt._prepare(par)
        d=time.process_time(); tr=ro.play(starts,np.tile(w,(16,1,1)),par); st=np.array([judge(u,tr.period).stood for u in is_upright(measure_stance(world,tr),robot)]); d=time.process_time()-d
        agree+=(st==o.stood).sum(); n+=16
        print(r['i'],x.moving,'share',st.mean(),o.stood.mean(),'cpu %.2f -> %.2f'%(d,c),'sim-s',round(16*len(w)*.008),round(o.simulated),'rms %.2f peak %.2f imp %.2f ov %.4f'%(o.rms_torque.mean(),o.peak_torque.max(),o.impact.max(),o.overlap.max()),flush=True)
        break
print(agree,n)
