//! Features of a point's neighborhood: an EdgeConv (Wang et al. 2019, *Dynamic Graph CNN*,
//! equation 8 with features of coordinates' differences alone) before the
//! trunk's first layer.
//!
//! A point p of the cloud C gets, for each radius r and channel, beside its
//! coordinates,
//!
//! ```text
//! max over q in C, |q - p| <= r, of relu(w (q - p) / r + b)
//! ```
//!
//! the extent of its neighborhood in a direction that was learnt: an edge, a
//! plate and a rod differ in it where a few sampled points do not. Neighbours
//! are taken from all points, kept by the sampler or not. p is its own
//! neighbour, so that the maximum is never of nothing. It depends neither on
//! the order of points nor on repetitions. As ReLU keeps order, it is applied
//! once, to the maximum.

use crate::dense::Dense;

/// Points whose distances are found at once.
const TILE: usize = 64;

/// The layers of all radii, the widest first.
#[derive(Clone, Debug, Default)]
pub struct EdgeConv {
    layers: Vec<EdgeLayer>,
}

#[derive(Clone, Debug)]
struct EdgeLayer {
    squared_radius: f32,
    /// Where its channels begin among those of all layers.
    first: usize,
    /// Weights of x, y and z, divided by the radius.
    weights: [Vec<f32>; 3],
    bias: Vec<f32>,
}

/// All points of a cloud, coordinate by coordinate.
#[derive(Clone, Debug, Default)]
pub struct Neighborhood {
    axes: [Vec<f32>; 3],
}

impl Neighborhood {
    /// Makes room for `n` points.
    pub fn reserve(&mut self, n: usize) {
        for axis in &mut self.axes {
            axis.reserve(n.saturating_sub(axis.len()));
        }
    }

    /// Takes `points` in place of what was there.
    pub fn set(&mut self, points: &[[f32; 3]]) {
        for (k, axis) in self.axes.iter_mut().enumerate() {
            axis.clear();
            axis.extend(points.iter().map(|point| point[k]));
        }
    }
}

impl EdgeConv {
    /// Layers of `[channels, 3]` each, with their radii.
    pub fn new(layers: &[(f32, Dense)]) -> Self {
        let mut first = 0;
        let mut layers: Vec<EdgeLayer> = layers
            .iter()
            .map(|(radius, dense)| {
                let of = |k| (0..dense.outputs).map(|c| dense.at(k, c) / radius).collect();
                let layer = EdgeLayer {
                    squared_radius: radius * radius,
                    first,
                    weights: [of(0), of(1), of(2)],
                    bias: dense.bias.clone(),
                };
                first += dense.outputs;
                layer
            })
            .collect();
        layers.sort_by(|a, b| b.squared_radius.total_cmp(&a.squared_radius));
        Self { layers }
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.layers.is_empty()
    }

    /// Writes the features of `centre` into `out`, `[channels]`, in the order
    /// in which layers were given.
    pub fn features(&self, centre: [f32; 3], cloud: &Neighborhood, out: &mut [f32]) {
        // The centre's own: nothing times the weights.
        out.fill(0.0);
        let Some(widest) = self.layers.first() else { return };
        let [xs, ys, zs] = &cloud.axes;
        let mut squared = [0.0; TILE];
        for first in (0..xs.len()).step_by(TILE) {
            let tile = first..xs.len().min(first + TILE);
            let (xs, ys, zs) = (&xs[tile.clone()], &ys[tile.clone()], &zs[tile]);
            for i in 0..xs.len() {
                let (x, y, z) = (xs[i] - centre[0], ys[i] - centre[1], zs[i] - centre[2]);
                squared[i] = x * x + y * y + z * z;
            }
            for i in (0..xs.len()).filter(|&i| squared[i] <= widest.squared_radius) {
                let offset = [xs[i] - centre[0], ys[i] - centre[1], zs[i] - centre[2]];
                let reach = self.layers.iter().take_while(|l| squared[i] <= l.squared_radius);
                reach.for_each(|layer| layer.raise(offset, out));
            }
        }
        self.layers.iter().for_each(|layer| layer.finish(out));
    }
}

impl EdgeLayer {
    fn channels<'a>(&self, out: &'a mut [f32]) -> &'a mut [f32] {
        &mut out[self.first..][..self.bias.len()]
    }

    /// Raises maxima to what a neighbour at `offset` gives.
    fn raise(&self, [x, y, z]: [f32; 3], out: &mut [f32]) {
        let out = self.channels(out);
        let [wx, wy, wz] = &self.weights;
        let weights = wx.iter().zip(wy).zip(wz);
        for (out, ((wx, wy), wz)) in out.iter_mut().zip(weights) {
            let product = wx * x + wy * y + wz * z;
            *out = if product > *out { product } else { *out };
        }
    }

    fn finish(&self, out: &mut [f32]) {
        for (out, bias) in self.channels(out).iter_mut().zip(&self.bias) {
            *out = (*out + bias).max(0.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::rng::StreamKey;

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

    /// The definition, in f64; `near` decides who is a neighbour.
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
        let mut out = vec![f32::NAN; n];
        edges.features(p, &neighborhood, &mut out);
        out
    }

    #[test]
    fn features_are_those_of_the_definition() {
        let layers = [(0.2, dense(5, 1)), (0.6, dense(3, 2))];
        let edges = EdgeConv::new(&layers);
        for n in [1, 2, 63, 64, 65, 500] {
            let cloud = cloud(n);
            let found = features(&edges, cloud[n / 2], &cloud, 8);
            for (found, truth) in found.iter().zip(twin(&layers, cloud[n / 2], &cloud)) {
                // Weights and offsets over the radius are at most 1 each: three
                // products, two sums, a quotient and a bias, each rounded once.
                let bound = 8.0 * f64::from(f32::EPSILON) * 3.1;
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
