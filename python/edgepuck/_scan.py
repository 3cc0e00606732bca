"""Scans."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _edgepuck, _exchange, _poses
from ._page import page_of

# The columns in files whose names are keywords of Python, or too short there.
_NAMES = {"return": "return_number", "sensor": "sensor_position"}


@dataclass(eq=False, repr=False)
class Scan:
    """The points of one scan with their attributes. Attributes that were not requested are None.

    The arrays are the memory into which the scan was cast: nothing is copied. `np.asarray(scan)` is
    `positions`, and `torch.from_dlpack(scan.positions)` shares its memory.
    """

    positions: NDArray[np.float32]
    """The points that the beams hit, metres, relative to `origin`, [n, 3]."""
    origin: NDArray[np.float64]
    """The offset to add to each position, metres, [3]. It is zero unless the sensor is far from the
    origin."""
    range: NDArray[np.float32] | None = None
    """Distance from the start of the beam, metres, [n]."""
    beam: NDArray[np.uint32] | None = None
    """Number of the beam in firing order, [n]."""
    ring: NDArray[np.uint16] | None = None
    """Row of the beam, from below, [n]."""
    time: NDArray[np.float32] | None = None
    """Seconds since the revolution began, [n]."""
    triangle: NDArray[np.uint32] | None = None
    """Index of the triangle in its mesh, [n]."""
    object: NDArray[np.uint32] | None = None
    """Index of the object in its scene, [n]."""
    intensity: NDArray[np.float32] | None = None
    """Cosine of the incidence times the reflectivity, 0 to 1, [n]."""
    power: NDArray[np.float32] | None = None
    """Received power, relative to a white surface that faces the sensor 1 m away, [n]."""
    reflectivity: NDArray[np.uint8] | None = None
    """Calibrated reflectivity: 0 to 100 % diffuse, 101 to 255 retro-reflectors, [n]."""
    return_number: NDArray[np.uint8] | None = None
    """Number of the return among those of its beam, from 1, [n]."""
    medium: NDArray[np.uint8] | None = None
    """The source of the return: 0 a surface, 1 rain, 2 snow, 3 fog, 4 dust or spray, [n]."""
    sensor_position: NDArray[np.float32] | None = None
    """Position of the sensor when it fired the beam, metres, relative to `origin`, [n, 3]: that of
    `pose`, unless the sensor moved and the attribute `sensor` was requested."""
    attitude: NDArray[np.float32] | None = None
    """Orientation of the sensor at that time, a rotation vector, radians, [n, 3]."""
    normal: NDArray[np.float32] | None = None
    """Unit normal of the surface, towards the sensor, [n, 3]."""
    pose: NDArray[np.float64] | None = None
    """Transform from the frame of the sensor to that of the positions, [4, 4], when the scan began.
    It is the identity if the positions are in the frame of the sensor. `Scan(pose=...)` also takes seven
    numbers: x, y, z and a quaternion x, y, z, w."""
    object_names: list[str] | None = None
    """The name of each object of a scene, or else its label or number: `object_names[i]` is that of the
    points whose `object` is i. None if no object has a name or a label."""
    object_labels: list[str] | None = None
    """The label of each object, or an empty text. None if no object has one."""

    _is_at_rest = False

    def __post_init__(self) -> None:
        # As files may have it: poses of f32, multiplied some times.
        self.pose = np.eye(4) if self.pose is None else _poses.matrix("pose", self.pose, 1e-3)
        positions = np.asarray(self.positions, dtype=np.float32)
        if positions.ndim != 2 or positions.shape[1] != 3:
            raise _edgepuck.Error(f"positions: expected shape [n, 3], found {list(positions.shape)}")
        self.positions = positions
        if self.sensor_position is None:
            at = (self.pose[:3, 3] - self.origin).astype(np.float32)
            self.sensor_position = np.broadcast_to(at, self.positions.shape)
            self._is_at_rest = True

    def __len__(self) -> int:
        """The number of points."""
        return len(self.positions)

    def __repr__(self) -> str:
        columns = ["positions", *(name for name, of in self._columns().items() if of is not None)]
        return f"<Scan of {len(self)} points: {', '.join(columns)}>"

    def _repr_html_(self) -> str | None:
        if not len(self):
            return None
        with tempfile.TemporaryDirectory(prefix="edgepuck-") as folder:
            file = Path(folder, "scan.npz")
            self.save(file)
            return page_of([str(file)], folder)._repr_html_()

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        array = self.positions if dtype is None else self.positions.astype(dtype, copy=False)
        return array.copy() if copy else array

    def in_sensor_frame(self) -> NDArray[np.float32]:
        """The positions in the frame of the sensor, x forward and z up, metres, [n, 3]."""
        assert self.pose is not None
        from_sensor = self.positions + (self.origin - self.pose[:3, 3])
        return np.ascontiguousarray(from_sensor @ self.pose[:3, :3], dtype=np.float32)

    def to_open3d(self) -> Any:
        """An `open3d.t.geometry.PointCloud` of the positions and all attributes, with these names, each
        [n, k]; `to_legacy()` of it makes an `open3d.geometry.PointCloud`. Normals are `normals`, and whole
        numbers of 32 bits have a sign, without which Open3D cannot write them.

        Positions are in f64 if `origin`, which is added, is not zero. Open3D's own readers of our PLY files
        leave out the columns whose types they have not (`beam`, `ring`, `object`), and those of our NPZ files
        take `pose`, `origin` and the objects' names for attributes of points: `Scan.read(file).to_open3d()` has
        all columns, and Open3D can write it.

        Raises:
            ImportError: Open3D is not installed.
        """
        columns = {"normals" if name == "normal" else name: of for name, of in self._columns().items()}
        return _exchange.open3d_cloud(self._in_world(), columns)

    def to_pointcloud2(self, frame_id: str = "map", *, stamp: float = 0.0) -> Any:
        """A `sensor_msgs/PointCloud2` of the positions and all attributes: x, y, z, then intensity, ring and
        time, then the others, without gaps. Vectors are three fields, such as `normal_x`.

        It is a message of ROS 2 if its Python packages are installed, and else an object with the same
        fields. For points in the frame of the sensor, give `Scan(scan.in_sensor_frame(), ...)`.

        Args:
            frame_id: The name of the frame of the positions.
            stamp: When the revolution began, seconds since 1970.

        Raises:
            Error: `stamp` is below 0 or too large.

        >>> import edgepuck as ep
        >>> message = ep.Sensor("vlp16").scan(ep.Mesh(*ep.box((1.0, 1.0, 1.0)))).to_pointcloud2("lidar")
        >>> [(field.name, field.offset, field.datatype) for field in message.fields][:4]
        [('x', 0, 7), ('y', 4, 7), ('z', 8, 7), ('ring', 12, 4)]
        """
        columns = _exchange.named_columns(self._columns())
        return _exchange.pointcloud2(self._in_world().astype(np.float32), columns, frame_id, stamp)

    def _in_world(self) -> NDArray[Any]:
        """The positions with the origin, in f64 unless it is zero."""
        return self.positions + self.origin if np.any(self.origin) else self.positions

    def _columns(self) -> dict[str, NDArray[Any] | None]:
        """The attributes by their names; without the place of a sensor that stood still."""
        left_out = {"positions", "origin", "pose", "object_names", "object_labels", *(["sensor_position"] if self._is_at_rest else [])}
        return {field.name: getattr(self, field.name) for field in fields(self) if field.name not in left_out}

    @staticmethod
    def read(
        path: str | os.PathLike[str],
        *,
        format: str | None = None,
        metadata: str | os.PathLike[str] | None = None,
        sender: str | None = None,
    ) -> Scan:
        """Read the points in a file like `edgepuck view`: a scan, a cloud, or the first turn of a
        capture.

        Args:
            path: The file.
            format: The format, if the name of the file does not tell it, such as `nuscenes`.
            metadata: The metadata of the Ouster whose packets are in the capture.
            sender: The address of the sensor in the capture, by default that of the first sensor.

        Raises:
            Error: The file cannot be read.
        """
        described = None if metadata is None else os.fspath(metadata)
        return scan_of(_edgepuck.read_points(os.fspath(path), format, described, sender))

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write a file with the extension .npz, .ply, .csv or .pcd, like `edgepuck scan`. An existing
        file is replaced, as by `numpy.save`. All but .csv keep the pose, and .npz and .ply the names of
        objects.

        Raises:
            Error: The name has another extension, a column has another type or shape, or the file cannot be
                written.
        """
        names = {name: column for column, name in _NAMES.items()}
        columns = {names.get(field.name, field.name): getattr(self, field.name) for field in fields(self)}
        left_out = {"sensor"} if self._is_at_rest else set()
        if np.array_equal(columns["pose"], np.eye(4)):
            left_out.add("pose")
        else:
            columns["pose"] = np.ravel(columns["pose"]).astype(float)
        known: dict[str, Any] = {
            name: of if name.startswith("object_") else np.ascontiguousarray(of)
            for name, of in columns.items()
            if of is not None and name not in left_out
        }
        _edgepuck.save_scan(os.fspath(path), known)


def scan_of(columns: Mapping[str, Any]) -> Scan:
    """A scan with these columns, by their names in files."""
    named = {_NAMES.get(column, column): of for column, of in columns.items()}
    pose = named.get("pose")
    pose = None if pose is None else np.array(pose).reshape(4, 4)
    return Scan(**{**named, "origin": np.array(named["origin"]), "pose": pose})
