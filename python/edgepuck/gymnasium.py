"""LiDARs in the observations of Gymnasium's environments of MuJoCo. Only this module imports Gymnasium."""

from __future__ import annotations

import importlib.util
import warnings
from typing import Any

import numpy as np

from . import _edgepuck
from ._arguments import seed as seed_of

try:
    import gymnasium

    from .mujoco import Lidar
except ImportError as cause:
    raise ImportError(
        "edgepuck.gymnasium needs Gymnasium and MuJoCo: pip install 'edgepuck[gymnasium]'"
    ) from cause

if importlib.util.find_spec("imageio") is None:
    needed = "Gymnasium's own environments of MuJoCo need imageio"
    warnings.warn(f"{needed}: pip install 'edgepuck[gymnasium]'", stacklevel=2)


class LidarObservation(gymnasium.ObservationWrapper[Any, Any, Any], gymnasium.utils.RecordConstructorArgs):
    """Adds the ranges of a LiDAR to the observations, as `Box(0, max_range, [n_beams], float32)`.

    An observation that is a dict gets one more key; any other becomes its key `state`. A beam without a
    return, or with one beyond `max_range`, has the range `max_range`. Ranges are those of the positions
    `qpos` that the environment has after its step. `reset(seed=...)` seeds the noise too: the same seed
    and actions give the same ranges. Without a seed, the environment's random numbers give one.

    Args:
        env: An environment whose `unwrapped.data` is MuJoCo's, such as a `MujocoEnv`.
        lidar: A LiDAR on its model, `Lidar(env.unwrapped.model, ...)`. Environments with the same model
            may share one.
        max_range: The longest range, metres.
        key: The key of the ranges.

    Raises:
        Error: The environment has no data of MuJoCo, or another model than the LiDAR; the key is taken;
            `max_range` is not above 0.
    """

    def __init__(
        self,
        env: gymnasium.Env[Any, Any],
        lidar: Lidar,
        *,
        max_range: float,
        key: str = "lidar",
    ) -> None:
        gymnasium.utils.RecordConstructorArgs.__init__(
            self, lidar=lidar, max_range=max_range, key=key, _disable_deepcopy=True
        )
        gymnasium.ObservationWrapper.__init__(self, env)
        if not hasattr(env.unwrapped, "data"):
            raise _edgepuck.Error(
                f"env: expected an environment with MuJoCo's `data`, found {env.unwrapped}"
            )
        if not isinstance(lidar, Lidar):
            raise _edgepuck.Error(
                f"expected an edgepuck.mujoco.Lidar, found {type(lidar).__name__}"
            )
        if not 0 < max_range < np.inf:
            raise _edgepuck.Error(f"max_range: expected metres above 0, found {max_range}")
        data: Any = env.unwrapped.data
        lidar.check_model(getattr(data, "model", None), "env: expected an environment")
        space = env.observation_space
        self._is_dict = isinstance(space, gymnasium.spaces.Dict)
        spaces = (
            dict(space.spaces) if isinstance(space, gymnasium.spaces.Dict) else {"state": space}
        )
        if key in spaces:
            raise _edgepuck.Error(f"key: expected one that observations lack, found {key!r}")
        n_beams = len(lidar.sensor.directions)
        spaces[key] = gymnasium.spaces.Box(0.0, max_range, (n_beams,), np.float32)
        self.observation_space = gymnasium.spaces.Dict(spaces)
        self.lidar, self._key, self._max_range = lidar, key, np.float32(max_range)
        self._seed: int | None = None
        self._n_casts = 0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """As Gymnasium's. `seed` is also the seed of the noise from now on."""
        if seed is not None:
            self._seed, self._n_casts = seed_of(seed), 0
        return super().reset(seed=seed, options=options)

    def observation(self, observation: Any) -> dict[str, Any]:
        """The observation with the ranges of a scan of the environment as it stands."""
        unwrapped: Any = self.env.unwrapped
        if self._seed is None:
            self._seed = int(unwrapped.np_random.integers(2**32))
        self._n_casts += 1
        seed = _edgepuck.seed_of_epoch(self._seed, self._n_casts)
        # A step leaves the poses before it in the data.
        ranges = self.lidar.ranges(self.lidar.settled(unwrapped.data), seed=seed)
        ranges = np.minimum(ranges, self._max_range)
        return {**(observation if self._is_dict else {"state": observation}), self._key: ranges}
