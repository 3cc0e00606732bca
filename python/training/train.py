"""Trains with PyTorch the networks that `edgepuck train` does not, best on a GPU. Python 3.11 or later.

    pip install ./python torch cupy-cuda13x
    python train.py set-64 train.npz --out set-64.safetensors

trains `edgepuck.torch.SetNetwork` on a packed set of clouds of up to 1,024 points each, by the recipe set-64.toml, and
writes a model file for infer-cpu. A processor alone needs no cupy.

    pip install numpy safetensors torch
    python train.py paper CLOUDS SCANS OUT NAME...

trains networks of reproduce.py side by side, by the recipe of a plan: see side_by_side.py.
"""

import argparse
from pathlib import Path

import torch

HERE = Path(__file__).resolve().parent
PLAN = HERE.parents[1] / "assets/reproduce/paper.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    networks = parser.add_subparsers(dest="networks", required=True)
    one = networks.add_parser("set-64", help="a network of set abstractions")
    one.add_argument("data", type=Path, help="packed NPZ file of clouds")
    one.add_argument("--out", type=Path, required=True, help="model file to write")
    one.add_argument("--recipe", type=Path, default=HERE / "set-64.toml", help="another recipe")
    one.add_argument("--epochs", type=int, help="epochs in place of the recipe's")
    one.add_argument("--seed", type=int, help="seed in place of the recipe's")
    one.add_argument("--held", type=int, choices=range(10), help="the tenth of the clouds to keep back and test on")
    some = networks.add_parser("paper", help="networks of the paper's experiments")
    some.add_argument("clouds", type=Path, help="folder with train.npz, ModelNet40's packed training clouds")
    some.add_argument("scans", type=Path, help="folder `data` of reproduce.py")
    some.add_argument("out", type=Path, help="its folder `models`, in which it uses the networks that it finds")
    some.add_argument("name", nargs="+", help="random-N, farthest-N or on-SET")
    some.add_argument("--plan", type=Path, default=PLAN, help="another plan, which states all of its recipe")
    args = parser.parse_args()
    torch.backends.cuda.matmul.allow_tf32 = True
    # The two need different packages.
    if args.networks == "set-64":
        import set_training

        set_training.train(args.data, args.out, args.recipe, args.epochs, args.seed, args.held)
    else:
        import side_by_side

        side_by_side.train(args.clouds, args.scans, args.out, args.name, args.plan)


if __name__ == "__main__":
    main()
