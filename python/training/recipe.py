"""The recipes of trainings, TOML files with the keys of `edgepuck train`, and the rate of each step."""

import dataclasses
import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor

# The factor at each step of a schedule, and the part of the rate at which a cosine ends: those of `edgepuck train`.
FACTOR, LAST = 0.7, 0.01


@dataclass(frozen=True)
class Augment:
    """How clouds vary, as in train/src/augment.rs."""

    drop: float
    scale: tuple[float, float]
    shift: float
    stretch: float = 0.0
    jitter: float = 0.0
    cut_mix: float = 0.0  # The share of clouds of which another cloud replaces a part.


@dataclass(frozen=True)
class Schedule:
    """Falls after a fixed number of epochs (`step`), or warms up and falls along a half cosine (`cosine`)."""

    kind: str
    every: int = 0
    warm_up: float = 0.0


@dataclass(frozen=True)
class Recipe:
    """The settings of a training. Keys without a default must be stated."""

    epochs: int
    batch: int
    rate: float
    dropout: float
    label_smoothing: float
    schedule: Schedule
    augment: Augment
    seed: int = 0
    validation: float = 0.0
    average: float = 0.0  # The share of the running means of the weights that a step keeps.


@dataclass(frozen=True)
class Plan:
    """What a plan in assets/reproduce states of trainings."""

    mesh_steps: int
    mesh_points: int
    recipe: Recipe


def read_recipe(path: Path) -> Recipe:
    """The recipe in the TOML file `path`. The script ends if it states what cannot be done."""
    return _parsed(Recipe, _table(path), f"{path}: ")


def read_plan(path: Path) -> Plan:
    """What the plan in the TOML file `path` states of trainings."""
    table = _table(path)
    return _parsed(Plan, {key: table[key] for key in _keys(Plan) if key in table}, f"{path}: ")


def _table(path: Path) -> dict:
    try:
        return tomllib.loads(path.read_text())
    except (OSError, tomllib.TOMLDecodeError) as error:
        raise SystemExit(f"{path}: {error}") from None


def _keys(kind: type) -> dict[str, dataclasses.Field]:
    return {field.name: field for field in dataclasses.fields(kind)}


def _parsed(kind: type, table: dict, place: str) -> object:
    keys = _keys(kind)
    for key in table:
        if key not in keys:
            raise SystemExit(f"{place}expected the keys {', '.join(keys)}, found `{key}`")
    for key, field in keys.items():
        if key not in table and field.default is dataclasses.MISSING:
            raise SystemExit(f"{place}expected the key `{key}`, found none")
    values = {}
    for key, value in table.items():
        is_table = dataclasses.is_dataclass(keys[key].type)
        values[key] = _parsed(keys[key].type, value, f"{place}{key}: ") if is_table else value
    return kind(**values)


def rates(recipe: Recipe, n_steps: int) -> Tensor:
    """The rate of each step of a training whose epochs have `n_steps`."""
    schedule, n_epochs = recipe.schedule, recipe.epochs
    if schedule.kind == "step":
        # The baseline steps its scheduler before the first epoch.
        falls = [recipe.rate * FACTOR ** ((epoch + 1) // schedule.every) for epoch in range(n_epochs)]
        return torch.tensor(falls).repeat_interleave(n_steps)
    if schedule.kind != "cosine":
        raise SystemExit(f"schedule.kind: expected step or cosine, found {schedule.kind}")
    step, warm, total = torch.arange(n_epochs * n_steps).float(), schedule.warm_up * n_steps, n_epochs * n_steps
    rising = torch.clamp((step + 1) / warm, max=1)
    done = torch.clamp((step - warm) / max(total - warm, 1), 0, 1)
    return recipe.rate * rising * (LAST + (1 - LAST) * (1 + torch.cos(math.pi * done)) / 2)
