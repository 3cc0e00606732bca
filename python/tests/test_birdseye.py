"""`detect` sees what the bird's-eye network of python/training sees: the same image, outputs and boxes."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

import edgepuck as ep

torch = pytest.importorskip("torch")
pytest.importorskip("scipy")
safe_open = pytest.importorskip("safetensors").safe_open
sys.path.append(str(ROOT / "python/training/birdseye"))
import export  # noqa: E402
import grid  # noqa: E402
import network  # noqa: E402
import peaks  # noqa: E402


def random_network() -> "torch.nn.Module":
    """A network of random weights, whose batch norms do not leave numbers as they are."""
    torch.manual_seed(1)
    net = network.BirdsEye()
    for part in net.modules():
        if isinstance(part, torch.nn.BatchNorm2d):
            part.running_mean.normal_(0, 0.1)
            part.running_var.uniform_(0.5, 2)
            part.weight.data.uniform_(0.5, 1.5)
            part.bias.data.normal_(0, 0.2)
    net.head.bias.data[: 4 * network.N_CLASSES] = -2.3
    return net.eval()


def test_detect_sees_what_the_network_sees(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    net, scan = random_network(), ep.Scenes("street", seed=3)[0].scan
    torch.save({"mean": net.state_dict(), "step": 0}, tmp_path / "random.pt")
    labels = ep.segment(scan)
    points = scan.positions.astype(np.float32)
    packed, _ = grid.points_of(points, labels)
    np.savez(tmp_path / "scenes.npz", points=packed, ends=[0, len(packed)], boxes=np.zeros((0, 8)), box_ends=[0, 0])
    even = {name: [[0.0, 1.0, 0.0]] for name in grid.NAMES}
    (tmp_path / "confidence.json").write_text(json.dumps(even))
    files = [tmp_path / name for name in ("random.pt", "random.safetensors", "scenes.npz")]
    words = ["export", *files, "--set", "none", "--confidence", tmp_path / "confidence.json"]
    monkeypatch.setattr(sys, "argv", list(map(str, words)))
    # Ranges of a thousandth would clip nearly all outputs.
    monkeypatch.setattr(export, "SHARES", (0.001, 0.5))
    largest = export.ranges(net, export.images([tmp_path / "scenes.npz"]))
    export.main()
    with safe_open(tmp_path / "random.safetensors", "numpy") as file:
        chosen = json.loads(file.metadata()["activation_ranges"])
    halved = [step for step in largest if abs(chosen[step] / largest[step] - 0.5) < 1e-3]
    assert halved == list(export.CHOSEN)

    over = grid.heights(points, labels == -1)
    seen = np.column_stack([points[:, :2], over, labels == -1]).astype(np.float32)
    seen = seen[(labels != -3) & (over > grid.LOWEST_M) & (over < grid.HIGHEST_M)]
    boxes = peaks.objects(*peaks.scores(net, seen), 0.05)
    expected = np.array([[x, y, length, width, height, score] for score, _, x, y, length, width, height, _ in boxes])
    found = ep.detect(scan, tmp_path / "random.safetensors", min_confidence=0.0, min_points=5)
    assert len(found) > 20
    told = np.array([[*one.whole_centre[:2], *one.whole_size, one.confidence] for one in found])
    off = np.abs(told[:, None] - expected[None]).max(2).min(1)
    # Of two peaks as far apart as two objects must be, rounding decides whether both are kept.
    assert np.mean(off < 0.001) > 0.8, np.sort(off)
