"""The scripts that measure against real data, on simulated data whose truth is known."""

import json
import re
import runpy
import subprocess
from pathlib import Path

import numpy as np

import edgepuck as ep

PEERS = Path(__file__).resolve().parents[1] / "xtask/lab/peers"


def rows(monkeypatch, capsys, script, *words):
    """The rows of the table that a script prints, by their first cells."""
    monkeypatch.setattr("sys.argv", [script, *map(str, words)])
    runpy.run_path(str(PEERS / script), run_name="__main__")
    lines = [line.strip("| ").split(" | ") for line in capsys.readouterr().out.splitlines() if line.startswith("|")]
    return {tuple(cells[:2]) if script == "by_class.py" else cells[0]: cells for cells in lines}


def test_the_noise_and_the_dropout_of_a_capture_are_found(tmp_path, monkeypatch, capsys):
    room, pose = ep.Mesh(*ep.box((16, 12, 5))), np.eye(4)
    pose[:3, 3] = [1, 2, 0]
    scan = ep.Sensor("hdl32e").scan(room, pose=pose, noise=0.012, dropout=0.05, seed=1, attributes=["ring"])
    points = scan.positions - pose[:3, 3].astype("f4")
    columns = np.column_stack([points, np.zeros(len(points)), scan.ring])
    file = tmp_path / "room.f32x5.bin"
    columns.astype("f4").tofile(file)
    found = rows(monkeypatch, capsys, "sensors.py", "hdl32e", file, "--noise", 0.004)["all"]
    missing, simulated, step, off, along, ours = (float(found[cell]) for cell in (3, 5, 6, 8, 10, 13))
    # Thousands of returns: the deviations of these figures are some percent of them.
    assert abs(missing - 5) < 1.5 and abs(simulated) < 0.5, found
    assert abs(step - 360 * 10 * 46.08e-6) < 1e-3 and abs(off) < 2, found
    assert abs(along - 12) < 1 and abs(ours - 4) < 0.4, found


def test_frames_are_judged_by_class(tmp_path, monkeypatch, capsys):
    subprocess.run(["edgepuck", "gen-scenes", "street", "--sweeps", "3", "--save", "0", "--seed", "3", "--sensor", "hdl64e",
                    "--layout", "openpcdet", "--out", tmp_path / "street"], check=True, capture_output=True)
    numbers, files = {"car": 1, "person": 2, "two-wheeler": 3, "truck": 4, "bus": 5}, []
    for points in sorted(tmp_path.glob("street/openpcdet/points/*.npy")):
        labels = [line.split() for line in (points.parents[1] / f"labels/{points.stem}.txt").read_text().splitlines()]
        labels = [words for words in labels if words[7] in numbers]
        files.append(tmp_path / f"{points.stem}.npz")
        np.savez(files[-1], xyz_mm=(1000 * np.load(points)[:, :3]).round().astype("i4"),
                 boxes=np.array([words[:7] for words in labels], "f4"), cls=np.array([numbers[words[7]] for words in labels]),
                 classes=[words[7] for words in labels],
                 meta=json.dumps({"view_half_deg": 180, "sensor": "HDL-64E", "source": "simulated"}))
    cells = rows(monkeypatch, capsys, "by_class.py", *files)["all (3)", "car"]
    found, asked = map(int, cells[2].split(" of "))
    assert asked >= 5 and found > asked / 2 and int(cells[4]) > asked / 2, cells

    # And what is missed or false, as pictures.
    monkeypatch.syspath_prepend(PEERS)
    page = tmp_path / "misses.html"
    rows(monkeypatch, capsys, "misses.py", *files, "--out", page, "--min-confidence", 0.3)
    told = page.read_text()
    false = sum(int(n) for n in re.findall(r"<h2>false [a-z-]+: (\d+)", told))
    missed = int(re.search(r"<h2>missed car: (\d+)|$", told)[1] or 0)
    cells = rows(monkeypatch, capsys, "by_class.py", *files, "--min-confidence", 0.3)
    assert missed == asked - int(cells["all (3)", "car"][2].split(" of ")[0])
    assert false == sum(int(row[5]) for key, row in cells.items() if key[0] == "all (3)")
    assert told.count("<img src=") == sum(int(n) for n in re.findall(r"<h2>[^<]*: (\d+)", told)) > 0
