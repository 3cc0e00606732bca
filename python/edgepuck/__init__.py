"""LiDAR scans of triangle meshes as NumPy arrays, and a classifier of point clouds.

>>> import edgepuck as ep
>>> lidar = ep.Sensor("vlp32c")
>>> cube = ep.Mesh(*ep.box((1.0, 2.0, 0.5)))
>>> scan = lidar.scan(cube, distance=4, elevation=10, noise=0.01, seed=7)
>>> scan.positions.shape[1], scan.positions.dtype, len(scan.ring) == len(scan)
(3, dtype('float32'), True)

`Dataset` and `Scenes` cast on demand, also in the workers of a `DataLoader`. Lengths are in metres,
angles in degrees and times in seconds. In the frames of the world and of sensors, z points up, and
sensors look along x.
"""

from importlib.metadata import version as _version

from ._edgepuck import Error, adapters, set_num_threads
from ._classifier import Classifier, Prediction
from ._dataset import Dataset
from ._detect import Detection, detect
from ._heightfield import heightfield
from ._mesh import Mesh, box
from ._page import View
from ._scan import Scan
from ._scene import Batch, Scene, scan_scene
from ._scenes import DrawnScene, Scenes
from ._segment import segment
from ._sensor import Sensor
from ._view import view

__version__ = _version("edgepuck")

__all__ = [
    "Batch",
    "Classifier",
    "Dataset",
    "Detection",
    "DrawnScene",
    "Error",
    "Mesh",
    "Prediction",
    "Scan",
    "Scene",
    "Scenes",
    "Sensor",
    "View",
    "adapters",
    "box",
    "detect",
    "heightfield",
    "scan_scene",
    "segment",
    "set_num_threads",
    "view",
]
