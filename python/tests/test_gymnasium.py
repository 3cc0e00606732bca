"""`edgepuck.gymnasium` in an environment of its own."""

import warnings

import numpy as np
import pytest

import edgepuck as ep
from conftest import all_around

mujoco, gymnasium = pytest.importorskip("mujoco"), pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402

from edgepuck.gymnasium import LidarObservation  # noqa: E402
from edgepuck.mujoco import Lidar  # noqa: E402

CART = """<mujoco><option timestep="0.02"/><worldbody>
  <geom type="box" size=".1 5 1" pos="5 0 0"/><geom type="box" size=".1 5 1" pos="-5 0 0"/>
  <body><joint name="x" type="slide" axis="1 0 0" damping="1"/><geom type="box" size=".2 .2 .1" mass="1"/>
    <site name="lidar" pos="0 0 .3"/></body></worldbody>
  <actuator><motor joint="x" ctrlrange="-5 5"/></actuator></mujoco>"""
SENSOR = all_around()
MODEL = mujoco.MjModel.from_xml_string(CART)


class Cart(gymnasium.Env):
    """A cart on a rail between two walls, 4.9 m before and behind its start."""

    def __init__(self, space: str = "box") -> None:
        self.model, self.data = MODEL, mujoco.MjData(MODEL)
        box = gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float64)
        self.observation_space = gymnasium.spaces.Dict({"cart": box}) if space == "dict" else box
        self.action_space = gymnasium.spaces.Box(-1, 1, (1,), np.float32)
        self._is_dict = space == "dict"

    def _observation(self):
        state = np.concatenate([self.data.qpos, self.data.qvel])
        return {"cart": state} if self._is_dict else state

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[0] = self.np_random.uniform(-1, 1)
        mujoco.mj_forward(self.model, self.data)
        return self._observation(), {}

    def step(self, action):
        self.data.ctrl[:] = action
        mujoco.mj_step(self.model, self.data)
        return self._observation(), 0.0, False, False, {}


def wrapped(space: str = "box", noise: float = 0.0) -> LidarObservation:
    lidar = Lidar(MODEL, "lidar", SENSOR, see_self=False, noise=noise)
    return LidarObservation(Cart(space), lidar, max_range=8.0)


@pytest.mark.parametrize("space", ["box", "dict"])
def test_gymnasiums_own_check_passes(space: str) -> None:
    with warnings.catch_warnings():
        # That a wrapper is checked, and that the cart's own state has no bounds.
        warnings.filterwarnings("error")
        warnings.filterwarnings("ignore", "(?s).*(different from the unwrapped|infinity)")
        check_env(wrapped(space, noise=0.01), skip_render_check=True)


def test_ranges_are_those_to_the_walls() -> None:
    env = wrapped()
    observation, _ = env.reset(seed=3)
    for _ in range(5):
        observation, *_ = env.step(np.array([1.0], np.float32))
    x, ranges = observation["state"][0], observation["lidar"]
    assert ranges.dtype == np.float32 and ranges in env.observation_space["lidar"]
    dx, dy, dz = SENSOR.directions.T
    distance = np.where(dx > 0, (4.9 - x) / dx, (-4.9 - x) / dx)
    on_wall = (np.abs(distance * dy) < 4.99) & (np.abs(distance * dz + 0.3) < 0.99)
    expected = np.where(on_wall, np.minimum(distance, 8.0), 8.0)
    is_clear = on_wall | (np.abs(distance * dy) > 5.01) | (np.abs(distance * dz + 0.3) > 1.01)
    # Sides of the walls, 0.2 m wide, are seen beside their faces.
    is_clear &= on_wall | (ranges == 8.0)
    assert on_wall.sum() > 300 and (ranges == 8.0).sum() > 300
    np.testing.assert_allclose(ranges[is_clear], expected[is_clear], rtol=1e-6)


def test_a_seed_repeats_the_noise() -> None:
    runs = []
    for _ in range(2):
        env = wrapped(noise=0.01)
        env.reset()
        first, _ = env.reset(seed=5)
        after, *_ = env.step(np.zeros(1, np.float32))
        runs.append([first["lidar"], after["lidar"]])
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0][0], runs[0][1])


def test_environments_without_a_seed_have_noise_of_their_own() -> None:
    first, second = (wrapped(noise=0.01).reset()[0]["lidar"] for _ in range(2))
    assert not np.array_equal(first, second)


def test_64_environments_share_a_lidar() -> None:
    lidar = Lidar(MODEL, "lidar", SENSOR, see_self=False)
    make = lambda: LidarObservation(Cart(), lidar, max_range=8.0)  # noqa: E731
    many = gymnasium.vector.SyncVectorEnv([make] * 64)
    observations, _ = many.reset(seed=0)
    observations, *_ = many.step(np.linspace(-1, 1, 64, dtype=np.float32)[:, None])
    assert observations["lidar"].shape == (64, len(SENSOR.directions))
    for i in (0, 31, 63):
        alone = wrapped()
        alone.reset(seed=i)
        expected, *_ = alone.step(np.linspace(-1, 1, 64, dtype=np.float32)[i, None])
        np.testing.assert_array_equal(observations["lidar"][i], expected["lidar"])
        np.testing.assert_array_equal(observations["state"][i], expected["state"])


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda lidar: LidarObservation(gymnasium.make("CartPole-v1"), lidar, max_range=8), "MuJoCo's `data`"),
        (lambda _: LidarObservation(Cart(), "vlp16", max_range=8), "expected an edgepuck.mujoco.Lidar, found str"),
        (lambda lidar: LidarObservation(Cart(), lidar, max_range=np.inf), "max_range: expected metres above 0"),
        (
            lambda lidar: LidarObservation(Cart(), lidar, max_range=8, key="state"),
            "expected one that observations lack",
        ),
    ],
)
def test_wrong_arguments_are_named(make, message: str) -> None:
    with pytest.raises(ep.Error) as caught:
        make(Lidar(MODEL, "lidar", SENSOR))
    assert message in str(caught.value)


gymnasium.register("edgepuck-cart", Cart, max_episode_steps=20)


@pytest.mark.parametrize("wrap", [lambda env: env, gymnasium.wrappers.TransformReward])
def test_an_environment_of_the_registry_is_made_again_with_its_lidar(wrap) -> None:
    env = LidarObservation(gymnasium.make("edgepuck-cart"), Lidar(MODEL, "lidar", SENSOR), max_range=8.0)
    env = wrap(env) if wrap is not gymnasium.wrappers.TransformReward else wrap(env, lambda reward: reward)
    with warnings.catch_warnings():
        warnings.filterwarnings("error")
        warnings.filterwarnings("ignore", "(?s).*(different from the unwrapped|infinity)")
        check_env(env, skip_render_check=True)


def test_a_lidar_of_another_model_is_refused_at_once() -> None:
    another = mujoco.MjModel.from_xml_string(CART.replace('".1 5 1"', '".1 4 1"'))
    with pytest.raises(ep.Error, match="env: expected an environment of this LiDAR's model, found another, whose `geom_size`"):
        LidarObservation(Cart(), Lidar(another, "lidar", SENSOR), max_range=8.0)
    alike = mujoco.MjModel.from_xml_string(CART)
    LidarObservation(Cart(), Lidar(alike, "lidar", SENSOR), max_range=8.0).reset(seed=1)
