import pickle,sys,numpy as np
tot=[]
for i in map(int,sys.argv[1].split(',')):
    r=pickle.load(open(f'/tmp/srch/a20_{i:02d}.pkl','rb')); a=b=0
    for n,rows in r['rounds']:
        L=max(x.moving for x,_ in rows)+125
        a+=len(rows)*L*.008; b+=sum(s is not None for _,s in rows)*16*(L+288)*.008
    p=r['plan']; tot.append((a,b,p.robust,getattr(p,'stand_time',np.nan)))
    print(i,'track %.0f check %.0f'%(a,b),p.status.name,p.robust,'stand %.2f'%tot[-1][3])
t=np.array(tot,float); print('median track %.0f check %.0f both %.0f stand %.2f'%(np.median(t[:,0]),np.median(t[:,1]),np.median(t[:,0]+t[:,1]),np.nanmedian(t[:,3])))
