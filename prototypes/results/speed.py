import pickle, time, copy, sys, numpy as np, mujoco
import humanoid_getup as hg
from humanoid_getup.simulation.rollout import *
from humanoid_getup.simulation.domain_parameters import DomainParameters
from robots.kinematics import place
robot=hg.load_robot('op3'); world=hg.World(robot)
r=pickle.load(open('/tmp/srch/a20_00.pkl','rb'))
roll=[x for n,rows in r['rounds'] for x,_ in rows][5]
T=roll.target.astype(float); start=place(robot,world.model,r['start'])
print('T',len(T),'substeps',count_substeps(world.model,robot.control_period))
def bare(model):
    d=mujoco.MjData(model); d.qpos[:]=start; t=time.perf_counter(); k=round(robot.control_period/model.opt.timestep)
    for u in T:
        d.ctrl[:]=u
        mujoco.mj_step(model,d,nstep=k)
    return len(T)*k/(time.perf_counter()-t)
print('bare',bare(world.model), bare(world.model))
spec=world.scene.build(robot); m0=spec.compile(); print('no sensors',bare(m0))
c=copy.copy(world.model); c.opt.timestep=.004; print('4ms',bare(c))
for name,w in (('2ms',world),('4ms',hg.World(robot,world.scene,model=c))):
  for n in (16,64):
    ro=Rollout(w,n,threads=1); p=DomainParameters.nominal(w,n)
    t=time.perf_counter(); ro._place(np.tile(start,(n,1)),p); t1=time.perf_counter()
    tr=ro.play(np.tile(start,(n,1)),np.tile(T,(n,1,1)),p); dt=time.perf_counter()-t1
    k=round(robot.control_period/w.model.opt.timestep)
    print(name,n,'place',t1-t,'steps/s',n*len(T)*k/dt,'simsec/s',n*len(T)*robot.control_period/dt)
