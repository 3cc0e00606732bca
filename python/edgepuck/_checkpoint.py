"""The weights in a PyTorch checkpoint, under the names that model files have. No code of the checkpoint is executed."""

from __future__ import annotations

import io
import os
import pickle
import re
import struct
import zipfile
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, BinaryIO

import torch
from torch import Tensor

from ._edgepuck import Error

# The keys of the model's tensors in checkpoints that also hold the optimiser's state.
_STATES = ("model_state_dict.", "state_dict.")
# The prefix that `torch.nn.DataParallel` adds to all names, and the part that `torch.compile` adds to those of what it
# compiles.
_PARALLEL, _COMPILED = "module.", "_orig_mod"
# PyTorch's names of the tensors of a layer that a model needs, and that of a count of training steps.
_PARTS = ("weight", "bias", "running_mean", "running_var")
_COUNTER = "num_batches_tracked"
# The most elements of a model, far above that of any PointNet: a view that repeats one element fills no file.
_MOST_ELEMENTS = 1 << 27
# The first number of a checkpoint from before PyTorch 1.6.
_MAGIC = 0x1950A86A20F9469CFC6C
# The most unknown names in an error.
_LISTED = 5

_MODELNET40 = (
    "airplane bathtub bed bench bookshelf bottle bowl car chair cone cup curtain desk door dresser flower_pot "
    "glass_box guitar keyboard lamp laptop mantel monitor night_stand person piano plant radio range_hood sink "
    "sofa stairs stool table tent toilet tv_stand vase wardrobe xbox"
).split()


@dataclass(frozen=True)
class Names:
    """The names of layers in a repository, and what its checkpoints do not state."""

    repository: str
    layers: Mapping[str, str]
    """Their layer to ours. `{i}` is any number, the same on both sides."""
    card: Mapping[str, str]
    """What the model file says unless arguments say otherwise."""
    classes: tuple[str, ...] = ()
    """The classes of a model with this number of logits."""

    def __post_init__(self) -> None:
        for theirs, ours in self.layers.items():
            n_numbers = theirs.count("{i}")
            if n_numbers > 1 or n_numbers != ours.count("{i}"):
                raise Error(f"layers: {theirs!r}: {ours!r}: expected {{i}} once on both sides or on none")

    def ours(self, layer: str) -> str | None:
        """Our name of their layer."""
        for theirs, ours in self.layers.items():
            number = re.fullmatch(re.escape(theirs).replace(r"\{i\}", "([0-9]+)"), layer)
            if number:
                return ours.replace("{i}", number[1]) if number.lastindex else ours
        return None

    def of_tensors(self, keys: Iterable[str]) -> tuple[dict[str, str], list[str]]:
        """Their names of the tensors by our names, and the names that are unknown."""
        names: dict[str, str] = {}
        unknown = []
        for key in sorted(keys):
            layer, _, part = key.rpartition(".")
            ours = self.ours(layer)
            if ours is None or part not in (*_PARTS, _COUNTER):
                unknown.append(key)
            elif part != _COUNTER:
                name = f"{ours}.{part}"
                if name in names:
                    raise Error(f"layers: expected different names, found `{name}` for {names[name]} and {key}")
                names[name] = key
        return names, unknown


def _identical(layers: str) -> dict[str, str]:
    return {layer: layer for layer in layers.split()}


REPOSITORIES = (
    # https://github.com/yanx27/Pointnet_Pointnet2_pytorch (models/pointnet_cls.py), after whose layers ours are named, and
    # https://github.com/fxia22/pointnet.pytorch (pointnet/model.py): any number of layers, with or without either T-Net.
    # Clouds are normalised by pc_normalize in data_utils/ModelNetDataLoader.py. There is no ReLU before the pooling.
    Names(
        "yanx27",
        _identical(
            "feat.conv{i} feat.bn{i} feat.stn.conv{i} feat.stn.fc{i} feat.stn.bn{i} "
            "feat.fstn.conv{i} feat.fstn.fc{i} feat.fstn.bn{i} fc{i} bn{i}"
        ),
        {"sampler": "all", "normalization": "unit-sphere", "transform_after": "1", "pooled": "linear"},
        tuple(_MODELNET40),
    ),
    # PointNet without T-Nets of https://github.com/eth-sri/3dcertify (pointnet/model.py): torch.nn.Sequential counts batch
    # norms, ReLUs and dropouts as layers. data_processing/datasets.py samples; mlp2.8 is a ReLU before the pooling.
    Names(
        "3dcertify",
        {
            **{"mlp1.0": "feat.conv1", "mlp1.1": "feat.bn1", "mlp1.3": "feat.conv2", "mlp1.4": "feat.bn2"},
            **{"mlp2.0": "feat.conv3", "mlp2.1": "feat.bn3", "mlp2.3": "feat.conv4", "mlp2.4": "feat.bn4"},
            **{"mlp2.6": "feat.conv5", "mlp2.7": "feat.bn5", "mlp3.0": "fc1", "mlp3.1": "bn1"},
            **{"mlp3.3": "fc2", "mlp3.5": "bn2", "mlp3.7": "fc3"},
        },
        {
            **{"sampler": "fps", "points": "64", "fps_start": "first", "normalization": "unit-sphere"},
            **{"transform_after": "1", "pooled": "relu", "training_set": "ModelNet40"},
        },
        tuple(_MODELNET40),
    ),
)


@dataclass
class Checkpoint:
    """The tensors of the model in a file, by their names there."""

    path: str
    tensors: dict[str, Tensor]
    accuracy: str | None
    """The accuracy that yanx27's training script stores with the weights."""

    def named(self, layers: Mapping[str, str] | None) -> tuple[Names, dict[str, str]]:
        """The first names that know all tensors, `layers` or those of a repository, and their names by ours."""
        known = REPOSITORIES if layers is None else [Names("layers", layers, {})]
        unknown_to = {}
        for names in known:
            of_tensors, unknown = names.of_tensors(self.tensors)
            if not unknown:
                return names, of_tensors
            unknown_to[names.repository] = unknown
        nearest = min(unknown_to, key=lambda name: len(unknown_to[name]))
        unknown = unknown_to[nearest]
        listed = ", ".join(f"`{key}`" for key in unknown[:_LISTED])
        more = f" and {len(unknown) - _LISTED} more" if len(unknown) > _LISTED else ""
        raise Error(
            f"{self.path}: expected the layers of yanx27, fxia22 or 3dcertify, or those that the argument layers names; "
            f"the nearest, {nearest}, does not know {listed}{more}"
        )

    def values(self, names: Mapping[str, str]) -> dict[str, Tensor]:
        """The tensors by our names, in f32, or in f16 if all are."""
        tensors = {ours: self.tensors[theirs] for ours, theirs in names.items()}
        n_elements = 0
        for ours, tensor in tensors.items():
            here = f"{self.path}: tensor `{names[ours]}`"
            if not tensor.is_floating_point():
                raise Error(f"{here}: expected floating-point numbers, found {tensor.dtype}")
            n_elements += tensor.numel()
            if n_elements > _MOST_ELEMENTS:
                raise Error(f"{here}: expected at most {_MOST_ELEMENTS} elements in the model, found more")
        is_half = all(tensor.dtype == torch.float16 for tensor in tensors.values())
        kind = torch.float16 if is_half else torch.float32
        return {ours: tensor.detach().to(kind).contiguous() for ours, tensor in tensors.items()}


def read(path: str | os.PathLike[str]) -> Checkpoint:
    """Reads a file that torch.save wrote."""
    here = os.fspath(path)
    try:
        with open(here, "rb") as file:
            root = _read_zip(file) if zipfile.is_zipfile(here) else _read_stream(file)
        if not isinstance(root, dict):
            raise Error(f"expected a dictionary of tensors, found {_kind(root)}: save model.state_dict()")
        tensors = _of_model(dict(_flat(root)))
    except OSError as error:
        raise Error(f"{here}: {error.strerror or error}") from None
    except Error as error:
        raise Error(f"{here}: {error}") from None
    except Exception as error:
        # What the bytes of another file mean as a pickle may be any error.
        raise Error(f"{here}: expected a PyTorch checkpoint, found another or a damaged file: {error!r}") from None
    if not tensors:
        raise Error(f"{here}: expected weights, found no tensor")
    return Checkpoint(here, tensors, _accuracy(root))


def _read_zip(file: BinaryIO) -> Any:
    """The object in a zip archive: a pickle, and a file for each storage."""
    with zipfile.ZipFile(file) as archive:
        entries = {name.partition("/")[2]: info for name, info in archive.NameToInfo.items()}

        def content(name: str) -> bytes:
            if entries[name].file_size > entries[name].compress_size:
                raise Error(f"expected an archive without compression, found `{name}` compressed")
            return archive.read(entries[name])

        if "byteorder" in entries and content("byteorder") != b"little":
            raise Error("expected weights of a little-endian machine, found others")

        def storage(kind: torch.dtype, key: str, _: str, n: int) -> Tensor:
            return torch.frombuffer(bytearray(content(f"data/{key}")), dtype=kind)[:n]

        return _Unpickler(io.BytesIO(content("data.pkl")), storage).load()


def _read_stream(file: BinaryIO) -> Any:
    """The object in a file from before PyTorch 1.6: pickles, and then the storages."""

    def storage(kind: torch.dtype, key: str, _: str, n: int, view: Any = None) -> Tensor:
        if view is not None or not 0 <= n * torch.empty(0, dtype=kind).element_size() <= size:
            raise Error(f"expected a storage in a file of {size} bytes, found {n} elements")
        return torch.empty(n, dtype=kind)

    size = os.fstat(file.fileno()).st_size
    magic, version, system = (_Unpickler(file, storage).load() for _ in range(3))
    if (magic, version, system.get("little_endian")) != (_MAGIC, 1001, True):
        raise Error("expected a PyTorch checkpoint of a little-endian machine, found another file")
    unpickler = _Unpickler(file, storage)
    root = unpickler.load()
    for key in _Unpickler(file, storage).load():
        tensor = unpickler.storages[key]
        n = int.from_bytes(file.read(8), "little")
        raw = file.read(tensor.numel() * tensor.element_size())
        if (n, len(raw)) != (tensor.numel(), tensor.numel() * tensor.element_size()):
            raise Error("expected a whole PyTorch checkpoint, found the beginning of one")
        if n:
            tensor.copy_(torch.frombuffer(bytearray(raw), dtype=tensor.dtype))
    return root


def _of_model(tensors: dict[str, Tensor]) -> dict[str, Tensor]:
    """The tensors of the model among all of a file, without the prefixes of their names."""
    state = next((state for state in _STATES if any(name.startswith(state) for name in tensors)), "")
    tensors = {name[len(state) :]: tensor for name, tensor in tensors.items() if name.startswith(state)}
    return unwrapped(tensors)


def unwrapped(tensors: Mapping[str, Tensor]) -> dict[str, Tensor]:
    """The tensors without the parts of names that `torch.nn.DataParallel` and `torch.compile` add."""
    names = {".".join(part for part in name.split(".") if part != _COMPILED): name for name in tensors}
    prefix = _PARALLEL if all(name.startswith(_PARALLEL) for name in names) else ""
    return {name[len(prefix) :]: tensors[theirs] for name, theirs in names.items()}


def _flat(values: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, Tensor]]:
    for key, value in values.items():
        if isinstance(value, Tensor):
            yield f"{prefix}{key}", value
        elif isinstance(value, dict):
            yield from _flat(value, f"{prefix}{key}.")


def _accuracy(root: Mapping[Any, Any]) -> str | None:
    shares = [(word, root.get(key)) for key, word in (("instance_acc", "instance"), ("class_acc", "class"))]
    stated = [f"{word} {100 * share:.2f} %" for word, share in shares if isinstance(share, float)]
    return f"{', '.join(stated)}, as its checkpoint says" if stated else None


class _Unread:
    """An object of a class that is not imported. It takes what a pickle gives it."""

    def __init__(self, *_: Any, **__: Any) -> None: ...
    def __setstate__(self, _: Any) -> None: ...
    def __setitem__(self, *_: Any) -> None: ...
    def append(self, _: Any) -> None: ...


def _kind(value: Any) -> str:
    return f"an object of {type(value).__module__}.{type(value).__name__}"


def _view(storage: Tensor, offset: int, size: Any, stride: Any, *_: Any) -> Tensor:
    return storage.as_strided(tuple(size), tuple(stride), offset)


def _numpy_scalar(_: Any, raw: Any) -> float | None:
    """The number that NumPy pickles as f64."""
    number: float | None = struct.unpack("<d", raw)[0] if isinstance(raw, bytes) and len(raw) == 8 else None
    return number


# All that a pickle may call or name.
_KNOWN: dict[tuple[str, str], Any] = {
    ("collections", "OrderedDict"): OrderedDict,
    # How bytes are pickled.
    ("_codecs", "encode"): lambda text, _: text.encode("latin1"),
    ("torch", "Size"): tuple,
    ("torch._utils", "_rebuild_tensor"): _view,
    ("torch._utils", "_rebuild_tensor_v2"): _view,
    ("torch._utils", "_rebuild_parameter"): lambda data, *_: data,
    ("numpy.core.multiarray", "scalar"): _numpy_scalar,
    ("numpy._core.multiarray", "scalar"): _numpy_scalar,
    ("torch", "FloatStorage"): torch.float32,
    ("torch", "DoubleStorage"): torch.float64,
    ("torch", "HalfStorage"): torch.float16,
    ("torch", "BFloat16Storage"): torch.bfloat16,
    ("torch", "LongStorage"): torch.int64,
    ("torch", "IntStorage"): torch.int32,
    ("torch", "ShortStorage"): torch.int16,
    ("torch", "CharStorage"): torch.int8,
    ("torch", "ByteStorage"): torch.uint8,
    ("torch", "BoolStorage"): torch.bool,
}


class _Unpickler(pickle.Unpickler):
    """Reads a pickle that calls nothing but `_KNOWN`. `storage` gives the elements of a tensor.

    `torch.load(weights_only=True)` refuses the numbers of NumPy in yanx27's checkpoints, and PyTorch 1.13 ignores
    another unpickler.
    """

    def __init__(self, file: BinaryIO, storage: Callable[..., Tensor]) -> None:
        super().__init__(file)
        self.storage, self.storages = storage, dict[str, Tensor]()

    def find_class(self, module: str, name: str) -> Any:
        return _KNOWN.get((module, name)) or type(name, (_Unread,), {"__module__": module})

    def persistent_load(self, reference: Any) -> Tensor:
        _, kind, key, *rest = reference
        if key not in self.storages:
            self.storages[key] = self.storage(kind, key, *rest)
        return self.storages[key]
