"""Scenes of meshes, built in Python or read from files."""

from __future__ import annotations

import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck, _poses, _scanning
from ._arguments import seed as seed_of
from ._arguments import some_of, whole
from ._mesh import Axis, AnyMesh, Mesh, Unit, unit_of
from ._mesh import taken as mesh_of
from ._scan import Scan, scan_of
from ._sensor import AnySensor, Sensor, taken


class Scene:
    """Instances of meshes in the world.

    The instances of a mesh share its data, and moving an instance rebuilds nothing.

    >>> import edgepuck as ep
    >>> scene, cube = ep.Scene(), ep.Mesh(*ep.box((1.0, 1.0, 1.0)))
    >>> near = scene.add(cube, position=(3, 0, 0))
    >>> far = scene.add(cube, position=(6, 1, 0), scale=2.0, reflectivity=0.3)
    >>> scan = scene.scan(ep.Sensor("vlp32c"), pose=np.eye(4), noise=0.01, seed=7)
    >>> sorted(set(scan.object.tolist())) == [near, far]
    True
    >>> scene.move(near, position=(3, 20, 0))
    """

    def __init__(self) -> None:
        self._scene = _edgepuck.Scene()
        self._file: tuple[str, dict[str, float], bool, bool] | None = None
        self._added: list[tuple[Mesh, tuple[Any, ...]]] = []
        self._moved: dict[int, list[float]] = {}

    @classmethod
    def read(
        cls,
        file: str | os.PathLike[str],
        *,
        joints: Mapping[str, float] | None = None,
        collision: bool = False,
        base_colours: bool = False,
    ) -> Scene:
        """Read the TOML file of a scene, a glTF file or a robot, like `edgepuck scan`, and the files that it
        names.

        Each node of glTF that has a mesh, and each geometry of a robot's links, is an instance with its name;
        its label is the name of the mesh or of the link.

        Args:
            file: A TOML, .glb, .gltf or .urdf file.
            joints: The positions of a robot's joints by name, radians or metres; 0 by default.
            collision: Whether a robot is made of its collision geometry in place of the visual one.
            base_colours: Whether the luminances of the base colours of a glTF file's materials are taken for
                reflectivities, which are 1 by default. They are those of visible light.

        Raises:
            Error: The file, or a mesh or sensor that it names, cannot be read.
        """
        _refuse_others(file)
        scene = cls()
        scene._file = os.path.abspath(file), dict(joints or {}), bool(collision), bool(base_colours)
        scene._scene = _edgepuck.Scene.read(os.fspath(file), *scene._file[1:])
        return scene

    @classmethod
    def of(cls, scene: Any, *, up: Axis = "z", units: Unit | None = None) -> Scene:
        """The nodes of a `trimesh.Scene`, which reads glTF, DAE, 3MF and others, as instances.

        Each node that has a mesh is an instance: its `name` is that of the node, and its `label` that of
        the geometry. Nodes with one geometry share its data.

        Args:
            scene: The scene, or anything with `graph.nodes_geometry` and `geometry` as trimesh has them; or
                one mesh that `Mesh` takes.
            up: The axis of the scene that points up, y or z: y in glTF.
            units: The unit of length of the scene, as in `Mesh`; by default that of `scene.units`, or m.

        Raises:
            Error: There is no node with a mesh, its geometries have different units, or it is not a scene.
        """
        if up not in ("y", "z"):
            raise _edgepuck.Error(f"up: expected one of y, z, found {up!r}")
        if isinstance(scene, (str, os.PathLike)):
            raise _edgepuck.Error(f"expected a trimesh.Scene, found the path {os.fspath(scene)!r}: `Scene.read` reads files")
        found = cls()
        if not (hasattr(scene, "graph") and hasattr(scene, "geometry")):
            found.add(scene if isinstance(scene, Mesh) else Mesh(scene, up=up, units=units))
            return found
        unit, factor, metres = unit_of(units, scene)
        meshes: dict[str, Mesh] = {}
        for node in scene.graph.nodes_geometry:
            matrix, name = scene.graph[node]
            geometry = scene.geometry[name]
            if not hasattr(geometry, "faces"):
                warnings.warn(f"{node}: left out, since it has no faces", stacklevel=2)
                continue
            # The basis turns (x, y, z) to (x, -z, y), as for meshes of files.
            matrix = (_Y_UP if up == "y" else np.eye(4)) @ np.asarray(matrix, dtype=np.float64)
            scale = np.linalg.norm(matrix[:3, :3], axis=0)
            pose = matrix.copy()
            pose[:3, :3] /= np.where(scale > 0, scale, 1)
            pose[:3, 3] *= metres
            off = np.abs(pose[:3, :3].T @ pose[:3, :3] - np.eye(3)).max()
            if off < 1e-6 and np.linalg.det(pose[:3, :3]) > 0:
                if name not in meshes:
                    corners = factor * np.asarray(geometry.vertices)
                    meshes[name] = Mesh(corners, geometry.faces, units=unit)
                found.add(meshes[name], _nearest_rotation(pose), scale=scale, name=node, label=name)
            else:
                # A mirror image or a sheared one is a mesh of its own.
                corners = np.asarray(geometry.vertices) @ matrix[:3, :3].T + matrix[:3, 3]
                found.add(Mesh(factor * corners, geometry.faces, units=unit), name=node, label=name)
        if len(found) == 0:
            raise _edgepuck.Error("expected a scene with meshes, found none")
        return found

    def __len__(self) -> int:
        """The number of instances."""
        return len(self._scene)

    @property
    def names(self) -> list[str | None]:
        """The names of the instances, by their numbers."""
        return self._scene.names()

    @property
    def labels(self) -> list[str | None]:
        """The labels of the instances, by their numbers."""
        return self._scene.labels()

    @property
    def bounds(self) -> NDArray[np.float64]:
        """The least and the largest coordinates of the instances, metres, [n, 2, 3].

        Those of instances that move are at time 0.
        """
        return np.array(self._scene.bounds()).reshape(-1, 2, 3)

    def add(
        self,
        mesh: AnyMesh,
        pose: ArrayLike | None = None,
        *,
        position: ArrayLike | None = None,
        scale: float | ArrayLike = 1.0,
        name: str | None = None,
        label: str | None = None,
        reflectivity: float = 1.0,
        retroreflection: float = 0.0,
    ) -> int:
        """Add an instance of a mesh. Return its number, which is the `object` of its points in scans.

        Args:
            mesh: The mesh, or anything that `Mesh` takes alone, such as a path: it keeps its size.
            pose: The pose of the mesh in the world: a matrix of shape [4, 4] without scale, or seven
                numbers: x, y, z in metres and a quaternion x, y, z, w of length 1, as in ROS.
            position: The position of the mesh's origin, metres, instead of `pose`. By default, the
                origin of the world.
            scale: A factor, or a factor for each axis of the mesh.
            name: A name, which keys the random numbers of the instance's returns.
            label: The name of the class.
            reflectivity: The share of light that returns at vertical incidence, 0 to 1.
            retroreflection: The strength of retro-reflection, from 0 to 1 (an ideal retro-reflector).

        Raises:
            Error: A value is out of its limits.
        """
        factors = np.asarray(scale, dtype=np.float64)
        if factors.shape not in [(), (3,)]:
            raise _edgepuck.Error(f"scale: expected one number or three, found {scale!r}")
        row, factors = _poses.placed(pose, position), np.broadcast_to(factors, (3,))
        settings = (factors.tolist(), name, label, float(reflectivity), float(retroreflection))
        taken = mesh_of(mesh)
        number = self._scene.add(taken._mesh, row, *settings)
        self._added.append((taken, settings))
        self._moved[number] = row[0].tolist()
        return number

    def move(
        self,
        instance: int | Sequence[int],
        pose: ArrayLike | None = None,
        *,
        position: ArrayLike | None = None,
    ) -> None:
        """Move the instance with this number to a pose or a position, as in `add`, or many to their poses.

        Args:
            instance: The number of an instance, or those of k instances. All of them move, or none.
            pose: The pose of the instance, [4, 4] or [7]: x, y, z and a quaternion x, y, z, w; or their
                poses, [k, 4, 4] or [k, 7].
            position: The position of the one instance, metres, instead of `pose`.

        Raises:
            Error: There is no such instance, or one is named twice; there is no pose; the poses have a wrong
                shape or are not rotations.
        """
        if np.ndim(instance) > 0:
            numbers = _numbers("instance", instance)  # type: ignore[arg-type]
            if pose is None or position is not None:
                raise _edgepuck.Error("expected the poses of all instances, and no position")
            _, rows = _poses.many("pose", pose, (len(numbers),))
        else:
            if pose is None and position is None:
                raise _edgepuck.Error("expected a pose or a position, found neither")
            rows = _poses.placed(pose, position)
            numbers = [whole("instance", instance, 0, 2**32 - 1)]
        self._scene.move_all(numbers, rows)
        self._moved.update(zip(numbers, rows.tolist(), strict=True))

    def scan(
        self,
        sensor: AnySensor,
        *,
        distance: float | None = None,
        elevation: float | None = None,
        azimuth: float | None = None,
        pose: ArrayLike | None = None,
        noise: float = 0.0,
        dropout: float = 0.0,
        effects: Mapping[str, Any] | None = None,
        attributes: Iterable[str] | None = None,
        seed: int | None = None,
    ) -> Scan:
        """Scan the scene.

        Args:
            sensor: The sensor, or its name or profile, which is then read at each call.
            distance: The distance of the sensor from the origin, at which it looks, metres; 3 by default.
            elevation: The elevation of the sensor above the horizon, degrees; 20 by default.
            azimuth: The azimuth of the sensor, counterclockwise from x, degrees; 0 by default.
            pose: The pose of the sensor, instead of these three: a matrix of shape [4, 4] from the
                frame of the sensor (x forward, z up) to the world, or seven numbers, as in `add`.
            noise: Standard deviation of the noise of the ranges, metres.
            dropout: Probability that a return is missing.
            effects: Further effects, with the keys of the table `[effects]` of a scene:
                `{"footprint": {"samples": 7}, "returns": "last"}`. Noise, dropout and these take the
                place of the effects of a scene's file.
            attributes: The attributes of each point besides its position: range, beam, ring, time,
                triangle, object, intensity, power, reflectivity, return, medium, normal. By default
                those of the scene's file, or range, beam, ring, time and object.
            seed: The seed of all random numbers; by default that of the scene's file, or 0.

        Raises:
            Error: A value is out of its limits, or an attribute or effect is unknown.
        """
        at = _scanning.place(pose, distance, elevation, azimuth)
        wanted = _scanning.encoded(noise, dropout, effects)
        return _scanning.scan(self._scene, taken(sensor)._sensor, at, wanted, attributes, seed)

    def cast(
        self,
        sensor: AnySensor,
        poses: ArrayLike,
        *,
        move: tuple[Sequence[int], ArrayLike] | None = None,
        noise: float = 0.0,
        dropout: float = 0.0,
        effects: Mapping[str, Any] | None = None,
        attributes: Iterable[str] = (),
        seed: int | None = None,
    ) -> Batch:
        """The ranges of a sensor's beams from many poses, as learning loops want them.

        Each pose sees a world of its own, in which the instances of `move` stand elsewhere. Nothing is
        rebuilt, and the scene itself does not change. A row has the ranges of `scan` at its pose, with the
        same effects and its seed of `seeds`. The sensor's adapter casts.

        Args:
            sensor: The sensor, or its name or profile, which is then read at each call.
            poses: The poses of the sensor, [n, 4, 4], or [n, 7]: x, y, z and a quaternion x, y, z, w.
            move: Numbers of k instances, and their poses for each pose of the sensor, [n, k, 4, 4] or
                [n, k, 7].
            noise: Standard deviation of the noise of the ranges, metres.
            dropout: Probability that a return is missing.
            effects: Further effects, as in `scan`.
            attributes: What the batch has besides ranges and objects: intensity, power.
            seed: The seed of the batch; by default that of the scene's file, or 0. Give each step of a
                loop its own.

        Raises:
            Error: A pose has a wrong shape or is not a rotation; there is no such instance.

        >>> import edgepuck as ep
        >>> scene = ep.Scene()
        >>> cube = scene.add(ep.Mesh(*ep.box((1.0, 1.0, 1.0))), position=(3, 0, 0))
        >>> poses = np.tile(np.eye(4), (2, 1, 1))
        >>> of_each = np.tile(np.eye(4), (2, 1, 1, 1))
        >>> of_each[:, 0, 0, 3] = [3, 6]
        >>> batch = scene.cast(ep.Sensor("vlp16"), poses, move=([cube], of_each))
        >>> batch.ranges.shape, batch.ranges.min(axis=1).round(2).tolist()
        ((2, 28935), [2.5, 5.5])
        """
        n, rows = _poses.many("poses", poses)
        numbers: list[int] = []
        moved = np.empty((0, 16))
        if move is not None:
            numbers = _numbers("move", move[0])
            _, moved = _poses.many("move", move[1], (n, len(numbers)))
        key = None if seed is None else seed_of(seed)
        if isinstance(attributes, str):
            raise _edgepuck.Error(f"attributes: expected a list of names, found {attributes!r}")
        wanted = (_scanning.encoded(noise, dropout, effects), list(attributes), key)
        known = taken(sensor)
        columns = self._scene.cast(known._sensor, rows, numbers, moved, *wanted)
        # The largest number, of beams without a return, is -1.
        columns["object"] = columns["object"].view(np.int32)
        return Batch(**columns, sensor=known)

    def __reduce__(self) -> tuple[Any, ...]:
        return _remade, (self._file, self._added, self._moved)

    def __repr__(self) -> str:
        known = [label or name or str(number) for number, (name, label) in enumerate(zip(self.names, self.labels, strict=True))]
        return f"<Scene of {len(self)} instances: {some_of(known)}>" if known else "<Scene of 0 instances>"


@dataclass(frozen=True, eq=False, repr=False)
class Batch:
    """The ranges of a sensor's beams from many poses, of `Scene.cast`."""

    ranges: NDArray[np.float32]
    """Metres, infinite where nothing returns, [n, n_beams]; beams are in the order of `directions`."""
    object: NDArray[np.int32]
    """The number of the instance; -1 where nothing returns, or something in the air, [n, n_beams]."""
    seeds: NDArray[np.uint64]
    """The seed of each row, [n]."""
    sensor: Sensor
    """The sensor."""
    second_ranges: NDArray[np.float32] | None = None
    """The ranges of second returns, if the effects ask for dual returns, [n, n_beams]."""
    intensity: NDArray[np.float32] | None = None
    """The intensities of the returns of `ranges`, if they were asked for, [n, n_beams]."""
    power: NDArray[np.float32] | None = None
    """The received powers of these returns, if they were asked for, [n, n_beams]."""

    def __repr__(self) -> str:
        (n, beams), hits = self.ranges.shape, np.isfinite(self.ranges).mean() if self.ranges.size else 0.0
        return f"<Batch of {n} x {beams} ranges by {self.sensor.name}: {100 * hits:.1f} % returned>"

    def range_image(self) -> NDArray[np.float32]:
        """The ranges as images, [n, rings, columns]: rings from below, columns in the order of firing.

        A ring that fires less often than others in a revolution ends with infinite ranges.
        """
        rings, times = self.sensor.rings, self.sensor.times
        order = np.lexsort((times, rings))
        _, starts, rows, counts = np.unique(
            rings[order], return_index=True, return_inverse=True, return_counts=True
        )
        image = np.full((len(self.ranges), len(starts), counts.max()), np.inf, np.float32)
        image[:, rows, np.arange(len(order)) - starts[rows]] = self.ranges[:, order]
        return image


def scan_scene(
    file: str | os.PathLike[str],
    sensor: AnySensor | None = None,
    *,
    pose: ArrayLike | None = None,
    adapter: str = "cpu",
) -> dict[str, Scan]:
    """Scan the scene in a file, like `edgepuck scan`. Return the scans by the names of sensors.

    Args:
        file: The TOML file of a scene, or one without sensors (`Scene.read` says which), if `sensor` is given.
        sensor: A sensor in place of those of the file.
        pose: The pose of `sensor`, as in `Scene.scan`; by default, it is 3 m from the origin and looks at it.
        adapter: The adapter, as in `Sensor`, which casts for the sensors of the file.

    Raises:
        Error: The file cannot be read, or has no sensor and none is given.
    """
    scene = Scene.read(file)
    if sensor is not None:
        known = taken(sensor)
        return {known.name: scene.scan(known, pose=pose)}
    if pose is not None:
        raise _edgepuck.Error("pose: expected a sensor beside it, found none")
    scans = scene._scene.scan_all(adapter)
    if not scans:
        raise _edgepuck.Error(
            f"{os.fspath(file)}: expected sensors, found a file without any: name one, such as "
            'scan_scene(file, "vlp32c"), or `Scene.read(file).scan(sensor, pose=...)`'
        )
    return {name: scan_of(columns) for name, columns in scans}


def _remade(
    read: tuple[str, dict[str, float], bool, bool] | None,
    added: list[tuple[Mesh, tuple[Any, ...]]],
    moved: dict[int, list[float]],
) -> Scene:
    """The scene that was pickled."""
    scene = Scene()
    if read is not None:
        file, joints, collision, base_colours = read
        scene = Scene.read(file, joints=joints, collision=collision, base_colours=base_colours)
    scene._added, scene._moved = added, moved
    for mesh, settings in added:
        scene._scene.add(mesh._mesh, _poses.placed(None, None), *settings)
    for number, row in moved.items():
        scene._scene.move_all([number], np.array([row]))
    return scene


def _numbers(name: str, instances: Iterable[int]) -> list[int]:
    """The numbers of different instances."""
    numbers = [whole(name, number, 0, 2**32 - 1) for number in instances]
    if len(set(numbers)) < len(numbers):
        twice = min(number for number in numbers if numbers.count(number) > 1)
        raise _edgepuck.Error(f"{name}: expected each instance once, found {twice} twice")
    return numbers


# What takes the files that `Scene.read` does not, by their extensions.
_OTHERS = {
    **dict.fromkeys((".stl", ".obj", ".off", ".ply"), "is a mesh: `Scene().add(Mesh({file!r}))` makes a scene of it"),
    **dict.fromkeys((".dae", ".3mf"), "is read by trimesh: `Scene.of(trimesh.load_scene({file!r}))`"),
    **dict.fromkeys((".fbx", ".blend", ".usd", ".usda", ".usdc", ".usdz", ".step", ".stp"), "is to be exported as glTF first"),
    **dict.fromkeys((".npz", ".npy", ".pcd", ".las", ".laz", ".pcap", ".csv"), "has points: `Scan.read({file!r})`"),
    ".xacro": "is to be expanded first: `xacro {file} > robot.urdf`, and then `Scene.read('robot.urdf')`",
    ".sdf": "is a world of Gazebo: give its models as URDF or glTF",
}
_MJCF = "is a model of MuJoCo: `edgepuck.mujoco.Lidar(mujoco.MjModel.from_xml_path({file!r}))` scans it"
_ROBOT = "is a robot in URDF: name it .urdf"
_XML = "is XML of another kind"


def _refuse_others(file: str | os.PathLike[str]) -> None:
    """Refuse a file of another kind than scenes with the function that takes it."""
    name = os.fspath(file)
    _, extension = os.path.splitext(name.lower())
    if extension in (".glb", ".gltf", ".urdf", ".toml"):
        return
    cause = _OTHERS.get(extension)
    if cause is None:
        try:
            with open(name, "rb") as opened:
                start = opened.read(65536)
        except OSError:
            return
        if not start.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<"):
            return
        cause = _MJCF if b"<mujoco" in start else _ROBOT if b"<robot" in start else _XML
    raise _edgepuck.Error(
        f"{name}: expected a scene in TOML, glTF or URDF, found a file that {cause.format(file=name)}"
    )


# (x, y, z) to (x, -z, y).
_Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])


def _nearest_rotation(pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """`pose` with a rotation to the last bit: products of transforms drift from it."""
    u, _, vt = np.linalg.svd(pose[:3, :3])
    rigid = pose.copy()
    rigid[:3, :3] = u @ vt
    rigid[3] = [0, 0, 0, 1]
    return rigid
