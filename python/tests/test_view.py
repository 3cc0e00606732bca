"""Pages in three dimensions: a browser's tests are in assets/view/test."""

import re
from pathlib import Path

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
    # The page is in an attribute: nothing in it may end that.
    assert shown.startswith('<iframe srcdoc="&lt;!doctype html&gt;')
    assert shown.count('"') == 4


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(ep.Error, match=r"expected an array of shape \[n, 3\], found \[4\]"):
        ep.view(np.zeros(4))
    with pytest.raises(ep.Error, match="nowhere.npz"):
        ep.view("nowhere.npz")
    with pytest.raises(ep.Error, match="expected something to show, found nothing"):
        ep.view()
    with pytest.raises(ep.Error, match="expected points, a Scan, .* found Scene"):
        ep.view(ep.Scene())
    with pytest.raises(ep.Error, match="^argument-0/points.npy: expected something to show, found no point"):
        ep.view(np.zeros((0, 3)))
