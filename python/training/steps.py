"""Adam's steps, on a GPU captured as a CUDA graph and replayed."""

from collections.abc import Callable, Iterable

import torch
from recipe import Recipe, rates
from torch import Tensor

DEVICE = torch.device("cuda" if torch.cuda.is_available() else "cpu")
# The weight of the squares of all parameters, that of the baseline and of train/src/adam.rs.
L2 = 1e-4


class Steps:
    """The steps of a training. `loss` takes the numbers of a batch's clouds, `after` follows each step of Adam."""

    def __init__(
        self,
        parameters: Iterable[Tensor],
        recipe: Recipe,
        n_steps: int,
        batch: tuple[int, ...],
        loss: Callable[[Tensor], Tensor],
        after: Callable[[Tensor], None],
    ) -> None:
        self.n_steps, self.loss, self.after = n_steps, loss, after
        self.rates = rates(recipe, n_steps).tolist()
        self.rate = torch.tensor(recipe.rate, device=DEVICE)
        self.chosen = torch.zeros(batch, dtype=torch.long, device=DEVICE)
        is_gpu = DEVICE.type == "cuda"
        self.adam = torch.optim.Adam(parameters, lr=self.rate, weight_decay=L2, capturable=is_gpu, fused=is_gpu)
        self.replay = self.step

    def step(self) -> None:
        loss = self.loss(self.chosen)
        self.adam.zero_grad(set_to_none=True)
        loss.backward()
        with torch.no_grad():
            self.adam.step()
            self.after(loss)

    def capture(self, values: Iterable[Tensor]) -> None:
        """Captures a step on a GPU. The steps that warm it up change `values`; they are undone."""
        if DEVICE.type != "cuda":
            return
        values = list(values)
        before = [value.detach().clone() for value in values]
        side = torch.cuda.Stream()
        side.wait_stream(torch.cuda.current_stream())
        with torch.cuda.stream(side):
            for _ in range(3):
                self.step()
        torch.cuda.synchronize()
        self.adam.zero_grad(set_to_none=True)
        graph = torch.cuda.CUDAGraph()
        with torch.cuda.graph(graph):
            self.step()
        with torch.no_grad():
            for value, old in zip(values, before, strict=True):
                value.copy_(old)
        for state in self.adam.state.values():
            for value in state.values():
                value.zero_()
        self.replay = graph.replay

    def epoch(self, number: int, order: Tensor) -> None:
        """One step for each row of `order`, the numbers of a batch's clouds."""
        for rate, batch in zip(self.rates[number * self.n_steps :], order, strict=False):
            self.rate.fill_(rate)
            self.chosen.copy_(batch)
            self.replay()
