"""LiDARs in simulations of MuJoCo. Only this module and `edgepuck.gymnasium` import MuJoCo."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _edgepuck
from ._arguments import seed as seed_of
from ._heightfield import heightfield
from ._mesh import Mesh, box
from ._scan import Scan
from ._scene import Batch, Scene
from ._sensor import AnySensor, Sensor, taken

try:
    import mujoco  # type: ignore[import-untyped]
except ImportError as cause:
    raise ImportError("edgepuck.mujoco needs MuJoCo: pip install 'edgepuck[mujoco]'") from cause

# Half the side of a plane that MuJoCo takes for infinite, metres.
_FAR_M = 1000.0

_Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]


class Lidar:
    """A LiDAR at a site of a MuJoCo model: x of the site's frame is forward, and z is up.

    Each geom becomes an instance of a `Scene` when the object is made; later changes of sizes and meshes
    are not seen, those of places are. Boxes, planes, meshes and height fields are exact. Spheres,
    capsules, cylinders and ellipsoids become polyhedra inside of them. Like MuJoCo's own rays, the
    sensor does not see geoms whose alpha is 0. Unlike them, it sees planes from below as well. A `Lidar`
    serves one thread at a time.

    Args:
        model: The model.
        site: The name or the number of the site.
        sensor: The sensor, or its name or profile.
        seed: The seed of all noise. Each call draws its own.
        noise: As `dropout` and `effects`, those of `Scene.scan`.
        groups: The groups of geoms that the sensor sees, 0 to 5; all by default.
        see_self: Whether the sensor sees the bodies that it is mounted on: all of the tree of bodies
            that has the site, unless this is the world itself.
        tolerance: How deep the polyhedra may lie within the true surfaces, metres.

    Raises:
        Error: There is no such site; no geom can be seen; a value is out of its limits.

    >>> text = '''<mujoco><worldbody><geom type="plane" size="0 0 1"/>
    ...   <body pos="0 0 1"><freejoint/><geom type="box" size=".1 .1 .1"/><site name="lidar" pos="0 0 .2"/></body>
    ... </worldbody></mujoco>'''
    >>> model = mujoco.MjModel.from_xml_string(text)
    >>> data = mujoco.MjData(model)
    >>> mujoco.mj_forward(model, data)
    >>> lidar = Lidar(model, "lidar", "vlp16", see_self=False)
    >>> scan = lidar.scan(data)
    >>> bool(abs(scan.positions[:, 2]).max() < 1e-6)
    True
    >>> lidar.ranges(data).shape
    (28935,)
    """

    scene: Scene
    """The scene; its instances stand where the last scan saw them."""
    sensor: Sensor
    """The sensor."""
    geoms: NDArray[np.int32]
    """The number of the geom that each instance is: `geoms[scan.object]` are the geoms of the points."""

    def __init__(
        self,
        model: mujoco.MjModel,
        site: str | int = "lidar",
        sensor: AnySensor = "vlp16",
        *,
        seed: int = 0,
        noise: float = 0.0,
        dropout: float = 0.0,
        effects: Mapping[str, Any] | None = None,
        groups: Iterable[int] | None = None,
        see_self: bool = True,
        tolerance: float = 1e-3,
    ) -> None:
        if not isinstance(model, mujoco.MjModel):
            raise _edgepuck.Error(f"expected a mujoco.MjModel, found {type(model).__name__}")
        if not 0 < tolerance < np.inf:
            raise _edgepuck.Error(f"tolerance: expected metres above 0, found {tolerance}")
        self.sensor = taken(sensor)
        self.scene, self.seed = Scene(), seed_of(seed)
        self._model, self._site = model, _site(model, site)
        self._effects: dict[str, Any] = {"noise": noise, "dropout": dropout, "effects": effects}
        self._n_calls = 0
        # The model, and the last one that was found to be equal.
        self._known = [model]
        shapes, left_out, geoms = _Shapes(model, tolerance), _soft(model), []
        for geom in _seen(model, self._site, groups, see_self):
            mesh = shapes.mesh(geom)
            if mesh is None:
                left_out.append(_named(model, "geom", geom))
                continue
            name = model.geom(geom).name or None
            self.scene.add(mesh, name=name, label=model.body(model.geom_bodyid[geom]).name)
            geoms.append(geom)
        if left_out:
            warnings.warn(f"the LiDAR does not see {', '.join(left_out)}", stacklevel=2)
        if not geoms:
            raise _edgepuck.Error("model: expected geoms that the LiDAR can see, found none")
        self.geoms = np.array(geoms, dtype=np.int32)
        # Where the instances of the scene stand.
        self._poses = np.tile(np.eye(4), (len(geoms), 1, 1))
        self._own = mujoco.MjData(model)
        mujoco.mj_kinematics(model, self._own)
        self._place(self._own)

    def __repr__(self) -> str:
        site = self._model.site(self._site).name or self._site
        return f"<Lidar {self.sensor.name} at site {site!r}: {len(self.sensor.directions)} beams, {len(self.geoms)} geoms>"

    def scan(
        self,
        data: mujoco.MjData,
        *,
        attributes: Iterable[str] | None = None,
        seed: int | None = None,
    ) -> Scan:
        """The scan of the state `data`; positions are in MuJoCo's world.

        Args:
            data: The state. `mj_step` leaves the poses of the step before in it; `mj_kinematics` computes
                those of its `qpos`.
            attributes: The attributes of each point besides its position, as in `Scene.scan`.
            seed: The seed of the noise, in place of the next of the LiDAR's own.
        """
        pose = self._place(data)
        key = self._next_seed(seed)
        return self.scene.scan(
            self.sensor, pose=pose, attributes=attributes, seed=key, **self._effects
        )

    def cast(
        self, data: mujoco.MjData | Sequence[mujoco.MjData] | ArrayLike, *, seed: int | None = None
    ) -> Batch:
        """The ranges and objects of all beams in many states, each a row.

        Args:
            data: States of the model; or their generalised positions `qpos`, [n, nq], at which mocap bodies
                stand where the model has them.
            seed: As in `scan`.

        Raises:
            Error: A state is one of another model, or `qpos` has a wrong shape.
        """
        sensors, geoms = self._poses_of(data)
        is_moved = (geoms != self._poses).any(axis=(0, 2, 3))
        moved = np.flatnonzero(is_moved).tolist(), geoms[:, is_moved]
        key = self._next_seed(seed)
        return self.scene.cast(self.sensor, sensors, move=moved, seed=key, **self._effects)

    def ranges(
        self, data: mujoco.MjData | Sequence[mujoco.MjData] | ArrayLike, *, seed: int | None = None
    ) -> NDArray[np.float32]:
        """The range of each beam in metres, infinite where nothing returns.

        The beams are in the order of `sensor.directions`: [n_beams] for one state, and [n, n_beams] for many
        of them or for `qpos` of shape [n, nq]. The arguments are those of `cast`.
        """
        ranges = self.cast(data, seed=seed).ranges
        return ranges[0] if isinstance(data, mujoco.MjData) else ranges

    def settled(self, data: mujoco.MjData) -> mujoco.MjData:
        """A state of the LiDAR's own, with the poses of the positions `qpos` of `data`.

        `mj_step` leaves the poses of the step before. The next call changes this state.

        Raises:
            Error: `data` is a state of another model.
        """
        self.check_model(data.model, "data: expected a state")
        self._own.qpos[:] = data.qpos
        self._own.mocap_pos[:], self._own.mocap_quat[:] = data.mocap_pos, data.mocap_quat
        mujoco.mj_kinematics(self._model, self._own)
        return self._own

    def check_model(self, model: mujoco.MjModel, expected: str = "expected a model") -> None:
        """Check that `model` is that of this LiDAR, or an equal one.

        Raises:
            Error: It is another one.
        """
        if any(model is known for known in self._known):
            return
        if not isinstance(model, mujoco.MjModel):
            raise _edgepuck.Error(f"{expected} of MuJoCo, found {type(model).__name__}")
        found = _difference(self._model, model)
        if found:
            raise _edgepuck.Error(f"{expected} of this LiDAR's model, found another, {found}: make a Lidar of that model")
        # Of many equal ones, the last alone: each may be that of one episode.
        self._known = [self._model, model]

    def _place(self, data: mujoco.MjData) -> NDArray[np.float64]:
        """Move the instances to where `data` has them. Return the pose of the sensor."""
        sensors, (geoms,) = self._poses_of(data)
        is_moved = (geoms != self._poses).any(axis=(1, 2))
        self.scene.move(np.flatnonzero(is_moved).tolist(), geoms[is_moved])
        self._poses = geoms
        pose: NDArray[np.float64] = sensors[0]
        return pose

    def _poses_of(
        self, data: mujoco.MjData | Sequence[mujoco.MjData] | ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """The poses of the sensor, [n, 4, 4], and of the instances, [n, k, 4, 4], in n states."""
        states = [data] if isinstance(data, mujoco.MjData) else data
        if isinstance(states, Sequence) and all(isinstance(of, mujoco.MjData) for of in states):
            found = [self._rows(state) for state in states]
        else:
            qpos = np.asarray(states, dtype=np.float64)
            if qpos.ndim != 2 or qpos.shape[1] != self._model.nq:
                shape = f"[n, {self._model.nq}]"
                raise _edgepuck.Error(f"qpos: expected shape {shape}, found {list(qpos.shape)}")
            found = []
            for row in qpos:
                self._own.qpos[:] = row
                mujoco.mj_kinematics(self._model, self._own)
                found.append(self._rows(self._own))
        poses = np.zeros((len(found), 1 + len(self.geoms), 4, 4))
        poses[..., 3, 3] = 1
        for pose, (positions, rotations) in zip(poses, found, strict=True):
            pose[:, :3, 3], pose[:, :3, :3] = positions, rotations.reshape(-1, 3, 3)
        return poses[:, 0], poses[:, 1:]

    def _rows(self, data: mujoco.MjData) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Copies of the positions and rotations of the site and of the geoms."""
        self.check_model(data.model, "data: expected a state")
        if not data.site_xmat[self._site].any():
            raise _edgepuck.Error(
                "data: expected the poses of its geoms, found none: call `mujoco.mj_forward(model, data)` first"
            )
        positions = np.vstack([data.site_xpos[self._site], data.geom_xpos[self.geoms]])
        return positions, np.vstack([data.site_xmat[self._site], data.geom_xmat[self.geoms]])

    def _next_seed(self, seed: int | None) -> int:
        if seed is not None:
            return seed
        self._n_calls += 1
        return _edgepuck.seed_of_epoch(self.seed, self._n_calls)


class _Shapes:
    """The meshes of geoms in their own frames; equal geoms share one."""

    def __init__(self, model: mujoco.MjModel, tolerance: float) -> None:
        self.model, self.tolerance = model, tolerance
        self.meshes: dict[tuple[Any, ...], Mesh] = {}

    def mesh(self, geom: int) -> Mesh | None:
        """The mesh of this geom, if it has a shape that can be one."""
        model, kind = self.model, mujoco.mjtGeom(self.model.geom_type[geom])
        size = tuple(model.geom_size[geom].tolist())
        if kind in (mujoco.mjtGeom.mjGEOM_MESH, mujoco.mjtGeom.mjGEOM_HFIELD):
            size = (int(model.geom_dataid[geom]),)
        if (kind, *size) not in self.meshes:
            shape = self.shape(kind, size)
            if shape is None:
                return None
            self.meshes[kind, *size] = Mesh(*shape, units="m")
        return self.meshes[kind, *size]

    def shape(self, kind: mujoco.mjtGeom, size: tuple[Any, ...]) -> _Arrays | None:
        of = mujoco.mjtGeom
        if kind == of.mjGEOM_MESH:
            mesh = self.model.mesh(size[0])
            at, n = int(mesh.vertadr[0]), int(mesh.vertnum[0])
            first, m = int(mesh.faceadr[0]), int(mesh.facenum[0])
            return self.model.mesh_vert[at : at + n], self.model.mesh_face[first : first + m]
        if kind == of.mjGEOM_HFIELD:
            return _terrain(self.model, size[0])
        if kind == of.mjGEOM_BOX:
            return box((2 * size[0], 2 * size[1], 2 * size[2]))
        if kind == of.mjGEOM_PLANE:
            x, y = size[0] or _FAR_M, size[1] or _FAR_M
            corners = np.array([[-x, -y, 0], [x, -y, 0], [x, y, 0], [-x, y, 0]])
            return corners, np.array([[0, 1, 2], [0, 2, 3]])
        if kind == of.mjGEOM_ELLIPSOID:
            vertices, faces = _turned(*_ball(1.0, 0.0, self.tolerance / max(size)))
            return vertices * size, faces
        if kind == of.mjGEOM_SPHERE:
            return _turned(*_ball(size[0], 0.0, self.tolerance))
        if kind == of.mjGEOM_CAPSULE:
            return _turned(*_ball(size[0], size[1], self.tolerance))
        if kind == of.mjGEOM_CYLINDER:
            radius, half = size[:2]
            # The middles of the sides lie radius (1 - cos(pi / n)) within.
            n = np.pi / np.arccos(max(1 - self.tolerance / radius, 0.0))
            profile = np.array([[0, -half], [radius, -half], [radius, half], [0, half]])
            return _turned(profile, max(8, int(np.ceil(n))))
        return None


def _ball(radius: float, half: float, tolerance: float) -> tuple[NDArray[np.float64], int]:
    """Radii and heights of a half turn of latitude, of which each half is moved by `half` away from the
    other; and how many meridians hold every face within `tolerance`.

    With n meridians and n / 2 bands, the faces that touch the equator lie the deepest, by
    radius (1 - cos(pi / n)^2).
    """
    n = np.pi / np.arcsin(np.sqrt(min(tolerance / radius, 0.5)))
    n = 4 * max(2, int(np.ceil(n / 4)))
    latitude = np.linspace(-np.pi / 2, np.pi / 2, n // 2 + 1)
    profile = radius * np.stack([np.cos(latitude), np.sin(latitude)], axis=1)
    profile[[0, -1], 0] = 0
    south, north = profile[: n // 4 + 1] - [0, half], profile[n // 4 :] + [0, half]
    return np.concatenate([south, north if half else north[1:]]), n


def _turned(profile: NDArray[np.float64], n: int) -> _Arrays:
    """The surface of a profile of radii and heights, [m, 2], whose ends are on the axis, turned about z."""
    angle = 2 * np.pi * np.arange(n) / n
    (radii, heights), m = profile[1:-1].T[..., None], len(profile)
    rings = np.broadcast_arrays(radii * np.cos(angle), radii * np.sin(angle), heights)
    poles = [[[0, 0, z]] for z in profile[[0, -1], 1]]
    vertices = np.concatenate([poles[0], np.stack(rings, axis=-1).reshape(-1, 3), poles[1]])
    at = np.empty((m, n + 1), dtype=np.int64)
    at[1:-1, :n] = 1 + np.arange((m - 2) * n).reshape(m - 2, n)
    at[:, n] = at[:, 0]
    at[0], at[-1] = 0, len(vertices) - 1
    a, b, c, d = at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]
    # At a pole, one of the two triangles has no area.
    faces = np.concatenate([np.stack([a, b, c], -1)[1:], np.stack([a, c, d], -1)[:-1]])
    return vertices, faces.reshape(-1, 3)


def _terrain(model: mujoco.MjModel, number: int) -> _Arrays:
    """A height field as MuJoCo has it: a solid with walls and a floor beneath its heights."""
    rows, columns = int(model.hfield_nrow[number]), int(model.hfield_ncol[number])
    x, y, height, base = model.hfield_size[number].tolist()
    first = int(model.hfield_adr[number])
    heights = model.hfield_data[first : first + rows * columns].reshape(rows, columns) * height
    cell = (2 * x / (columns - 1), 2 * y / (rows - 1))
    top, faces = heightfield(heights, cell=cell, origin=(-x, -y, 0.0))
    at = np.arange(rows * columns).reshape(rows, columns)
    border = np.concatenate([at[0, :-1], at[:-1, -1], at[-1, :0:-1], at[:0:-1, 0]])
    foot = np.vstack([top[border], [[0, 0, -base]]])
    foot[:, 2] = -base
    up, low = border, len(top) + np.arange(len(border))
    next_up, next_low = np.roll(up, -1), np.roll(low, -1)
    middle = np.full_like(low, len(top) + len(border))
    sides = [(up, low, next_low), (up, next_low, next_up), (middle, next_low, low)]
    return np.concatenate([top, foot]), np.concatenate([faces, *(np.stack(of, -1) for of in sides)])


def _site(model: mujoco.MjModel, site: str | int) -> int:
    """The number of a site."""
    names = [model.site(number).name for number in range(model.nsite)]
    if isinstance(site, str):
        if site in names:
            return names.index(site)
    elif 0 <= site < model.nsite:
        return int(site)
    known = ", ".join(map(repr, names)) or "a site in the model"
    raise _edgepuck.Error(f"site: expected one of {known}, found {site!r}")


def _seen(
    model: mujoco.MjModel, site: int, groups: Iterable[int] | None, see_self: bool
) -> list[int]:
    """The geoms that can be seen from the site."""
    alpha = model.geom_rgba[:, 3].copy()
    has_material = model.geom_matid >= 0
    alpha[has_material] = model.mat_rgba[model.geom_matid[has_material], 3]
    is_seen = alpha > 0
    if groups is not None:
        is_seen &= np.isin(model.geom_group, list(groups))
    own = model.body_rootid[model.site_bodyid[site]]
    if not see_self and own != 0:
        is_seen &= model.body_rootid[model.geom_bodyid] != own
    return [int(geom) for geom in np.flatnonzero(is_seen)]


def _soft(model: mujoco.MjModel) -> list[str]:
    """The names of flexes and skins, which deform and therefore cannot be instances of a mesh."""
    kinds = [("flex", model.nflex), ("skin", model.nskin)]
    return [_named(model, kind, number) for kind, n in kinds for number in range(n)]


def _named(model: mujoco.MjModel, kind: str, number: int) -> str:
    name = mujoco.mj_id2name(model, mujoco.mju_str2Type(kind), number)
    what = f"{kind} {name!r}" if name else f"{kind} {number}"
    if kind != "geom":
        return what
    return (
        f"{what} ({mujoco.mjtGeom(model.geom_type[number]).name.removeprefix('mjGEOM_').lower()})"
    )


# What a LiDAR sees of a model: shapes, and what holds them.
_SEEN = (
    *("geom_type", "geom_size", "geom_dataid", "geom_bodyid", "geom_pos", "geom_quat", "geom_rgba", "geom_matid", "mat_rgba"),
    *("body_parentid", "body_pos", "body_quat", "jnt_type", "jnt_bodyid", "jnt_axis", "jnt_pos", "site_bodyid", "site_pos"),
    *("site_quat", "mesh_vert", "mesh_face", "hfield_size", "hfield_data"),
)


def _difference(expected: mujoco.MjModel, found: mujoco.MjModel) -> str | None:
    """What tells a model from the one that is expected, if a LiDAR sees it."""
    for what, name in [("geoms", "ngeom"), ("sites", "nsite"), ("bodies", "nbody"), ("joints", "njnt")]:
        numbers = getattr(expected, name), getattr(found, name)
        if numbers[0] != numbers[1]:
            return f"which has {numbers[1]} {what} in place of {numbers[0]}"
    for name in _SEEN:
        # Of colours, a LiDAR sees whether there is one.
        of = (..., 3) if name.endswith("_rgba") else ...
        if not np.array_equal(getattr(expected, name)[of], getattr(found, name)[of]):
            return f"whose `{name}` differs"
    return None
