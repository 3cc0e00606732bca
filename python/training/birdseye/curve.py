"""curve.py MODEL.pt [--ask] : found at so many false ones a frame, by source and class."""
import sys, glob, os, collections, pickle
sys.path[:0] = ["python/training/birdseye", "../shared/probes"]
import numpy as np, torch
from torch.nn import functional as F
import hierarchy as hier
from grid import *
from network import *
torch.set_num_threads(2)
PEAK=[7,3,5,9]; APART=[1.5,.4,.8,3.0]
FILES=sorted(glob.glob("../shared/data/real_frames*/*.npz"))
def frames():
    p="target/frames.pkl"
    if os.path.exists(p): return pickle.load(open(p,"rb"))
    import edgepuck as ep
    out=[]
    for f in FILES:
        fr=hier.Frame(f); z=np.load(f,allow_pickle=True); rings=z["laser"].astype(np.uint16) if "laser" in z.files else None
        lab=ep.segment(fr.P.astype(np.float32),rings=rings)
        fr.names=["truck" if c=="bus" else c for c in fr.names]
        del fr.z_at
        out.append((f,fr,lab,rings))
    pickle.dump(out,open(p,"wb")); return out
def find(net,P,lab,least=0.05):
    X,use=points_of(P,lab); X=X.astype(np.float32); X[:,:3]/=100
    n=int(2*REACH_M/CELL_M)
    with torch.no_grad(): y=net(torch.from_numpy(raster(X,-REACH_M,-REACH_M,n)[None]))[0]
    p=torch.sigmoid(y[:4]); top=torch.stack([F.max_pool2d(p[None,i:i+1],k,1,k//2)[0,0] for i,k in enumerate(PEAK)])
    y,p=y.numpy(),p.numpy(); kept=[]
    cand=[(p[c,i,j],c,-REACH_M+(i+.5+y[4,i,j])*CELL_M,-REACH_M+(j+.5+y[5,i,j])*CELL_M,*np.exp(np.clip(y[6:9,i,j],-2,3)),np.arctan2(y[10,i,j],y[9,i,j])/2) for c,i,j in zip(*np.nonzero((p==top.numpy())&(p>=least)))]
    for d in sorted(cand,reverse=True):
        if all(np.hypot(d[2]-e[2],d[3]-e[3])>max(APART[d[1]],APART[e[1]])*(1. if d[1]==e[1] else .6) for e in kept): kept.append(d)
    h=np.full(len(P),9.); h[use]=X[:,2]; out=np.full(len(P),-2); objs={}
    for k,(q,c,x,yy,l,w,hh,yaw) in enumerate(kept):
        d=P[:,:2]-(x,yy); e=(np.cos(yaw),np.sin(yaw))
        box=np.hypot(*d.T)<.55 if c==1 else (abs(d@e)<l/2+.15)&(abs(d@(-e[1],e[0]))<w/2+.15)
        m=box&use&(lab!=-1)&(out==-2)&(h<4)
        if m.sum()>=5: out[m]=k; objs[k]=(NAMES[c],float(q))
    return out,objs
def judge(fr,lab,objects):
    """(asked by class), [(class, score of found)], [(class, score of false)]"""
    asked=collections.Counter(); found=[]; false=[]
    for b,c in zip(fr.boxes,fr.names):
        if not c or not fr.judged(*b[:2]): continue
        m=hier.inside(fr.P,b)
        if m.sum()<30: continue
        standing=lab[m&~fr.ground]; cut=standing[standing>=0]; asked[c]+=1
        if len(cut):
            k=np.bincount(cut).argmax(); of=lab==k
            if (cut==k).sum()>=.5*len(standing) and hier.inside(fr.P[of],b,.3).sum()>=.5*of.sum() and objects.get(k,(None,))[0]==c: found.append((c,objects[k][1]))
    for k,(c,q) in objects.items():
        X=fr.P[lab==k]
        if fr.judged(*hier.middle(X)) and not any(d in (c,None) and hier.inside(X,b,.3).sum()>=.5*len(X) for b,d in zip(fr.boxes,fr.names)): false.append((c,q))
    return asked,found,false
def source(f):
    b=os.path.basename(f); return b.split("_")[0]
def table(results,title):
    by=collections.defaultdict(list)
    for f,r in results: by[source(f)].append(r); by["ALL"].append(r)
    print("==",title)
    for c in NAMES:
        for s,rs in by.items():
            asked=sum(r[0][c] for r in rs)
            if not asked: continue
            fs=np.array(sorted((q for r in rs for cc,q in r[2] if cc==c),reverse=True)); fo=np.array([q for r in rs for cc,q in r[1] if cc==c])
            row=[]
            for a in (.25,.5,1,2,4):
                n=int(a*len(rs)); t=fs[n] if len(fs)>n else 0.05
                row.append(f"{(fo>t).sum()}({t:.2f})")
            print(f"{c:12} {s:12} {asked:4} | "+"  ".join(row))
def main():
    net=BirdsEye(); s=torch.load(sys.argv[1],map_location="cpu"); net.load_state_dict(s["mean"] if "mean" in s else s); net.eval()
    R=[]; keep=[]
    for f,fr,lab,rings in frames():
        L,O=find(net,fr.P,lab); R.append((f,judge(fr,L,O))); keep.append((L,O))
    table(R,f"{sys.argv[1]} step {s.get('step')}")
    if "--ask" in sys.argv:
        import edgepuck as ep
        ask=ep.Classifier("street-128"); classes=list(ask.classes); of={"car":["car"],"person":["person"],"two-wheeler":["two-wheeler"],"truck":["truck","bus"]}
        R2=[]
        for (f,fr,lab,rings),(L,O) in zip(frames(),keep):
            z_at=hier.ground_height(fr.P,fr.ground); B={}
            for k,(c,q) in O.items():
                X=fr.P[L==k].astype(np.float32); a=ask(X,ground_z=z_at(hier.middle(X))).logits.astype(float); a=np.exp(a-a.max()); a/=a.sum()
                B[k]=(c,(q**3*sum(a[classes.index(n)] for n in of[c] if n in classes))**.25)
            R2.append((f,judge(fr,L,B)))
        table(R2,"asked")
if __name__=="__main__": main()
