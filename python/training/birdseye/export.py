"""Writes the running means of a training as a model file for infer-cpu.

    python export.py OUT.pt OUT.safetensors SCENES.npz... --set "what it was trained on"

Batch norms become part of their convolutions. The largest outputs of the layers, which int8 needs, are those of sweeps of
SCENES, but for two values in a million, which int8 clips. The first layers' are smaller, chosen for scores that are nearest to
those of f32: what they say of cells that hold little is near 0, and would be rounded to 0, which costs trucks most.
"""

import argparse
import json
from pathlib import Path

import numpy as np
import torch
from grid import NAMES, REACH_M, raster
from network import N_CLASSES, BirdsEye
from peaks import SIDE
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
# The share of outputs that may be greater than the range, and how many sweeps of all files are looked at.
CLIPPED, N_SWEEPS = 2e-6, 24
# The steps whose ranges are chosen, the shares of the largest output that are tried, and how often each step is.
CHOSEN, SHARES, ROUNDS = ("cell", "down1", "a1", "down2"), (0.08, 0.12, 0.16, 0.2, 0.25, 0.3, 0.36, 0.43, 0.5, 0.6, 0.75, 1.0), 2
# Scores whose logits are smaller are those of no objects.
LEAST_LOGIT = -3.0


def folded(block: nn.Module) -> tuple[Tensor, Tensor]:
    """The weights and biases of a convolution and its batch norm."""
    if isinstance(block, nn.Conv2d):
        return block.weight.detach(), block.bias.detach()
    layer, norm = block[0], block[1]
    scale = norm.weight / torch.sqrt(norm.running_var + norm.eps)
    return (layer.weight * scale[:, None, None, None]).detach(), (norm.bias - norm.running_mean * scale).detach()


def images(files: list[Path]) -> list[Tensor]:
    """The sweeps that are looked at, seen from above."""
    found = []
    for scenes in map(Scenes, files):
        for number in np.unique(np.linspace(0, len(scenes) - 1, -(-N_SWEEPS // len(files))).astype(int)):
            found.append(torch.from_numpy(raster(scenes.sweep(number)[0], -REACH_M, -REACH_M, SIDE))[None])
    return found


@torch.no_grad()
def ranges(net: BirdsEye, images: list[Tensor]) -> dict[str, float]:
    """The largest output of each step, but for few."""
    largest: dict[str, float] = {}

    def note(step: str, values: Tensor) -> None:
        n_clipped = max(1, int(values.numel() * CLIPPED))
        largest[step] = max(largest.get(step, 0.0), values.flatten().topk(n_clipped).values[-1].item())

    hooks = [
        net.get_submodule(part).register_forward_hook(lambda _, __, out, step=step: note(step, out)) for step, part in PARTS.items()
    ]
    for step, part in SUMS.items():
        hooks.append(net.get_submodule(part).register_forward_pre_hook(lambda _, inputs, step=step: note(step, inputs[0])))
    for image in images:
        net(image)
    for hook in hooks:
        hook.remove()
    del largest["head"]
    return largest


@torch.no_grad()
def choose(net: BirdsEye, images: list[Tensor], largest: dict[str, float]) -> None:
    """Replaces the ranges of the first steps in `largest` by those of the least error of scores."""
    logits = lambda image: net(image)[0, :N_CLASSES]
    exact = [logits(image) for image in images]
    tried: dict[str, float] = {}

    def rounded(step: str, values: Tensor) -> Tensor | None:
        if step not in tried:
            return None
        return (values * (127 / tried[step])).round().clamp(max=127) * (tried[step] / 127)

    def error(step: str, range_: float) -> float:
        tried[step] = range_
        pairs = [(logits(image), right) for image, right in zip(images, exact, strict=True)]
        off = [torch.cat([(a - b)[of][b[of] > LEAST_LOGIT] for a, b in pairs]) for of in range(N_CLASSES)]
        return sum(one.square().mean().sqrt().item() for one in off)

    hooks = [
        net.get_submodule(PARTS[step]).register_forward_hook(lambda _, __, out, step=step: rounded(step, out)) for step in CHOSEN
    ]
    for step in ROUNDS * CHOSEN:
        errors = {range_: error(step, range_) for range_ in (share * largest[step] for share in SHARES)}
        tried[step] = min(errors, key=errors.__getitem__)
        print(f"{step}: {tried[step]:.3f} of {largest[step]:.3f}, an error of {errors[tried[step]]:.3f}", flush=True)
    for hook in hooks:
        hook.remove()
    largest.update(tried)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--set", required=True, help="what it was trained on, for the model's card")
    parser.add_argument("--asked", default="street-128", help="the model that is asked about what it sees")
    parser.add_argument("--confidence", type=Path, required=True, help="the file of confidence.py")
    asked = parser.parse_args()
    net = BirdsEye()
    saved = torch.load(asked.checkpoint, map_location="cpu")
    net.load_state_dict(saved["mean"])
    net.eval()
    sweeps = images(asked.scenes)
    largest = ranges(net, sweeps)
    choose(net, sweeps, largest)
    tensors = {}
    for step, part in PARTS.items():
        weight, bias = folded(net.get_submodule(part))
        tensors |= {f"{step}.weight": weight.half().contiguous(), f"{step}.bias": bias.half().contiguous()}
    card = {
        "classes": json.dumps(NAMES), "normalization": "none", "training_set": asked.set,
        "activation_ranges": json.dumps({step: round(value, 4) for step, value in largest.items()}),
        "asked": asked.asked, "confidence": json.dumps(json.loads(asked.confidence.read_text())),
        "provenance": f"python/training/birdseye, {saved['step']} steps",
    }
    save_file(tensors, asked.out, card)


if __name__ == "__main__":
    main()
