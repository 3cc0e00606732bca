//! The pooling of a separable set abstraction (Qian et al. 2021, "ASSANet"): features of the
//! neighborhood of a centre.
//!
//! With the features u of the points, a centre p, the points q within the radius r of it, and
//! channel c, the feature is
//!
//! ```text
//! max over q of relu(a_c u_qc + v_c (q - p) / r + b_c)
//! ```
//!
//! The code computes `relu(max(a_c u_qc + v_c q / r) - v_c p / r + b_c)`, which is equal up to
//! rounding. The products of a point are the same for all centres, and are computed once
//! ([`PoolStep::Lift`]); a neighbour then costs a maximum ([`PoolStep::Raise`]). Everything is in
//! fp32, whatever the network's format. A centre is one of the points, so that the maximum always
//! exists. The feature depends on the order of points in no way.

use std::ops::Range;

use crate::Dense;
use crate::neighborhood::{LANES, Lanes, TILE, Tile, product, raise, within};

/// The weights of a pooling.
#[derive(Clone, Debug)]
pub struct NeighborPool {
    squared_radius: f32,
    /// The weights of the feature, and of x, y and z, divided by the radius.
    weights: Vec<[Lanes; 4]>,
    bias: Vec<Lanes>,
}

/// A part of a pooling.
pub enum PoolStep<'a> {
    /// Writes the products of the points `points` of `tile`, whose features are the rows of
    /// `features`, `[points, stride]`.
    Lift {
        /// The rows, and the distance from one to the next.
        features: (&'a [f32], usize),
        /// The points.
        tile: Tile<'a>,
        /// Which of them have features.
        points: Range<usize>,
        /// The products of a tile, for each [`LANES`] channels.
        products: &'a mut [[Lanes; TILE]],
    },
    /// Raises the maxima of `centres` to the products of their neighbours in `tile`.
    Raise {
        /// The points.
        tile: Tile<'a>,
        /// Their products.
        products: &'a [[Lanes; TILE]],
        /// The centres.
        centres: &'a [[f32; 3]],
        /// Their maxima, centre by centre.
        maxima: &'a mut [Lanes],
    },
    /// Writes the features of `centres` to the rows of `out`, `[centres, stride]`; what is beyond
    /// the channels becomes 0.
    Finish {
        /// The centres.
        centres: &'a [[f32; 3]],
        /// Their maxima, centre by centre.
        maxima: &'a [Lanes],
        /// The rows, and the distance from one to the next.
        out: (&'a mut [f32], usize),
    },
}

impl NeighborPool {
    /// A pooling within `radius` with the weights of `dense`, whose inputs are the feature of a
    /// channel, x, y and z.
    pub fn new(radius: f32, dense: &Dense) -> Self {
        let lanes = |first: usize, value: &dyn Fn(usize) -> f32| -> Lanes {
            std::array::from_fn(|i| if first + i < dense.outputs { value(first + i) } else { 0.0 })
        };
        let weight = |k: usize, c: usize| match k {
            0 => dense.at(0, c),
            _ => dense.at(k, c) / radius,
        };
        let groups = || (0..dense.outputs).step_by(LANES);
        Self {
            squared_radius: radius * radius,
            weights: groups()
                .map(|first| [0, 1, 2, 3].map(|k| lanes(first, &|c| weight(k, c))))
                .collect(),
            bias: groups().map(|first| lanes(first, &|c| dense.bias[c])).collect(),
        }
    }

    /// The number of [`Lanes`] of a point.
    pub fn n_lanes(&self) -> usize {
        self.bias.len()
    }

    /// Does `step`. Kernels call this function, so that it is compiled for their instruction sets.
    #[inline(always)]
    pub fn run<const FUSED: bool>(&self, step: PoolStep<'_>) {
        match step {
            PoolStep::Lift { features: (features, stride), tile, points, products } => {
                for (features, i) in features.chunks_exact(stride).zip(points) {
                    self.lift::<FUSED>(features, (&tile, i), products);
                }
            }
            PoolStep::Raise { tile, products, centres, maxima } => {
                let (least, most) = ends(tile.x);
                for (centre, maxima) in centres.iter().zip(maxima.chunks_exact_mut(self.n_lanes()))
                {
                    // Points come sorted by x, so that most tiles are far from most centres. The
                    // bound is at most the distances below, since rounding keeps the order.
                    let gap = (least - centre[0]).max(centre[0] - most).max(0.0);
                    if gap * gap > self.squared_radius {
                        continue;
                    }
                    let near = within(&tile.squared_distances(*centre), self.squared_radius);
                    if near != 0 {
                        for (most, products) in maxima.iter_mut().zip(products) {
                            raise(most, products, near);
                        }
                    }
                }
            }
            PoolStep::Finish { centres, maxima, out: (out, stride) } => {
                let rows = out.chunks_exact_mut(stride).zip(maxima.chunks_exact(self.n_lanes()));
                for (centre, (row, maxima)) in centres.iter().zip(rows) {
                    self.finish::<FUSED>(*centre, maxima, row);
                }
            }
        }
    }

    #[inline(always)]
    fn lift<const FUSED: bool>(
        &self,
        features: &[f32],
        (tile, i): (&Tile<'_>, usize),
        products: &mut [[Lanes; TILE]],
    ) {
        let point = [tile.x[i], tile.y[i], tile.z[i]];
        let features = features.as_chunks::<LANES>().0;
        for ((weights, products), features) in self.weights.iter().zip(products).zip(features) {
            let [own, axes @ ..] = weights.each_ref();
            let along = product::<FUSED, LANES>(axes, point);
            // A store of all channels at once, which the compiler vectorises.
            products[i] = std::array::from_fn(|c| own[c] * features[c] + along[c]);
        }
    }

    #[inline(always)]
    fn finish<const FUSED: bool>(&self, centre: [f32; 3], maxima: &[Lanes], row: &mut [f32]) {
        let (whole, rest) = row.as_chunks_mut::<LANES>();
        rest.fill(0.0);
        let (whole, padding) = whole.split_at_mut(self.n_lanes());
        padding.fill([0.0; LANES]);
        for (((weights, bias), most), out) in
            self.weights.iter().zip(&self.bias).zip(maxima).zip(whole)
        {
            let [_, axes @ ..] = weights.each_ref();
            let along = product::<FUSED, LANES>(axes, centre);
            *out = std::array::from_fn(|c| (most[c] - along[c] + bias[c]).max(0.0));
        }
    }
}

/// The least and the greatest of a tile's coordinates.
#[inline(always)]
fn ends(of: &[f32; TILE]) -> (f32, f32) {
    let (mut least, mut most) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    for part in of.as_chunks::<LANES>().0 {
        least = std::array::from_fn(|i| least[i].min(part[i]));
        most = std::array::from_fn(|i| most[i].max(part[i]));
    }
    let (least, most) = (least.into_iter(), most.into_iter());
    (least.fold(f32::INFINITY, f32::min), most.fold(f32::NEG_INFINITY, f32::max))
}
