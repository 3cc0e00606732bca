//! Features of a point's neighborhood: an EdgeConv (Wang et al. 2019, *Dynamic Graph CNN*, equation
//! 8 with features of coordinates' differences alone) before the trunk's first layer.
//!
//! For each radius r and channel, the feature of a point p of the cloud C is
//!
//! ```text
//! max over q in C, |q - p| <= r, of relu(w (q - p) / r + b)
//! ```
//!
//! the extent of the neighborhood in a learnt direction. It distinguishes an edge, a plate and a
//! rod where a few sampled points do not. Neighbours are taken from the whole cloud, not from the
//! sampled points alone. p is its own neighbour, so that the maximum always exists. The feature
//! depends neither on the order of points nor on repetitions.
//!
//! The code computes `relu(max(w q / r) - w p / r + b)`, which is equal up to rounding: each
//! neighbour then costs a maximum instead of a product. Products are computed for one tile of the
//! cloud at a time, which stays in the first-level cache, and are shared by all points of a block.

use std::ops::Range;

use crate::Dense;
use crate::neighborhood::{LANES, Lanes, Neighborhood, TILE, Tile, bits, product, raise, within};

/// The layers of all radii.
#[derive(Clone, Debug, Default)]
pub struct EdgeConv {
    /// The widest first.
    layers: Vec<EdgeLayer>,
    /// The weights of x, y and z of all layers, divided by the radius.
    weights: Vec<[Lanes; 3]>,
    bias: Vec<Lanes>,
}

#[derive(Clone, Debug)]
struct EdgeLayer {
    squared_radius: f32,
    /// The range of its features among those of all layers.
    features: Range<usize>,
    /// The range of its weights among those of all layers.
    lanes: Range<usize>,
}

/// Working memory for the features of a block.
#[derive(Clone, Debug, Default)]
pub struct EdgeScratch {
    /// The products of a tile's points and the weights.
    products: Vec<[Lanes; TILE]>,
    /// The maxima of a block, point by point.
    maxima: Vec<Lanes>,
}

impl EdgeConv {
    /// Layers of `[channels, 3]` each, with their radii.
    pub fn new(layers: &[(f32, Dense)]) -> Self {
        let mut edges = Self::default();
        let mut first = 0;
        for (radius, dense) in layers {
            let padded = |c: usize, value: &dyn Fn(usize) -> f32| -> Lanes {
                std::array::from_fn(|i| if c + i < dense.outputs { value(c + i) } else { 0.0 })
            };
            let from = edges.bias.len();
            for c in (0..dense.outputs).step_by(LANES) {
                edges.weights.push([0, 1, 2].map(|k| padded(c, &|c| dense.at(k, c) / radius)));
                edges.bias.push(padded(c, &|c| dense.bias[c]));
            }
            let features = first..first + dense.outputs;
            first = features.end;
            let (squared_radius, lanes) = (radius * radius, from..edges.bias.len());
            edges.layers.push(EdgeLayer { squared_radius, features, lanes });
        }
        edges.layers.sort_by(|a, b| b.squared_radius.total_cmp(&a.squared_radius));
        edges
    }

    /// Whether there is no layer.
    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }

    /// Working memory for blocks of up to `n` points.
    pub fn scratch(&self, n: usize) -> EdgeScratch {
        EdgeScratch {
            products: vec![[[0.0; LANES]; TILE]; self.bias.len()],
            maxima: vec![[0.0; LANES]; n * self.bias.len()],
        }
    }

    /// Writes the features of the points in `rows` `[points, stride]` behind their coordinates,
    /// layer by layer in the order of construction. Kernels call this function, so that it is
    /// compiled for their instruction sets.
    #[inline(always)]
    pub fn features<const FUSED: bool>(
        &self,
        (rows, stride): (&mut [f32], usize),
        cloud: &Neighborhood,
        scratch: &mut EdgeScratch,
    ) {
        if self.is_empty() {
            return;
        }
        let of_point = self.bias.len();
        let maxima = scratch.maxima.chunks_exact_mut(of_point);
        for (row, maxima) in rows.chunks_exact(stride).zip(maxima) {
            // Each point is its own neighbour.
            for (most, weights) in maxima.iter_mut().zip(&self.weights) {
                *most = product::<FUSED, LANES>(weights.each_ref(), [row[0], row[1], row[2]]);
            }
        }
        for tile in cloud.tiles() {
            self.raise_all::<FUSED>(&tile, rows.chunks_exact(stride), scratch);
        }
        let maxima = scratch.maxima.chunks_exact(of_point);
        for (row, maxima) in rows.chunks_exact_mut(stride).zip(maxima) {
            self.finish::<FUSED>(maxima, row);
        }
    }

    /// Raises the maxima of the points of `rows` to the products of their neighbours in `tile`.
    #[inline(always)]
    fn raise_all<'a, const FUSED: bool>(
        &self,
        tile: &Tile<'_>,
        rows: impl Iterator<Item = &'a [f32]>,
        scratch: &mut EdgeScratch,
    ) {
        let EdgeScratch { products, maxima } = scratch;
        let mut projected = 0;
        for (row, maxima) in rows.zip(maxima.chunks_exact_mut(self.bias.len())) {
            let squared = tile.squared_distances([row[0], row[1], row[2]]);
            for EdgeLayer { squared_radius, lanes, .. } in &self.layers {
                let near = within(&squared, *squared_radius);
                if near == 0 {
                    break;
                }
                if near & !projected != 0 {
                    self.project::<FUSED>(tile, near & !projected, products);
                    projected |= near;
                }
                for i in lanes.clone() {
                    raise(&mut maxima[i], &products[i], near);
                }
            }
        }
    }

    /// Computes the products of all weights and the tile's points whose bits are set in `points`.
    #[inline(always)]
    fn project<const FUSED: bool>(
        &self,
        tile: &Tile<'_>,
        points: u64,
        products: &mut [[Lanes; TILE]],
    ) {
        for (products, weights) in products.iter_mut().zip(&self.weights) {
            // Half the channels at a time, so that their weights stay in registers.
            let halves = weights.each_ref().map(|weights| weights.as_chunks::<{ LANES / 2 }>().0);
            for half in 0..2 {
                let weights = halves.map(|halves| &halves[half]);
                for i in bits(points) {
                    let (halves, _) = products[i].as_chunks_mut();
                    let point = [tile.x[i], tile.y[i], tile.z[i]];
                    halves[half] = product::<FUSED, { LANES / 2 }>(weights, point);
                }
            }
        }
    }

    /// Writes the features of the point of `row` from its maxima. If its own product overflows f32,
    /// the extent is 0.
    #[inline(always)]
    fn finish<const FUSED: bool>(&self, maxima: &[Lanes], row: &mut [f32]) {
        let (centre, out) = row.split_at_mut(3);
        for EdgeLayer { features, lanes, .. } in &self.layers {
            for (i, out) in lanes.clone().zip(out[features.clone()].chunks_mut(LANES)) {
                let centre = [centre[0], centre[1], centre[2]];
                let own = product::<FUSED, LANES>(self.weights[i].each_ref(), centre);
                let extents = maxima[i].iter().zip(&own).map(|(most, own)| (most - own).max(0.0));
                for (out, (extent, bias)) in out.iter_mut().zip(extents.zip(&self.bias[i])) {
                    *out = (extent + bias).max(0.0);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use formats::rng::StreamKey;

    use super::*;

    fn dense(outputs: usize, seed: u64) -> Dense {
        let key = StreamKey::new(seed, "edge test", 0);
        let value = |i: usize| (2.0 * key.unit(i as u64) - 1.0) as f32;
        Dense {
            name: "edge.conv1".to_owned(),
            inputs: 3,
            outputs,
            weight: (0..3 * outputs).map(value).collect(),
            bias: (0..outputs).map(|c| 0.1 * value(1000 + c)).collect(),
            relu: true,
        }
    }

    fn cloud(n: usize) -> Vec<[f32; 3]> {
        let key = StreamKey::new(7, "edge cloud", 0);
        (0..n).map(|i| [0, 1, 2].map(|k| key.unit((3 * i + k) as u64) as f32)).collect()
    }

    /// The definition, in f64.
    fn twin(layers: &[(f32, Dense)], p: [f32; 3], cloud: &[[f32; 3]]) -> Vec<f64> {
        let mut features = Vec::new();
        for (radius, dense) in layers {
            for c in 0..dense.outputs {
                let response = |q: &[f32; 3]| {
                    let along = |k: usize| f64::from(dense.at(k, c)) * f64::from(q[k] - p[k]);
                    let product = (0..3).map(along).sum::<f64>() / f64::from(*radius);
                    (product + f64::from(dense.bias[c])).max(0.0)
                };
                let near = |q: &&[f32; 3]| {
                    let squared: f32 = (0..3).map(|k| (q[k] - p[k]) * (q[k] - p[k])).sum();
                    squared <= radius * radius
                };
                features.push(cloud.iter().filter(near).map(response).fold(0.0, f64::max));
            }
        }
        features
    }

    fn features(edges: &EdgeConv, p: [f32; 3], cloud: &[[f32; 3]], n: usize) -> Vec<f32> {
        let mut neighborhood = Neighborhood::default();
        neighborhood.set(cloud);
        // Two padded rows, to show that neighbouring rows do not mix.
        let mut rows = vec![f32::NAN; 2 * (n + 5)];
        rows[..3].copy_from_slice(&cloud[0]);
        rows[n + 5..n + 8].copy_from_slice(&p);
        edges.features::<false>((&mut rows, n + 5), &neighborhood, &mut edges.scratch(2));
        rows[n + 8..][..n].to_vec()
    }

    #[test]
    fn features_are_those_of_the_definition() {
        let layers = [(0.2, dense(5, 1)), (0.6, dense(3, 2))];
        let edges = EdgeConv::new(&layers);
        for n in [1, 2, 63, 64, 65, 500] {
            let cloud = cloud(n);
            let found = features(&edges, cloud[n / 2], &cloud, 8);
            for (found, truth) in found.iter().zip(twin(&layers, cloud[n / 2], &cloud)) {
                // In units u = EPSILON / 2: weights are at most 1, over the radius at most 5 and
                // off by 5u, coordinates at most 1. A product of three with its sums is off by 4 *
                // 15u, the difference of two by 120u and its own rounding, 15u; the bias adds 15u.
                let bound = 150.0 * f64::from(f32::EPSILON) / 2.0;
                assert!((f64::from(*found) - truth).abs() <= bound, "{found}, {truth}, n {n}");
            }
        }
    }

    #[test]
    fn neither_order_nor_repetitions_count() {
        let edges = EdgeConv::new(&[(0.3, dense(16, 3))]);
        let cloud = cloud(200);
        let expected = features(&edges, cloud[0], &cloud, 16);
        let mut other = [cloud.clone(), cloud.clone()].concat();
        other.reverse();
        assert_eq!(features(&edges, cloud[0], &other, 16), expected);
    }

    #[test]
    fn far_and_huge_points_are_no_neighbours() {
        let edges = EdgeConv::new(&[(0.3, dense(4, 3))]);
        let alone = features(&edges, [0.0; 3], &[[0.0; 3]], 4);
        let crowd = [[0.0; 3], [f32::MAX, 0.0, 0.0], [0.0, -1e30, 0.0], [0.301, 0.0, 0.0]];
        assert_eq!(features(&edges, [0.0; 3], &crowd, 4), alone);
    }
}
