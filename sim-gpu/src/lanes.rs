//! Vectors in f64, one in each lane: plain loops that the compiler vectorizes, for AVX2 or AVX-512
//! if [`widest`] finds them. Each lane equals the result of glam for one vector to the bit.

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

/// `N` vectors.
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

    /// Each vector mapped by `map`.
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

/// The proof that the processor has AVX2 and what came with it.
#[derive(Clone, Copy)]
pub(crate) struct Avx2(());

/// Work on lanes.
pub(crate) trait Lanewise: Sized {
    /// What it gives.
    type Output;

    /// Does the work, with AVX2 at hand if there is any; must be `#[inline(always)]`, or it
    /// is not compiled anew for wider vectors.
    fn run(self, avx2: Option<Avx2>) -> Self::Output;
}

/// A way of doing work: what it is compiled for, and a function that does it.
pub(crate) type Way<W> = (&'static str, fn(W) -> <W as Lanewise>::Output);

/// The ways of doing work that this processor has, that of the widest vectors first.
pub(crate) fn ways<W: Lanewise>() -> impl Iterator<Item = Way<W>> {
    #[cfg(target_arch = "x86_64")]
    let wide = {
        #[target_feature(enable = "avx512f,avx512vl,avx512dq,avx512bw")]
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn avx512<W: Lanewise>(work: W) -> W::Output {
            work.run(Some(Avx2(())))
        }
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn avx2<W: Lanewise>(work: W) -> W::Output {
            work.run(Some(Avx2(())))
        }
        // SAFETY: the way is given out only if the processor has the instructions.
        let avx512: Way<W> = ("AVX-512", |work| unsafe { avx512(work) });
        // SAFETY: as above.
        let avx2: Way<W> = ("AVX2", |work| unsafe { avx2(work) });
        [has_avx512().then_some(avx512), has_avx2().then_some(avx2)]
    };
    #[cfg(not(target_arch = "x86_64"))]
    let wide: [Option<Way<W>>; 0] = [];
    let portable: Way<W> = ("portable", |work| work.run(None));
    wide.into_iter().flatten().chain([portable])
}

/// Does `work` with the widest vectors that the processor has.
pub(crate) fn widest<W: Lanewise>(work: W) -> W::Output {
    let (_, way) = ways().next().expect("invariant: the portable way is always there");
    way(work)
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("lzcnt")
        && is_x86_feature_detected!("popcnt")
}

#[cfg(target_arch = "x86_64")]
fn has_avx512() -> bool {
    has_avx2()
        && is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512dq")
        && is_x86_feature_detected!("avx512bw")
}
