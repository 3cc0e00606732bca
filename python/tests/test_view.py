"""Pages in three dimensions: a browser's tests are in assets/view/test."""

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import edgepuck as ep


def test_scans_arrays_meshes_and_detections_become_a_page(tmp_path: Path) -> None:
    scene = ep.Scenes("street", seed=3)[0]
    found = ep.detect(scene.scan)
    page = ep.view(scene, found, np.zeros((5, 4)), truth=found)
    assert page.page.count('"truth":true') == 2 * len(found)
    for _ in range(2):
        page.save(tmp_path / "new" / "page.html")
    assert (tmp_path / "new" / "page.html").read_text(encoding="utf-8") == page.page
    with pytest.raises(ep.Error, match=r"path: expected a name with \.html, found page\.png"):
        page.save("page.png")
    with pytest.raises(ep.Error, match="page.html/page.html: "):
        page.save(tmp_path / "new" / "page.html" / "page.html")
    mesh = ep.view(ep.Mesh(*ep.box((1.0, 2.0, 3.0)), normalize="none"))
    assert re.search(r'"meshes":\[\{"name":"mesh"', mesh.page)


def test_notebooks_show_scans() -> None:
    scan = ep.Sensor("vlp16").scan(ep.Mesh(*ep.box((1.0, 1.0, 1.0))), distance=3)
    shown = scan._repr_html_()
    assert shown is not None
    # The page is in an attribute: nothing in it may end that.
    assert shown.startswith('<iframe srcdoc="&lt;!doctype html&gt;')
    assert shown.count('"') == 4
    # Notebooks keep it.
    assert len(shown) < 400_000


def test_cells_print_no_path(capfd: pytest.CaptureFixture[str]) -> None:
    scan = ep.Sensor("vlp16").scan(ep.Mesh(*ep.box((1.0, 1.0, 1.0))), distance=3)
    scan._repr_html_()
    assert capfd.readouterr() == ("", "")
    far = np.full((1, 3), np.nan)
    ep.view(np.concatenate([scan.positions, far]))
    # What is wrong with the points is still told.
    assert re.search(
        r"points.npy: 1 of \d+ points without finite coordinates are left out",
        capfd.readouterr().err,
    )


def test_boxes_of_a_file_belong_to_a_scan_in_memory(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    scan = ep.Sensor("vlp16").scan(ep.Mesh(*ep.box((1.0, 1.0, 1.0))), distance=3)
    box = {"centre_m": [0.0, 0.0, 0.0], "size_m": [1.0, 1.0, 1.0], "yaw_deg": 0.0}
    boxes = tmp_path / "objects.json"
    boxes.write_text(json.dumps({"sweep": "000007.npz", "objects": [{"class": "car", "box": box}]}))
    assert ep.view(scan, boxes).page.count('"class":"car"') == 1
    assert capfd.readouterr().err == ""
    # Of the file of another sweep, they are warned of.
    scan.save(tmp_path / "000001.npz")
    ep.view(tmp_path / "000001.npz", boxes)
    assert "expected boxes of 000001.npz, found boxes of 000007.npz" in capfd.readouterr().err


def data(page: str) -> list[dict[str, Any]]:
    """The panes of a page."""
    found: list[dict[str, Any]] = json.loads(page.split('id="data">')[1].split("</script>")[0])["panes"]
    return found


def places_of(mesh: dict[str, Any]) -> np.ndarray:
    """The vertices of a mesh of a page."""
    return np.frombuffer(base64.b64decode(mesh["position"]["f32"]), np.float32).reshape(-1, 3)


def test_scenes_and_batches_become_a_page() -> None:
    scene, cube = ep.Scene(), ep.Mesh(*ep.box((1.0, 1.0, 1.0)), normalize="none")
    scene.add(cube, position=(3, 0, 0), name="near", label="box")
    far = scene.add(cube, scale=2.0)
    # Seven numbers of a pose, which turn by 30 degrees about x: y comes to y cos 30 - z sin 30.
    half = np.radians(15)
    scene.move(far, [1.0, 2.0, 3.0, np.sin(half), 0.0, 0.0, np.cos(half)])
    ahead = places_of(data(ep.view(scene).page)[0]["frames"][0]["meshes"][1])
    x, y, z = ep.box((2.0, 2.0, 2.0))[0].T
    cos, sin = np.cos(2 * half), np.sin(2 * half)
    expected = np.column_stack([1 + x, 2 + cos * y - sin * z, 3 + sin * y + cos * z])
    np.testing.assert_allclose(ahead, expected, atol=1e-5)
    turned = [
        [0.0, -1.0, 0.0, 6.0],
        [1.0, 0.0, 0.0, 1.0],
        [0.0, 0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0, 1.0],
    ]
    scene.move(far, turned)
    [pane] = data(ep.view(scene).page)
    near, second = pane["frames"][0]["meshes"]
    assert (near["name"], near["class"]) == ("near", "box")
    corners = places_of(second)
    assert corners.min(axis=0).tolist() == [5, 0, -1]
    assert corners.max(axis=0).tolist() == [7, 2, 1]
    # Points on the objects that they are of are one picture.
    scan = scene.scan(ep.Sensor("vlp16"), pose=np.eye(4))
    [pane] = data(ep.view(scene, scan).page)
    assert len(pane["frames"][0]["meshes"]) == 2
    assert pane["frames"][0]["points"]
    batch = scene.cast(ep.Sensor("vlp16"), np.tile(np.eye(4), (3, 1, 1)))
    [pane] = data(ep.view(batch).page)
    assert len(pane["frames"]) == 3
    with pytest.raises(ep.Error, match="found a scene without instances"):
        ep.view(ep.Scene())


def test_clouds_and_meshes_of_other_libraries_become_a_page() -> None:
    vertices, faces = ep.box((1.0, 2.0, 3.0))
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.Trimesh(vertices, faces)
    assert len(data(ep.view(mesh).page)[0]["frames"][0]["meshes"]) == 1
    assert len(data(ep.view(trimesh.Scene([mesh])).page)[0]["frames"][0]["meshes"]) == 1
    assert data(ep.view(trimesh.PointCloud(vertices)).page)[0]["frames"][0]["points"]


def test_clouds_and_meshes_of_open3d_become_a_page() -> None:
    vertices, faces = ep.box((1.0, 2.0, 3.0))
    o3d = pytest.importorskip("open3d")
    mesh = o3d.geometry.TriangleMesh(o3d.utility.Vector3dVector(vertices), o3d.utility.Vector3iVector(faces))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(vertices))
    for one in (mesh, o3d.t.geometry.TriangleMesh.from_legacy(mesh)):
        assert len(data(ep.view(one).page)[0]["frames"][0]["meshes"]) == 1
    for points in (cloud, o3d.t.geometry.PointCloud.from_legacy(cloud)):
        assert data(ep.view(points).page)[0]["frames"][0]["points"]


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ep.Error, match=r"expected an array of shape \[n, 3\], found \[4\]"):
        ep.view(np.zeros(4))
    with pytest.raises(ep.Error, match="nowhere.npz"):
        ep.view("nowhere.npz")
    with pytest.raises(ep.Error, match="expected something to show, found nothing"):
        ep.view()
    with pytest.raises(ep.Error, match="expected points, a Scan, .* found object"):
        ep.view(object())
    with pytest.raises(
        ep.Error,
        match="^argument-0/points.npy: expected something to show, found no point",
    ):
        ep.view(np.zeros((0, 3)))
