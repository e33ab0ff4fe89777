import numpy as np, humanoid_getup as hg
from humanoid_getup.motions import motion_database as md
from humanoid_getup.motions.motion_database import _is_same
robot=hg.load_robot('op3')
import inspect; print(inspect.getsource(_is_same))
for p in sorted((robot.folder/md.MOTION_FOLDER).glob('*.npz')):
    m=md._load_own(p,robot); w=m.mirrored(robot)
    print(m.name,_is_same(m,w),'target diff max %.4f'%np.abs(m.joint_target-w.joint_target).max(),'pos %.4f'%np.abs(m.joint_pos-w.joint_pos).max(), len(m.time)*.008)
