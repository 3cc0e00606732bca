"""Writes the two small checkpoints beside it, as torch.save would.

PyTorch is not needed: its names stand in a pickle as mere text, so stand-ins
that bear them are enough. Every weight follows from its name, see `value`.

    python3 make.py
"""

import io
import pathlib
import pickle
import struct
import sys
import types
import zipfile
from collections import OrderedDict

FOLDER = pathlib.Path(__file__).parent


def value(name, element):
    """What tests expect: exact in 16 bits of either kind, variances above 0."""
    step = (sum(name.encode()) + 7 * element) % 61
    return (step + 1) / 64 if name.endswith("running_var") else (step - 30) / 64


def bfloat16(x):
    return struct.pack("<f", x)[2:]


CODECS = {
    "FloatStorage": lambda x: struct.pack("<f", x),
    "DoubleStorage": lambda x: struct.pack("<d", x),
    "HalfStorage": lambda x: struct.pack("<e", x),
    "BFloat16Storage": bfloat16,
    "LongStorage": lambda x: struct.pack("<q", int(x)),
}


def stand_in(module, name):
    """A callable that pickles as the global `module.name`."""
    if module not in sys.modules:
        sys.modules[module] = types.ModuleType(module)
    fake = types.FunctionType((lambda *args: None).__code__, {}, name)
    fake.__module__, fake.__qualname__ = module, name
    setattr(sys.modules[module], name, fake)
    return fake


REBUILD = stand_in("torch._utils", "_rebuild_tensor_v2")
PARAMETER = stand_in("torch._utils", "_rebuild_parameter")
SCALAR = stand_in("numpy.core.multiarray", "scalar")
DTYPE = stand_in("numpy", "dtype")
STORAGES = {kind: stand_in("torch", kind) for kind in CODECS}


class Call:
    """Pickles as a call of `function`."""

    def __init__(self, function, *args, state=None):
        self.parts = (function, args) if state is None else (function, args, state)

    def __reduce__(self):
        return self.parts


class Storage:
    def __init__(self, kind, values):
        self.kind, self.values = kind, values

    def bytes(self):
        return b"".join(CODECS[self.kind](value) for value in self.values)


def strides(shape):
    steps, step = [], 1
    for size in reversed(shape):
        steps.insert(0, step)
        step *= size
    return tuple(steps)


def view(storage, offset, shape, steps=None):
    steps = strides(shape) if steps is None else steps
    return Call(REBUILD, storage, offset, tuple(shape), steps, False, OrderedDict())


def tensor(name, shape, kind="FloatStorage"):
    count = 1
    for size in shape:
        count *= size
    return view(Storage(kind, [value(name, e) for e in range(count)]), 0, shape)


def transposed(name, rows, columns):
    """Stored column by column: `Linear.weight = x.t()`."""
    values = [value(name, r * columns + c) for c in range(columns) for r in range(rows)]
    return view(Storage("FloatStorage", values), 0, (rows, columns), (1, rows))


class Pickler(pickle.Pickler):
    """Keeps storages apart from the objects, as torch.save does."""

    def __init__(self, file, location, legacy):
        super().__init__(file, protocol=2)
        self.location, self.legacy, self.storages = location, legacy, []

    def persistent_id(self, obj):
        if not isinstance(obj, Storage):
            return None
        if obj not in self.storages:
            self.storages.append(obj)
        key = str(self.storages.index(obj))
        extra = (None,) if self.legacy else ()
        return ("storage", STORAGES[obj.kind], key, self.location, len(obj.values), *extra)


def layer(tensors, ours, theirs, shape, norm=False):
    """The tensors of a convolution, linear layer or batch norm."""
    if norm:
        for part in ("weight", "bias", "running_mean", "running_var"):
            tensors[f"{theirs}.{part}"] = tensor(f"{ours}.{part}", shape)
        tensors[f"{theirs}.num_batches_tracked"] = view(Storage("LongStorage", [9]), 0, ())
    else:
        tensors[f"{theirs}.weight"] = tensor(f"{ours}.weight", shape)
        tensors[f"{theirs}.bias"] = tensor(f"{ours}.bias", shape[:1])


def t_net(tensors, prefix, size):
    widths = (size, 4, 5, 6)
    for i in (1, 2, 3):
        layer(tensors, f"{prefix}.conv{i}", f"{prefix}.conv{i}", (widths[i], widths[i - 1], 1))
    fc = (6, 5, 4, size * size)
    for i in (1, 2, 3):
        layer(tensors, f"{prefix}.fc{i}", f"{prefix}.fc{i}", (fc[i], fc[i - 1]))
    for i, width in enumerate((4, 5, 6, 5, 4), 1):
        layer(tensors, f"{prefix}.bn{i}", f"{prefix}.bn{i}", (width,), norm=True)


def yanx27():
    """Widths 3-4-5-8 | 8-6-5-3, both T-Nets, trained on two GPUs."""
    tensors = OrderedDict()
    t_net(tensors, "feat.stn", 3)
    widths = (3, 4, 5, 8)
    for i in (1, 2, 3):
        layer(tensors, f"feat.conv{i}", f"feat.conv{i}", (widths[i], widths[i - 1], 1))
    for i in (1, 2, 3):
        layer(tensors, f"feat.bn{i}", f"feat.bn{i}", (widths[i],), norm=True)
    t_net(tensors, "feat.fstn", 4)
    fc = (8, 6, 5, 3)
    for i in (1, 2, 3):
        layer(tensors, f"fc{i}", f"fc{i}", (fc[i], fc[i - 1]))
    for i in (1, 2):
        layer(tensors, f"bn{i}", f"bn{i}", (fc[i],), norm=True)

    tensors["fc1.weight"] = transposed("fc1.weight", 6, 8)
    tensors["fc2.weight"] = tensor("fc2.weight", (5, 6), "HalfStorage")
    tensors["fc2.bias"] = tensor("fc2.bias", (5,), "BFloat16Storage")
    tensors["fc3.weight"] = tensor("fc3.weight", (3, 5), "DoubleStorage")
    # One storage, two tensors.
    names = ("bn1.running_mean", "bn1.running_var")
    shared = Storage("FloatStorage", [value(name, e) for name in names for e in range(6)])
    for number, name in enumerate(names):
        tensors[name] = view(shared, 6 * number, (6,))
    bias = tensor("fc1.bias", (6,))
    tensors["fc1.bias"] = Call(PARAMETER, bias, True, OrderedDict())

    state = OrderedDict((f"module.{name}", value) for name, value in tensors.items())
    dtype = Call(DTYPE, "f8", False, True, state=(3, "<", None, None, None, -1, -1, 0))
    adam = {"step": 12, "exp_avg": tensor("any", (4, 3, 1))}
    return {
        "epoch": 7,
        "instance_acc": Call(SCALAR, dtype, struct.pack("<d", 0.90625)),
        "class_acc": Call(SCALAR, dtype, struct.pack("<d", 0.875)),
        "model_state_dict": state,
        "optimizer_state_dict": {"state": {0: adam}, "param_groups": [{"lr": 1e-3, "params": [0]}]},
    }


def certify3d():
    """Widths 3-4-4-4-5-6 | 6-5-4-3, no T-Net, batch norms counted as layers."""
    tensors = OrderedDict()
    trunk = (3, 4, 4, 4, 5, 6)
    names = ("mlp1.0", "mlp1.3", "mlp2.0", "mlp2.3", "mlp2.6")
    norms = ("mlp1.1", "mlp1.4", "mlp2.1", "mlp2.4", "mlp2.7")
    for i, (theirs, norm) in enumerate(zip(names, norms), 1):
        layer(tensors, f"feat.conv{i}", theirs, (trunk[i], trunk[i - 1], 1))
        layer(tensors, f"feat.bn{i}", norm, (trunk[i],), norm=True)
    head = (6, 5, 4, 3)
    for i, theirs in enumerate(("mlp3.0", "mlp3.3", "mlp3.7"), 1):
        layer(tensors, f"fc{i}", theirs, (head[i], head[i - 1]))
    for i, theirs in enumerate(("mlp3.1", "mlp3.5"), 1):
        layer(tensors, f"bn{i}", theirs, (head[i],), norm=True)
    versions = OrderedDict((name, {"version": 1}) for name in ("", "mlp1", "mlp1.0"))
    state = Call(OrderedDict)
    state.parts = (OrderedDict, (), {"_metadata": versions}, None, iter(tensors.items()))
    return {"instance_acc": 0.8335, "class_acc": 0.8011, "state_dict": state}


def write_zip(path, checkpoint):
    pickled = io.BytesIO()
    pickler = Pickler(pickled, "cpu", legacy=False)
    pickler.dump(checkpoint)
    entries = [("data.pkl", pickled.getvalue()), ("byteorder", b"little"), ("version", b"3\n")]
    storages = enumerate(pickler.storages)
    entries += [(f"data/{key}", storage.bytes()) for key, storage in storages]
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in entries:
            entry = zipfile.ZipInfo(f"{path.stem}/{name}", (1980, 1, 1, 0, 0, 0))
            archive.writestr(entry, content)


def write_legacy(path, checkpoint):
    sizes = {"short": 2, "int": 4, "long": 4}
    system = {"protocol_version": 1001, "little_endian": True, "type_sizes": sizes}
    with open(path, "wb") as file:
        for header in (0x1950A86A20F9469CFC6C, 1001, system):
            pickle.dump(header, file, protocol=2)
        pickler = Pickler(file, "cuda:0", legacy=True)
        pickler.dump(checkpoint)
        keys = sorted(str(key) for key in range(len(pickler.storages)))
        pickle.dump(keys, file, protocol=2)
        for key in keys:
            storage = pickler.storages[int(key)]
            file.write(struct.pack("<q", len(storage.values)) + storage.bytes())


write_zip(FOLDER / "yanx27.pth", yanx27())
write_legacy(FOLDER / "3dcertify_legacy.pth", certify3d())
