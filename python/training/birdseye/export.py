"""Writes the running means of a training as a model file for infer-cpu.

    python export.py OUT.pt OUT.safetensors SCENES.npz --set "what it was trained on"

Batch norms become part of their convolutions. The largest outputs of the layers, which int8 needs, are those of sweeps of
SCENES, but for two values in a million, which int8 clips.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import torch
from grid import CELL_M, NAMES, REACH_M, raster
from network import BirdsEye
from safetensors.torch import save_file
from torch import Tensor, nn
from train import Scenes

# The steps of infer-cpu/src/birdseye/plan.rs, and the parts of the network that they are.
PARTS = {
    "cell": "cell", "down1": "down1", "a1": "a", "down2": "down2", "b1": "b.0", "b2": "b.1", "down3": "down3", "c1": "c.0",
    "c2": "c.1", "down4": "down4", "d1": "d.0", "d2": "d.1", "up3": "up3", "join3": "join3", "up2": "up2", "join2": "join2",
    "up1": "up1", "join1": "join1", "head": "head",
}
# The sums, by the layer that takes each.
SUMS = {"sum3": "join3", "sum2": "join2", "sum1": "join1"}
# The share of outputs that may be greater than the range, and how many sweeps are looked at.
CLIPPED, N_SWEEPS = 2e-6, 24


def folded(block: nn.Module) -> tuple[Tensor, Tensor]:
    """The weights and biases of a convolution and its batch norm."""
    if isinstance(block, nn.Conv2d):
        return block.weight.detach(), block.bias.detach()
    layer, norm = block[0], block[1]
    scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return (layer.weight * scale[:, None, None, None]).detach(), (norm.bias - norm.running_mean * scale).detach()


def ranges(net: BirdsEye, scenes: Scenes) -> dict[str, float]:
    """The largest output of each step, but for few."""
    largest: dict[str, float] = {}

    def note(step: str, values: Tensor) -> None:
        n_clipped = max(1, int(values.numel() * CLIPPED))
        largest[step] = max(largest.get(step, 0.0), values.flatten().topk(n_clipped).values[-1].item())

    for step, part in PARTS.items():
        net.get_submodule(part).register_forward_hook(lambda _, __, out, step=step: note(step, out))
    for step, part in SUMS.items():
        net.get_submodule(part).register_forward_pre_hook(lambda _, inputs, step=step: note(step, inputs[0]))
    side = int(2 * REACH_M / CELL_M)
    for number in np.unique(np.linspace(0, len(scenes) - 1, N_SWEEPS).astype(int)):
        image = raster(scenes.sweep(number)[0], -REACH_M, -REACH_M, side)
        with torch.no_grad():
            net(torch.from_numpy(image)[None])
    del largest["head"]
    return largest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", type=Path)
    parser.add_argument("--set", required=True, help="what it was trained on, for the model's card")
    parser.add_argument("--asked", default="street-128", help="the model that is asked about what it sees")
    parser.add_argument("--confidence", type=Path, required=True, help="the file of confidence.py")
    asked = parser.parse_args()
    net = BirdsEye()
    saved = torch.load(asked.checkpoint, map_location="cpu")
    net.load_state_dict(saved["mean"])
    net.eval()
    tensors = {}
    for step, part in PARTS.items():
        weight, bias = folded(net.get_submodule(part))
        tensors |= {f"{step}.weight": weight.half().contiguous(), f"{step}.bias": bias.half().contiguous()}
    card = {
        "classes": json.dumps(NAMES), "normalization": "none", "training_set": asked.set,
        "activation_ranges": json.dumps({step: round(value, 4) for step, value in ranges(net, Scenes(asked.scenes)).items()}),
        "asked": asked.asked, "confidence": json.dumps(json.loads(asked.confidence.read_text())),
        "provenance": f"python/training/birdseye, {saved['step']} steps",
    }
    save_file(tensors, asked.out, card)


if __name__ == "__main__":
    main()
