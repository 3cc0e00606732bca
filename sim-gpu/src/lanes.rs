//! Vectors in f64, one in each lane: plain loops that the compiler vectorizes, for AVX2 or AVX-512
//! if [`widest`] finds them. Each lane equals the result of glam for one vector to the bit.

use fearless_simd::{Level, Simd, dispatch};
use glam::{DMat3, DVec3};
use std::ops::{Add, Mul, Sub};

/// The value of `of` for each lane. Unlike this, `array::from_fn` and `map` are not always inlined.
#[inline(always)]
pub(crate) fn each<T: Copy + Default, const N: usize>(of: impl Fn(usize) -> T) -> [T; N] {
    let mut lanes = [T::default(); N];
    for (lane, value) in lanes.iter_mut().enumerate() {
        *value = of(lane);
    }
    lanes
}

/// How many rays are aimed, or ranges computed, at once.
pub(crate) const LANES: usize = 8;

#[derive(Clone, Copy, Debug)]
pub(crate) struct Vectors<const N: usize> {
    pub x: [f64; N],
    pub y: [f64; N],
    pub z: [f64; N],
}

impl<const N: usize> Vectors<N> {
    #[inline(always)]
    pub fn new(vectors: [DVec3; N]) -> Self {
        Self { x: each(|i| vectors[i].x), y: each(|i| vectors[i].y), z: each(|i| vectors[i].z) }
    }

    #[inline(always)]
    pub fn lane(&self, lane: usize) -> DVec3 {
        DVec3::new(self.x[lane], self.y[lane], self.z[lane])
    }

    #[inline(always)]
    pub fn dot(&self, other: &Self) -> [f64; N] {
        each(|i| self.x[i] * other.x[i] + self.y[i] * other.y[i] + self.z[i] * other.z[i])
    }

    #[inline(always)]
    pub fn cross(&self, other: &Self) -> Self {
        Self {
            x: each(|i| self.y[i] * other.z[i] - other.y[i] * self.z[i]),
            y: each(|i| self.z[i] * other.x[i] - other.z[i] * self.x[i]),
            z: each(|i| self.x[i] * other.y[i] - other.x[i] * self.y[i]),
        }
    }

    #[inline(always)]
    pub fn normalize(&self) -> Self {
        let length_squared = self.dot(self);
        *self * each(|i| 1.0 / length_squared[i].sqrt())
    }

    #[inline(always)]
    pub fn mapped(&self, map: &DMat3) -> Self {
        let row = |i: usize| {
            let [x, y, z] = [map.x_axis[i], map.y_axis[i], map.z_axis[i]];
            each(|lane| x * self.x[lane] + y * self.y[lane] + z * self.z[lane])
        };
        Self { x: row(0), y: row(1), z: row(2) }
    }
}

impl<const N: usize> Add for Vectors<N> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            x: each(|i| self.x[i] + other.x[i]),
            y: each(|i| self.y[i] + other.y[i]),
            z: each(|i| self.z[i] + other.z[i]),
        }
    }
}

impl<const N: usize> Sub for Vectors<N> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            x: each(|i| self.x[i] - other.x[i]),
            y: each(|i| self.y[i] - other.y[i]),
            z: each(|i| self.z[i] - other.z[i]),
        }
    }
}

impl<const N: usize> Mul<[f64; N]> for Vectors<N> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, factors: [f64; N]) -> Self {
        Self {
            x: each(|i| self.x[i] * factors[i]),
            y: each(|i| self.y[i] * factors[i]),
            z: each(|i| self.z[i] * factors[i]),
        }
    }
}

pub(crate) trait Lanewise: Sized {
    type Output;

    /// Does the work with the instruction set of `simd`. Implementations are `#[inline(always)]`:
    /// otherwise they are not compiled for each instruction set.
    fn run<S: Simd>(self, simd: S) -> Self::Output;
}

/// Does `work` with the widest vectors of the processor.
pub(crate) fn widest<W: Lanewise>(work: W) -> W::Output {
    run_at(Level::new(), work)
}

pub(crate) fn run_at<W: Lanewise>(level: Level, work: W) -> W::Output {
    dispatch!(level, simd => work.run(simd))
}
