"""`edgepuck.mujoco` against MuJoCo's own rays, `mj_multiRay`.

Boxes, planes, meshes and height fields are the same surfaces. A polyhedron of a round geom contains that geom
with its radii smaller by the tolerance, and is contained in the geom. So along each beam from outside,
MuJoCo's range is at most ours, and ours at most MuJoCo's in the model with smaller radii: this is the bound
along the beam at any incidence.
"""

import pickle
import subprocess
import sys

import numpy as np
import pytest

import edgepuck as ep
from conftest import all_around

mujoco = pytest.importorskip("mujoco")
from edgepuck.mujoco import Lidar  # noqa: E402

TOLERANCE = 1e-3
SENSOR = all_around()
TETRA = "0 0 0 1 0 0 0 1 0 0 0 1"
SIZES = {"box": 3, "sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3}


def model_of(geoms: str, shrunk: float = 0.0) -> tuple:
    """A model with a site in the middle of the world, and its state; round geoms are smaller by `shrunk`."""
    text = f"""<mujoco><asset><mesh name="tetra" vertex="{TETRA}" scale=".7 .9 1.1"/>
      <hfield name="hills" nrow="30" ncol="40" size="3 2 .5 .2"/></asset>
      <worldbody><body name="robot"><freejoint/><geom name="own" type="sphere" size=".05"/>
        <site name="lidar" quat="1 .1 .2 .3"/></body>{geoms}</worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    rows, columns = np.indices((30, 40))
    model.hfield_data[:] = (0.5 + 0.5 * np.sin(rows / 3) * np.cos(columns / 4)).ravel()
    for geom in np.flatnonzero(model.geom_bodyid == 0):
        kind, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
        if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            size *= 1 - shrunk / size.max()
        elif kind in (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_CAPSULE, mujoco.mjtGeom.mjGEOM_CYLINDER):
            size[0] -= shrunk
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def rays(model, data) -> tuple[np.ndarray, np.ndarray]:
    """The ranges and geoms of MuJoCo's own rays, without the body of the site."""
    site, n = model.site("lidar").id, len(SENSOR.directions)
    directions = SENSOR.directions @ data.site_xmat[site].reshape(3, 3).T
    geoms, ranges, body = np.zeros(n, np.int32), np.zeros(n), int(model.site_bodyid[site])
    point, vectors = data.site_xpos[site], directions.ravel()
    mujoco.mj_multiRay(model, data, point, vectors, None, 1, body, geoms, ranges, None, n, 1e9)
    return np.where(geoms < 0, np.inf, ranges), geoms


def compare(geoms: str, is_exact: bool = False) -> None:
    model, data = model_of(geoms)
    lidar = Lidar(model, "lidar", SENSOR, see_self=False, tolerance=TOLERANCE)
    found = lidar.cast(data)
    nearest, hit = rays(model, data)
    farthest, _ = rays(*model_of(geoms, shrunk=TOLERANCE))
    ranges, is_near = found.ranges[0].astype(np.float64), nearest < 100
    assert is_near.sum() > 10 and not np.isfinite(ranges[np.isinf(nearest)]).any()
    # Ours are rounded to f32, and MuJoCo's meshes and height fields are in f32. One ray may pass an edge on
    # its other side.
    is_off = is_near & ((ranges < nearest - 1e-5) | (ranges > farthest + 1e-5))
    assert is_off.sum() <= 1, (ranges - nearest)[is_off]
    if is_exact:
        hits = is_near & ~is_off
        np.testing.assert_allclose(ranges[hits], nearest[hits], rtol=0, atol=1e-5)
        assert (lidar.geoms[found.object[0][hits]] == hit[hits]).all()


@pytest.mark.parametrize(
    "geom",
    [
        'type="box" size=".3 .5 .7" pos="1 .2 .1" euler="10 20 30"',
        'type="plane" size="0 0 1" pos="0 0 -.8" euler="3 4 0"',
        'type="plane" size="2 1 1" pos="0 0 -.8" euler="3 4 0"',
        'type="mesh" mesh="tetra" pos="1 0 .1" euler="30 20 10"',
        'type="hfield" hfield="hills" pos="0 0 -1.2"',
        'type="hfield" hfield="hills" pos="4 0 -.4" euler="5 5 40"',
    ],
)
def test_flat_faces_are_where_mujoco_has_them(geom: str) -> None:
    compare(f"<geom {geom}/>", is_exact=True)


@pytest.mark.parametrize(
    "geom",
    [
        'type="sphere" size=".5" pos="1 .2 .1"',
        'type="sphere" size=".02" pos=".2 0 .01"',
        'type="capsule" size=".3 .6" pos="1 .2 .1" euler="40 50 60"',
        'type="cylinder" size=".3 .6" pos="1 .2 .1" euler="40 50 60"',
        'type="ellipsoid" size=".3 .6 .1" pos="1 .2 .1" euler="40 50 60"',
    ],
)
def test_round_faces_are_within_the_bound(geom: str) -> None:
    compare(f"<geom {geom}/>")


@pytest.mark.parametrize("seed", range(4))
def test_random_scenes_are_within_the_bound(seed: int) -> None:
    rng = np.random.default_rng(seed)
    geoms = '<geom type="plane" size="0 0 1" pos="0 0 -1"/><geom type="hfield" hfield="hills" pos="6 0 -1"/>'
    for _ in range(20):
        kind = rng.choice([*SIZES, "mesh"])
        away = rng.normal(size=3)
        # Beyond 1.7 m: no geom contains the sensor.
        position = away / np.linalg.norm(away) * rng.uniform(1.7, 5)
        size = "" if kind == "mesh" else f'size="{" ".join(map(str, rng.uniform(0.05, 0.8, SIZES[kind])))}"'
        shape = 'mesh="tetra"' if kind == "mesh" else size
        turn = " ".join(map(str, rng.normal(size=4)))
        geoms += f'<geom type="{kind}" {shape} pos="{" ".join(map(str, position))}" quat="{turn}"/>'
    compare(geoms)


ROBOT = """
<geom name="floor" type="plane" size="0 0 1" pos="0 0 -1"/>
<geom name="ghost" type="sphere" size=".3" pos="1 0 0" rgba="1 1 1 0"/>
<geom name="visual" type="box" size=".3 .3 .3" pos="2 0 0" group="2"/>
<body name="ball" pos="0 2 0"><freejoint/><geom name="ball" type="sphere" size=".4"/></body>
<body name="hand" mocap="true" pos="0 -2 0"><geom name="hand" type="box" size=".2 .2 .2"/></body>"""


def test_a_state_in_a_batch_is_the_state_alone() -> None:
    model, data = model_of(ROBOT)
    lidar = Lidar(model, "lidar", SENSOR, see_self=False)
    qpos = np.tile(data.qpos, (3, 1))
    qpos[1, :3], qpos[2, 7:10] = [0.2, 0.1, 0.3], [0, -0.9, 0.1]
    states = []
    for row in qpos:
        states.append(mujoco.MjData(model))
        states[-1].qpos[:] = row
        mujoco.mj_kinematics(model, states[-1])
    batch = lidar.ranges(qpos)
    np.testing.assert_array_equal(lidar.ranges(states), batch)
    for state, ranges in zip(states, batch, strict=True):
        nearest, _ = rays(model, state)
        hits = np.isfinite(ranges) & np.isfinite(nearest)
        assert np.median(np.abs(ranges[hits] - nearest[hits])) < 1e-6
        np.testing.assert_array_equal(lidar.ranges(state), ranges)
        scan = lidar.scan(state, attributes=["range", "beam", "object"])
        np.testing.assert_array_equal(ranges[scan.beam], scan.range)
    assert len({ranges.tobytes() for ranges in batch}) == 3
    other = Lidar(model, "lidar", "vlp16")
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(other)).ranges(qpos), other.ranges(qpos))
    # What no joint moves can move all the same.
    states[0].mocap_pos[0] = [0, -1, 0]
    mujoco.mj_kinematics(model, states[0])
    moved = lidar.ranges(states[0])
    assert moved.min() < batch[0].min() - 0.1
    np.testing.assert_array_equal(lidar.ranges(lidar.settled(states[0])), moved)


def test_the_sensor_sees_the_geoms_of_its_groups() -> None:
    model, data = model_of(ROBOT)
    seen = lambda **settings: {model.geom(geom).name for geom in Lidar(model, "lidar", SENSOR, **settings).geoms}  # noqa: E731
    assert seen() == {"own", "floor", "visual", "ball", "hand"}
    assert seen(see_self=False) == {"floor", "visual", "ball", "hand"}
    assert seen(groups=[2]) == {"visual"}
    scan = Lidar(model, "lidar", SENSOR).scan(data)
    # The sensor stands in the sphere of its own body.
    assert 0.049 <= scan.range.min() and scan.range.max() <= np.float32(0.05)


def test_each_call_has_its_own_noise_and_a_seed_repeats_it() -> None:
    model, data = model_of(ROBOT)
    first, again, other = (Lidar(model, "lidar", SENSOR, noise=0.01, seed=seed, see_self=False) for seed in (1, 1, 2))
    one, two = first.ranges(data), first.ranges(data)
    assert not np.array_equal(one, two)
    np.testing.assert_array_equal(again.ranges(data), one)
    np.testing.assert_array_equal(first.scan(data, seed=9).range, other.scan(data, seed=9).range)
    assert not np.array_equal(other.ranges(data), one)
    clean = Lidar(model, "lidar", SENSOR, see_self=False).ranges(data)
    both = np.isfinite(clean) & np.isfinite(one)
    assert 0.009 < np.std(one[both] - clean[both]) < 0.011


def test_unseen_geoms_are_named_once() -> None:
    text = """<mujoco><worldbody><geom type="box" size="1 1 1"/><site name="eye"/>
      <flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" dim="2" mass="1"/></worldbody></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    with pytest.warns(UserWarning) as caught:
        Lidar(model, "eye", SENSOR)
    assert [str(warning.message) for warning in caught] == ["the LiDAR does not see flex 'cloth'"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda model, _: Lidar(model, "eye"), "site: expected one of 'lidar', found 'eye'"),
        (lambda model, _: Lidar(model, 1), "site: expected one of 'lidar', found 1"),
        (lambda model, data: Lidar(data), "expected a mujoco.MjModel, found MjData"),
        (lambda model, _: Lidar(model, groups=[5]), "expected geoms that the LiDAR can see, found none"),
        (lambda model, _: Lidar(model, tolerance=0), "tolerance: expected metres above 0, found 0"),
        (lambda model, _: Lidar(model).ranges(np.zeros(7)), "qpos: expected shape [n, 14], found [7]"),
        (
            lambda model, _: Lidar(model).ranges(mujoco.MjData(model)),
            "found none: call `mujoco.mj_forward(model, data)`",
        ),
        (lambda model, _: Lidar(model).scan(model_of("")[1]), "data: expected a state of this LiDAR's model, found another, which has 1 geoms in place of 6"),
    ],
)
def test_wrong_arguments_are_named(make, message: str) -> None:
    with pytest.raises(ep.Error) as caught:
        make(*model_of(ROBOT))
    assert message in str(caught.value)


def test_it_is_imported_only_when_asked_for() -> None:
    script = "import sys, edgepuck; assert not {'mujoco', 'gymnasium'} & set(sys.modules)"
    missing = "import sys; sys.modules['mujoco'] = None; import edgepuck.mujoco"
    subprocess.run([sys.executable, "-c", script], check=True)
    done = subprocess.run([sys.executable, "-c", missing], capture_output=True, text=True)
    assert "needs MuJoCo: pip install 'edgepuck[mujoco]'" in done.stderr


OTHER = """<mujoco><worldbody><site name="lidar" pos="0 0 1"/><body pos="3 0 1"><freejoint/>
  <geom type="{kind}" size="{size} {size} {size}" rgba="{red} 0 0 1"/></body><geom type="plane" size="0 0 1"/></worldbody></mujoco>"""


@pytest.mark.parametrize("other", [{"size": 1.5}, {"kind": "ellipsoid"}])
def test_states_of_another_model_with_as_many_geoms_are_refused(other: dict) -> None:
    usual = {"kind": "box", "size": 0.5, "red": 1}
    own, another, alike = (mujoco.MjModel.from_xml_string(OTHER.format(**usual | of)) for of in ({}, other, {"red": 0}))
    lidar, data, equal = Lidar(own, sensor=SENSOR), mujoco.MjData(another), mujoco.MjData(alike)
    mujoco.mj_forward(another, data)
    mujoco.mj_forward(alike, equal)
    for use in (lidar.ranges, lidar.scan, lidar.cast, lidar.settled, lambda state: lidar.cast([state])):
        with pytest.raises(ep.Error, match="data: expected a state of this LiDAR's model, found another, whose `geom_"):
            use(data)
    # An equal model, which is only of another colour, is the same to a LiDAR.
    np.testing.assert_array_equal(lidar.ranges(equal), Lidar(alike, sensor=SENSOR).ranges(equal))
    assert repr(lidar) == f"<Lidar all-around at site 'lidar': {len(SENSOR.directions)} beams, 2 geoms>"
