import sys; sys.path[:0]=["python/training/birdseye","python/training/birdseye","../shared/probes"]
import numpy as np, torch, subprocess, pathlib
from grid import *; from network import *
import export
torch.manual_seed(1)
model=sys.argv[1] if len(sys.argv)>1 else None
net=BirdsEye()
if model: net.load_state_dict(torch.load(model,map_location="cpu")["mean"])
else:
    for m in net.modules():
        if isinstance(m,torch.nn.BatchNorm2d): m.running_mean.normal_(0,.1); m.running_var.uniform_(.5,2); m.weight.data.uniform_(.5,1.5); m.bias.data.normal_(0,.2)
    net.head.bias.data[:16]=-1
net.eval()
for m in net.modules():
    if hasattr(m,'weight') and m.weight is not None: pass
torch.save({"mean":net.state_dict(),"step":0},"p.pt")
sc=sys.argv[2] if len(sys.argv)>2 else "target/scenes/000.npz"
sys.argv=["export","p.pt","p.safetensors",sc,"--set","x"]; export.main()
import hierarchy as hier, curve, edgepuck as ep
fr=hier.Frame("../shared/data/real_frames4/pandaset002_02.npz"); lab=ep.segment(fr.P.astype(np.float32))
np.column_stack([fr.P,lab]).astype('<f4').tofile("frame.bin")
for prec in ("f32","i8"):
    o=subprocess.run(["target/release/examples/bev_dev","p.safetensors","frame.bin",prec,"1","3"],capture_output=True,text=True); print(o.stderr[-300:]); R=[list(map(float,l.split())) for l in o.stdout.splitlines()]; print(len(R)); [print(r) for r in R[:4]]
over=heights(fr.P,lab==-1); X=np.column_stack([fr.P[:,:2],over,lab==-1]).astype(np.float32)[(lab!=-3)&(over>LOWEST_M)&(over<HIGHEST_M)]
img=raster(X,-REACH_M,-REACH_M,400)
with torch.no_grad(): y=net(torch.from_numpy(img)[None])[0]
p=torch.sigmoid(y[:4])
print("top torch",[ (round(float(v),4), int(i)//160000, -40+.2*((int(i)%160000)//400+.5), -40+.2*(int(i)%400+.5)) for v,i in zip(*p.flatten().topk(4))])
