"""Memory does not grow with the number of scans."""

import os
from pathlib import Path

import pytest

import edgepuck as ep

# Of glibc's arenas and of Python's; a leak of one array of a scan would be some 100 MiB.
SLACK_MIB = 12


def resident_mib() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="this system has no /proc")
def test_memory_stays_flat_over_ten_thousand_scans(cube: tuple, shapes: Path) -> None:
    lidar, mesh = ep.Sensor("vlp32c"), ep.Mesh(*cube)
    # A cache that holds few of the meshes, so that they come and go.
    dataset = ep.Dataset(shapes, "vlp32c", points=64, cache_mb=1)
    classify = ep.Classifier("edge-64", precision="i8")
    after = {}
    for number in range(10_000):
        scan = lidar.scan(mesh, distance=8, noise=0.01, seed=number)
        if number % 20 == 0:
            dataset[number % len(dataset)]
            classify(scan)
        if number in (2_000, 9_999):
            after[number] = resident_mib()
    assert after[9_999] - after[2_000] < SLACK_MIB, after
