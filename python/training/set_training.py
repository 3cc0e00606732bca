"""Trains `edgepuck.torch.SetNetwork`, on a GPU with kernels of its own.

Dropped points move onto another point, and no clouds choose the best epoch: all are trained on, and the last epoch
counts. Runs of one seed on a GPU differ in rounding, since it adds gradients in any order.
"""

from dataclasses import replace
from pathlib import Path

import clouds as packed
import numpy as np
import torch
import torch.nn.functional as F
from clouds import varied
from edgepuck.torch import SetNetwork, export
from recipe import Augment, Recipe, read_recipe
from steps import DEVICE, Steps
from torch import Tensor

# Points of a cloud that the kernels have room for.
MOST_POINTS = 1024


def by_distance(points: Tensor, centre: Tensor) -> Tensor:
    order = (points - centre).square().sum(2).argsort(1)
    return points.gather(1, order[:, :, None].expand(-1, -1, 3))


def augmented(clouds: Tensor, others: Tensor, augment: Augment) -> tuple[Tensor, Tensor]:
    """The clouds as train/src/augment.rs would vary them, and the share of each that `others` replaced."""
    (batch, n, _), device = clouds.shape, clouds.device
    every = torch.arange(batch, device=device)
    centre = clouds[every, torch.randint(0, n, (batch,), device=device)][:, None]
    is_mixed = torch.rand(batch, device=device) < augment.cut_mix
    replaced = (torch.rand(batch, device=device) * n).floor() * is_mixed
    is_replaced = torch.arange(n, device=device) < replaced[:, None]
    clouds = torch.where(is_replaced[:, :, None], by_distance(others, centre), by_distance(clouds, centre))
    # A copy of a point changes no maximum; it moves the mean that chooses the first centre a little.
    stays = torch.rand(batch, n, device=device) > torch.rand(batch, 1, device=device) * augment.drop
    clouds = torch.where(stays[:, :, None], clouds, clouds[:, -1:])
    return varied(clouds, augment), replaced / n


def mixed_labels(own: Tensor, other: Tensor, share: Tensor, n_classes: int) -> Tensor:
    """The probabilities of the classes of clouds of which this `share` of points is of `other` ones."""
    classes = [F.one_hot(labels, n_classes).float() for labels in (own, other)]
    return torch.lerp(*classes, share[:, None])


class SetTraining:
    """A network in training, and the running means of its weights."""

    def __init__(self, networks: list[SetNetwork], clouds: Tensor, labels: Tensor, recipe: Recipe) -> None:
        (self.network, self.mean), self.recipe = networks, recipe
        self.network.train()
        self.mean.eval().load_state_dict(self.network.state_dict())
        self.clouds, self.labels = clouds, labels
        states = [network.state_dict().values() for network in (self.mean, self.network)]
        pairs = zip(*states, strict=True)
        self.averages, self.values = zip(*[pair for pair in pairs if pair[0].is_floating_point()], strict=True)
        self.n_done, self.last = (torch.zeros((), device=DEVICE) for _ in range(2))
        n_steps = len(clouds) // recipe.batch
        self.steps = Steps(self.network.parameters(), recipe, n_steps, (recipe.batch,), self.loss, self.average)
        self.steps.capture([*states[0], *states[1], self.n_done])

    def loss(self, own: Tensor) -> Tensor:
        recipe = self.recipe
        with torch.no_grad():
            other = torch.randint(0, len(self.clouds), (recipe.batch,), device=DEVICE)
            clouds, share = augmented(self.clouds[own], self.clouds[other], recipe.augment)
            n_classes = self.network.get_submodule(f"fc{self.network.n_dense}").out_features
            targets = mixed_labels(self.labels[own], self.labels[other], share, n_classes)
            targets = targets * (1 - recipe.label_smoothing) + recipe.label_smoothing / n_classes
        return -(targets * F.log_softmax(self.network(clouds), 1)).sum(1).mean()

    def average(self, loss: Tensor) -> None:
        self.n_done += 1
        share = torch.clamp(10 / (self.n_done + 9), min=1 - self.recipe.average)
        change = torch._foreach_sub(self.values, self.averages)
        torch._foreach_mul_(change, share)
        torch._foreach_add_(self.averages, change)
        self.last.copy_(loss)

    def run(self) -> None:
        batch, n_steps = self.recipe.batch, self.steps.n_steps
        for epoch in range(self.recipe.epochs):
            order = torch.randperm(len(self.clouds), device=DEVICE)[: n_steps * batch]
            self.steps.epoch(epoch, order.view(n_steps, batch))
            if epoch == 0 or (epoch + 1) % 10 == 0:
                print(f"epoch {epoch + 1}: loss {self.last.item():.3f}", flush=True)


@torch.no_grad()
def accuracy(network: SetNetwork, clouds: Tensor, labels: Tensor) -> float:
    found = torch.cat([network(some).argmax(1) for some in clouds.split(256)])
    return (found == labels).float().mean().item()


def train(data: Path, out: Path, path: Path, epochs: int | None, seed: int | None, held_tenth: int | None) -> None:
    """Trains a network by the recipe at `path`, `epochs` and `seed` in place of its own, and writes its model file."""
    recipe = read_recipe(path)
    given = {"epochs": epochs, "seed": seed}
    recipe = replace(recipe, **{key: value for key, value in given.items() if value is not None})
    read = packed.read(data)
    if recipe.validation > 0:
        raise SystemExit(f"{path}: validation: expected 0, because the last epoch counts, found {recipe.validation}")
    n, n_points, _ = read.points.shape
    if n_points > MOST_POINTS:
        raise SystemExit(f"{data}: expected clouds of at most {MOST_POINTS} points, found {n_points}")
    held = np.zeros(n, bool)
    if held_tenth is not None:
        held[np.random.default_rng(7).permutation(n)[held_tenth::10]] = True
    if (~held).sum() < recipe.batch:
        raise SystemExit(f"{data}: expected {recipe.batch} clouds to train on or more, found {(~held).sum()}")
    torch.manual_seed(recipe.seed)
    clouds, labels = torch.from_numpy(read.points).to(DEVICE), torch.from_numpy(read.labels).to(DEVICE)
    networks = [SetNetwork(len(read.classes), dropout=recipe.dropout).to(DEVICE) for _ in range(2)]
    if DEVICE.type == "cuda":
        from kernels import Kernels

        kernels = Kernels()
        kernels.check(clouds[:4])
        for network in networks:
            network.farthest, network.winners = kernels.farthest, kernels.winners
    held = torch.from_numpy(held).to(DEVICE)
    training = SetTraining(networks, clouds[~held], labels[~held], recipe)
    training.run()
    if held_tenth is not None:
        print(f"{100 * accuracy(training.mean, clouds[held], labels[held]):.2f} % of the clouds that were kept back")
    export(training.mean, out, classes=read.classes, training_set=data.name, calibrate=data, half=True)
