"""Farthest points, and the maxima over neighborhoods, as CUDA kernels."""

import cupy
import numpy as np
import torch
from edgepuck.torch import farthest, winners
from torch import Tensor

KERNELS = r"""
// A block of 256 threads for each cloud of at most 1,024 points; `picked` begins with the point that is farthest
// from the mean.
extern "C" __global__ void farthest(const float* points, int n, int m, int* picked) {
    const float* p = points + (size_t)blockIdx.x * n * 3;
    __shared__ unsigned long long best[2][8];
    __shared__ float sum[3][8];
    int t = threadIdx.x, lane = t & 31, warp = t >> 5;
    float x[4], y[4], z[4], nearest[4], s[3] = {0, 0, 0};
    for (int k = 0; k < 4; k++) {
        int i = t + 256 * k;
        x[k] = y[k] = z[k] = 0;
        nearest[k] = 1e30f;
        if (i < n) {
            x[k] = p[3*i]; y[k] = p[3*i+1]; z[k] = p[3*i+2];
            s[0] += x[k]; s[1] += y[k]; s[2] += z[k];
        }
    }
    for (int a = 0; a < 3; a++) {
        float v = s[a];
        for (int o = 16; o; o >>= 1) v += __shfl_down_sync(~0u, v, o);
        if (!lane) sum[a][warp] = v;
    }
    __syncthreads();
    float c[3];
    for (int a = 0; a < 3; a++) {
        c[a] = 0;
        for (int w = 0; w < 8; w++) c[a] += sum[a][w];
        c[a] /= n;
    }
    for (int j = -1; j < m; j++) {
        // The distance's bits in the high half, and the index inverted in the low one: the first of equals wins.
        unsigned long long key = 0;
        for (int k = 0; k < 4; k++) {
            int i = t + 256 * k;
            if (i >= n) continue;
            float v = (x[k]-c[0])*(x[k]-c[0]) + (y[k]-c[1])*(y[k]-c[1]) + (z[k]-c[2])*(z[k]-c[2]);
            if (j >= 0) v = nearest[k] = fminf(nearest[k], v);
            unsigned long long own = ((unsigned long long)__float_as_uint(v) << 32) | (unsigned)(~i);
            key = own > key ? own : key;
        }
        for (int o = 16; o; o >>= 1) {
            unsigned long long other = __shfl_down_sync(~0u, key, o);
            key = other > key ? other : key;
        }
        int b = j & 1;
        if (!lane) best[b][warp] = key;
        __syncthreads();
        key = best[b][0];
        for (int w = 1; w < 8; w++) key = best[b][w] > key ? best[b][w] : key;
        int pick = ~(unsigned)key;
        if (j + 1 >= m) break;
        if (t == 0) picked[blockIdx.x * m + j + 1] = pick;
        c[0] = p[3*pick]; c[1] = p[3*pick+1]; c[2] = p[3*pick+2];
    }
}

// A block for each centre, a thread for each channel; at most 1,024 points in a cloud.
extern "C" __global__ void winners(const float* points, const float* centres, const float* u, const float* weights,
        int n, int m, int channels, float squared_radius, float per_radius, int* out) {
    __shared__ int near[1024];
    __shared__ int count;
    size_t cloud = blockIdx.x / m;
    const float* p = points + cloud * n * 3;
    const float* c = centres + (size_t)blockIdx.x * 3;
    if (threadIdx.x == 0) count = 0;
    __syncthreads();
    for (int i = threadIdx.x; i < n; i += blockDim.x) {
        float dx = p[3*i]-c[0], dy = p[3*i+1]-c[1], dz = p[3*i+2]-c[2];
        if (dx*dx + dy*dy + dz*dz <= squared_radius) near[atomicAdd(&count, 1)] = i;
    }
    __syncthreads();
    for (int channel = threadIdx.x; channel < channels; channel += blockDim.x) {
        const float* w = weights + 4 * channel;
        float most = -3.4e38f;
        int winner = 0;
        for (int k = 0; k < count; k++) {
            int i = near[k];
            float v = w[0] * u[(cloud * n + i) * channels + channel]
                + per_radius * (w[1]*p[3*i] + w[2]*p[3*i+1] + w[3]*p[3*i+2]);
            // The list is in any order: the first of equals wins.
            if (v > most || (v == most && i < winner)) { most = v; winner = i; }
        }
        out[(size_t)blockIdx.x * channels + channel] = winner;
    }
}
"""


class Kernels:
    """The two kernels, in place of the functions of the same names in `edgepuck.torch`."""

    def __init__(self) -> None:
        self.by_name = {name: cupy.RawKernel(KERNELS, name) for name in ("farthest", "winners")}

    def launch(self, name: str, grid: int, block: int, *arguments: object) -> None:
        values = [a.data_ptr() if isinstance(a, Tensor) else a for a in arguments]
        with cupy.cuda.ExternalStream(torch.cuda.current_stream().cuda_stream):
            self.by_name[name]((grid,), (block,), tuple(values))

    def farthest(self, points: Tensor, n: int) -> Tensor:
        batch, m, _ = points.shape
        picked = torch.empty(batch, n, dtype=torch.int32, device=points.device)
        self.launch("farthest", batch, 256, points.contiguous(), np.int32(m), np.int32(n), picked)
        return picked.long()

    def winners(self, u: Tensor, points: Tensor, centres: Tensor, weight: Tensor, radius: float) -> Tensor:
        (batch, m, channels), n = u.shape, centres.shape[1]
        found = torch.empty(batch, n, channels, dtype=torch.int32, device=u.device)
        arrays = [a.contiguous() for a in (points, centres, u, weight)]
        sizes = [np.int32(size) for size in (m, n, channels)]
        radii = [np.float32(radius**2), np.float32(1 / radius)]
        self.launch("winners", batch * n, min(max(channels, 64), 256), *arrays, *sizes, *radii, found)
        return found.long()

    def check(self, clouds: Tensor) -> None:
        """Compares the kernels with the functions that they replace."""
        u, weight = torch.randn(*clouds.shape[:2], 64, device=clouds.device), torch.randn(64, 4, device=clouds.device)
        picked = farthest(clouds, 256)
        centres = clouds.gather(1, picked[:, :, None].expand(-1, -1, 3))
        pairs = [
            (self.farthest(clouds, 256), picked),
            (self.winners(u, clouds, centres, weight, 0.2), winners(u, clouds, centres, weight, 0.2)),
        ]
        for found, expected in pairs:
            # Points at the border of a neighborhood may be rounded to either side.
            equal = (found == expected).float().mean().item()
            if equal < 0.999:
                raise SystemExit(f"the kernels are wrong on this GPU: {100 * equal:.2f} % of their indices are right")
