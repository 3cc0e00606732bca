"""Scans as objects of other libraries, and clouds of other libraries as points."""

from __future__ import annotations

import importlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._edgepuck import Error

# The numbers of `sensor_msgs/PointField` for the types of columns.
_DATATYPES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
# The fields of drivers first, in their order.
_FIRST = ("intensity", "ring", "time")


@dataclass
class Time:
    """`builtin_interfaces/Time`."""

    sec: int = 0
    """Seconds since 1970."""
    nanosec: int = 0
    """Nanoseconds of the second."""


@dataclass
class Header:
    """`std_msgs/Header`."""

    stamp: Time = field(default_factory=Time)
    """When the revolution began."""
    frame_id: str = ""
    """The frame of the points."""


@dataclass
class PointField:
    """`sensor_msgs/PointField`."""

    name: str = ""
    """The name."""
    offset: int = 0
    """The first byte in a point."""
    datatype: int = 0
    """1 to 8: int8, uint8, int16, uint16, int32, uint32, float32, float64."""
    count: int = 1
    """The number of values."""


@dataclass(repr=False)
class PointCloud2:
    """`sensor_msgs/PointCloud2`, whose fields it has, without ROS."""

    header: Header
    """The time and the frame."""
    height: int
    """1: the points are in no grid."""
    width: int
    """The number of points."""
    fields: list[PointField]
    """The layout of a point."""
    is_bigendian: bool
    """False."""
    point_step: int
    """The bytes of a point."""
    row_step: int
    """The bytes of all points."""
    data: bytes
    """The points."""
    is_dense: bool
    """True: all points are finite."""

    def __repr__(self) -> str:
        return f"<PointCloud2 of {self.width} points: {', '.join(of.name for of in self.fields)}>"


def named_columns(columns: dict[str, NDArray[Any] | None]) -> dict[str, NDArray[Any]]:
    """The columns that there are, each [n]: three of a vector, as PCL calls them."""
    named: dict[str, NDArray[Any]] = {}
    for name in sorted(columns, key=lambda name: _FIRST.index(name) if name in _FIRST else len(_FIRST)):
        of = columns[name]
        if of is None:
            continue
        if np.ndim(of) == 1:
            named[name] = np.asarray(of)
        else:
            named.update({f"{name}_{axis}": np.asarray(of)[:, i] for i, axis in enumerate("xyz")})
    return named


def pointcloud2(points: NDArray[np.float32], columns: dict[str, NDArray[Any]], frame_id: str, stamp: float) -> Any:
    """The message of points, [n, 3], and columns, [n]; that of ROS if its packages are installed."""
    if not 0 <= stamp < 2**31:
        raise Error(f"stamp: expected seconds since 1970, found {stamp}")
    all_columns = {**{axis: points[:, i] for i, axis in enumerate("xyz")}, **columns}
    layout = np.dtype([(name, of.dtype.newbyteorder("<")) for name, of in all_columns.items()])
    packed = np.empty(len(points), layout)
    for name, of in all_columns.items():
        packed[name] = of
    assert layout.fields is not None
    fields = {name: layout.fields[name] for name in all_columns}
    for name, (kind, *_) in fields.items():
        if kind.str[1:] not in _DATATYPES:
            raise Error(f"{name}: expected a type of PointCloud2, such as float32 or uint16, found {kind}")
    nanoseconds = round(stamp % 1 * 1e9)
    stamped = {"sec": int(stamp) + nanoseconds // 10**9, "nanosec": nanoseconds % 10**9}
    kinds = _ros() or (Time, Header, PointField, PointCloud2)
    time, header, point_field, cloud = kinds
    return cloud(
        header=header(stamp=time(**stamped), frame_id=frame_id),
        height=1,
        width=len(points),
        fields=[
            point_field(name=name, offset=int(of[1]), datatype=_DATATYPES[of[0].str[1:]], count=1)
            for name, of in fields.items()
        ],
        is_bigendian=False,
        point_step=layout.itemsize,
        row_step=layout.itemsize * len(points),
        data=packed.tobytes(),
        is_dense=bool(np.isfinite(points).all()),
    )


def _ros() -> tuple[Any, Any, Any, Any] | None:
    """The messages of ROS 2, if its packages are installed."""
    try:
        from builtin_interfaces.msg import Time as time  # type: ignore[import-not-found]
        from sensor_msgs.msg import PointCloud2 as cloud  # type: ignore[import-not-found]
        from sensor_msgs.msg import PointField as point_field
        from std_msgs.msg import Header as header  # type: ignore[import-not-found]
    except ImportError:
        return None
    return time, header, point_field, cloud


def open3d_cloud(points: NDArray[Any], columns: dict[str, NDArray[Any] | None]) -> Any:
    """An `open3d.t.geometry.PointCloud` with the columns that there are as attributes."""
    try:
        open3d: Any = importlib.import_module("open3d")
    except ImportError as cause:
        raise ImportError("Scan.to_open3d needs Open3D: pip install open3d") from cause
    cloud = open3d.t.geometry.PointCloud(open3d.core.Tensor(np.ascontiguousarray(points)))
    for name, of in columns.items():
        if of is not None:
            values = np.asarray(of)
            if values.dtype == np.uint32:
                # Open3D writes no PLY with 32 bits without a sign; those of what is in the air become -1.
                values = values.astype(np.int32 if values.size == 0 or (values + np.uint32(1)).max() <= 2**31 else np.int64)
            cloud.point[name] = open3d.core.Tensor(np.ascontiguousarray(values.reshape(len(values), -1)))
    return cloud


def foreign_points(cloud: Any) -> Any:
    """The points of a cloud of Open3D or trimesh, [n, 3], in f64; anything else as it is."""
    if hasattr(cloud, "point") and hasattr(cloud.point, "positions"):
        return cloud.point.positions.cpu().numpy()
    if hasattr(cloud, "points") and hasattr(cloud, "has_points"):
        return np.asarray(cloud.points)
    if hasattr(cloud, "vertices") and not hasattr(cloud, "faces"):
        return np.asarray(cloud.vertices)
    return cloud
