//! A front end as a look-up table: a perceptron that takes three coordinates,
//! sampled at the nodes of a lattice and interpolated between them (Sekikawa
//! and Suzuki, "Tabulated MLP for fast point feature embedding", 2019).

use std::array::{from_mut, from_ref};
use std::iter::zip;
use std::ops::Range;

/// Channels that are interpolated at a time: vectors of any kernel divide it.
const BLOCK: usize = 16;

/// What is wrong with a table.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum LatticeError {
    /// There is nothing to interpolate.
    #[error("a lattice of {nodes} nodes an axis and {channels} channels: it needs 2 and 1")]
    TooSmall {
        /// Nodes along an axis.
        nodes: usize,
        /// Channels of a node.
        channels: usize,
    },
    /// The table's length is not that of its shape.
    #[error("a table of {found} elements for [{nodes}, {nodes}, {nodes}, {channels}]")]
    Length {
        /// Nodes along an axis.
        nodes: usize,
        /// Channels of a node.
        channels: usize,
        /// Elements that there are.
        found: usize,
    },
    /// A value is NaN or infinite.
    #[error("element {0} of the table is not finite")]
    NotFinite(usize),
}

/// Features of all points of the cube from -1 to 1.
///
/// ```
/// use infer_cpu::sampler::Lattice;
///
/// // One channel, the sum of the coordinates, which interpolation meets.
/// let lattice = Lattice::tabulate(3, 1, |points, features| {
///     for (feature, [x, y, z]) in features.iter_mut().zip(points) {
///         *feature = x + y + z;
///     }
/// })?;
/// let (mut maximum, mut winner) = ([f32::NEG_INFINITY], [0]);
/// lattice.max(&[[0.5, -0.5, 0.0], [0.25, 0.5, 0.5]], &mut maximum, &mut winner, 0..1);
/// assert_eq!((maximum, winner), ([1.25], [1]));
/// # Ok::<(), infer_cpu::sampler::LatticeError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Lattice {
    nodes: usize,
    channels: usize,
    /// `[nodes, nodes, nodes, channels]`: along x, y, z.
    table: Vec<f32>,
}

impl Lattice {
    /// A lattice of `nodes` nodes an axis, both ends of the cube among them.
    ///
    /// # Errors
    /// Fewer than 2 nodes, no channel, a table of another length than its
    /// shape's, a value that is not finite.
    pub fn new(nodes: usize, channels: usize, table: Vec<f32>) -> Result<Self, LatticeError> {
        if nodes < 2 || channels == 0 {
            return Err(LatticeError::TooSmall { nodes, channels });
        }
        let length = nodes.checked_pow(3).and_then(|n| n.checked_mul(channels));
        if length != Some(table.len()) {
            return Err(LatticeError::Length { nodes, channels, found: table.len() });
        }
        match table.iter().position(|value| !value.is_finite()) {
            Some(element) => Err(LatticeError::NotFinite(element)),
            None => Ok(Self { nodes, channels, table }),
        }
    }

    /// Samples `mlp` at the nodes. It is given points, `[n, 3]`, and writes
    /// their features, `[n, channels]`.
    ///
    /// # Errors
    /// As [`Lattice::new`].
    pub fn tabulate(
        nodes: usize,
        channels: usize,
        mut mlp: impl FnMut(&[[f32; 3]], &mut [f32]),
    ) -> Result<Self, LatticeError> {
        if nodes < 2 || channels == 0 {
            return Err(LatticeError::TooSmall { nodes, channels });
        }
        let length = nodes.checked_pow(3).and_then(|n| n.checked_mul(channels));
        let length = length.ok_or(LatticeError::Length { nodes, channels, found: 0 })?;
        let at = |node: usize| (node as f64 / (nodes - 1) as f64 * 2.0 - 1.0) as f32;
        let mut table = vec![0.0; length];
        let mut points = Vec::with_capacity(nodes * nodes);
        for (x, slab) in table.chunks_exact_mut(nodes * nodes * channels).enumerate() {
            points.clear();
            points.extend((0..nodes * nodes).map(|i| [at(x), at(i / nodes), at(i % nodes)]));
            mlp(&points, slab);
        }
        Self::new(nodes, channels, table)
    }

    /// Nodes along an axis.
    #[must_use]
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Features of a point.
    #[must_use]
    pub fn channels(&self) -> usize {
        self.channels
    }

    /// Raises each of `maxima` (one a channel of the range) to the largest
    /// value of its channel over `points`, and remembers in `winners` the row
    /// that raised it last. Of equal rows the first wins; NaN raises nothing.
    ///
    /// Values are interpolated along all three axes. A point outside of the
    /// cube counts as the nearest point of the cube.
    ///
    /// # Panics
    /// If the range goes beyond the channels, or `maxima` or `winners` are not
    /// as long as it.
    pub fn max(
        &self,
        points: &[[f32; 3]],
        maxima: &mut [f32],
        winners: &mut [u32],
        channels: Range<usize>,
    ) {
        assert!(channels.end <= self.channels, "the lattice has fewer channels");
        assert_eq!((maxima.len(), winners.len()), (channels.len(), channels.len()));
        let (maxima, last_maxima) = maxima.as_chunks_mut::<BLOCK>();
        let (winners, last_winners) = winners.as_chunks_mut::<BLOCK>();
        let n_blocks = maxima.len();
        for (row, point) in points.iter().enumerate() {
            let row = row as u32;
            let (corners, weights) = self.cell(point);
            let corners =
                corners.map(|corner| self.table[corner..][channels.clone()].as_chunks::<BLOCK>());
            // All of one length, so that no index below is checked.
            let blocks = corners.map(|(blocks, _)| &blocks[..n_blocks]);
            for i in 0..n_blocks {
                let values = blocks.map(|blocks| &blocks[i]);
                raise(&mut maxima[i], &mut winners[i], values, &weights, row);
            }
            for (i, (maximum, winner)) in zip(&mut *last_maxima, &mut *last_winners).enumerate() {
                let values = corners.map(|(_, last)| from_ref(&last[i]));
                raise(from_mut(maximum), from_mut(winner), values, &weights, row);
            }
        }
    }

    /// Where the eight nodes around a point begin in the table, and how much
    /// they weigh.
    fn cell(&self, point: &[f32; 3]) -> ([usize; 8], [f32; 8]) {
        let n_cells = self.nodes - 1;
        let from_low = point.map(|x| (x.clamp(-1.0, 1.0) + 1.0) * 0.5 * n_cells as f32);
        let low = from_low.map(|edges| (edges as usize).min(n_cells - 1));
        let weights = [0, 1, 2].map(|axis| {
            let high = from_low[axis] - low[axis] as f32;
            [1.0 - high, high]
        });
        let (mut corners, mut corner_weights) = ([0; 8], [0.0; 8]);
        for corner in 0..8 {
            let [x, y, z] = [corner >> 2, corner >> 1 & 1, corner & 1];
            let node = ((low[0] + x) * self.nodes + low[1] + y) * self.nodes + low[2] + z;
            corners[corner] = node * self.channels;
            corner_weights[corner] = weights[0][x] * weights[1][y] * weights[2][z];
        }
        (corners, corner_weights)
    }
}

/// Raises the maxima of `N` channels to their interpolated values.
fn raise<const N: usize>(
    maxima: &mut [f32; N],
    winners: &mut [u32; N],
    values: [&[f32; N]; 8],
    weights: &[f32; 8],
    row: u32,
) {
    for channel in 0..N {
        let pair =
            |i: usize| weights[i] * values[i][channel] + weights[i + 1] * values[i + 1][channel];
        let value = (pair(0) + pair(2)) + (pair(4) + pair(6));
        // Without a branch, so that it is vectorised.
        let wins = value > maxima[channel];
        maxima[channel] = if wins { value } else { maxima[channel] };
        winners[channel] = if wins { row } else { winners[channel] };
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::uniform;
    use super::*;
    use formats::rng::StreamKey;
    use proptest::prelude::*;

    /// Values from -4 to 4.
    fn random(nodes: usize, channels: usize, seed: u32) -> Lattice {
        let key = StreamKey::new(0, "lattice", seed);
        let length = nodes.pow(3) * channels;
        let table = (0..length as u64).map(|i| (key.unit(i) * 8.0 - 4.0) as f32).collect();
        Lattice::new(nodes, channels, table).unwrap()
    }

    fn pool(lattice: &Lattice, points: &[[f32; 3]]) -> (Vec<f32>, Vec<u32>) {
        let n = lattice.channels();
        let (mut maxima, mut winners) = (vec![f32::NEG_INFINITY; n], vec![u32::MAX; n]);
        lattice.max(points, &mut maxima, &mut winners, 0..n);
        (maxima, winners)
    }

    /// The value of one channel at one point, in f64, axis by axis.
    fn twin(lattice: &Lattice, point: &[f32; 3], channel: usize) -> f64 {
        let n = lattice.nodes;
        let edges = point.map(|x| (f64::from(x).clamp(-1.0, 1.0) + 1.0) / 2.0 * (n - 1) as f64);
        let low = edges.map(|edges| (edges as usize).min(n - 2));
        let mix = |axis: usize, a: f64, b: f64| {
            let high = edges[axis] - low[axis] as f64;
            a * (1.0 - high) + b * high
        };
        let at = |x, y, z| {
            let node = ((low[0] + x) * n + low[1] + y) * n + low[2] + z;
            f64::from(lattice.table[node * lattice.channels + channel])
        };
        let along_z = |x, y| mix(2, at(x, y, 0), at(x, y, 1));
        let along_y = |x| mix(1, along_z(x, 0), along_z(x, 1));
        mix(0, along_y(0), along_y(1))
    }

    /// With u = 2^-24 and values of at most T: edges from the low end, up to
    /// n - 1, are rounded twice, so off by 2u(n - 1), and so is the share of
    /// two nodes that differ by at most 2T, along three axes. A weight is
    /// rounded three times, its product once, the sum three times; one u more
    /// for terms of higher order.
    fn tolerance(lattice: &Lattice, largest: f64) -> f64 {
        (12.0 * (lattice.nodes - 1) as f64 + 8.0) * 2f64.powi(-24) * largest
    }

    #[test]
    fn values_are_those_of_the_f64_twin() {
        for (nodes, channels) in [(2, 1), (3, 15), (4, 16), (5, 17), (8, 40), (33, 3)] {
            let lattice = random(nodes, channels, 1);
            for point in uniform(200, 2) {
                let point = point.map(|x| x * 1.2);
                let (maxima, winners) = pool(&lattice, &[point]);
                for (channel, &maximum) in maxima.iter().enumerate() {
                    let expected = twin(&lattice, &point, channel);
                    let error = (f64::from(maximum) - expected).abs();
                    assert!(error <= tolerance(&lattice, 4.0), "{maximum} for {expected}");
                }
                assert_eq!(winners, vec![0; channels]);
            }
        }
    }

    /// x, y, z, their products and a constant are what trilinear interpolation
    /// keeps; values are at most 1.
    #[test]
    fn a_trilinear_function_survives_tabulation() {
        let features = |[x, y, z]: [f32; 3]| [x, y, z, x * y, y * z, z * x, x * y * z, 0.5];
        let lattice = Lattice::tabulate(5, 8, |points, out| {
            for (point, out) in points.iter().zip(out.as_chunks_mut().0) {
                *out = features(*point);
            }
        });
        let lattice = lattice.unwrap();
        // At nodes, coordinates and products are multiples of 1/8: exact. Here
        // the products of the expectation are rounded twice.
        let tolerance = tolerance(&lattice, 1.0) as f32 + 2.0 * f32::EPSILON;
        for point in uniform(500, 3) {
            let (maxima, _) = pool(&lattice, &[point]);
            for (found, expected) in maxima.iter().zip(features(point)) {
                assert!((found - expected).abs() <= tolerance, "{found} for {expected}");
            }
        }
    }

    #[test]
    fn nodes_lie_along_x_then_y_then_z() {
        let lattice = Lattice::new(2, 1, (0..8u8).map(f32::from).collect()).unwrap();
        for (point, value) in [([-1.0; 3], 0.0), ([-1.0, -1.0, 1.0], 1.0), ([1.0, -1.0, -1.0], 4.0)]
        {
            assert_eq!(pool(&lattice, &[point]).0, [value]);
        }
        assert_eq!(pool(&lattice, &[[0.0; 3]]).0, [3.5]);
    }

    #[test]
    fn a_point_outside_counts_as_the_nearest_inside() {
        let lattice = random(4, 20, 5);
        for (outside, inside) in [
            ([1e30, -1e30, 0.25], [1.0, -1.0, 0.25]),
            ([f32::INFINITY, 0.0, -1.5], [1.0, 0.0, -1.0]),
            ([1e9, 1e-30, -1e-30], [1.0, 0.0, 0.0]),
        ] {
            assert_eq!(pool(&lattice, &[outside]), pool(&lattice, &[inside]));
        }
    }

    #[test]
    fn the_first_of_equal_rows_wins_and_nan_never() {
        let lattice = random(3, 33, 6);
        let point = [0.3, -0.2, 0.9];
        let points = [[f32::NAN, 0.0, 0.0], point, point];
        let (maxima, winners) = pool(&lattice, &points);
        assert_eq!((maxima, winners), (pool(&lattice, &[point]).0, vec![1; 33]));
        let (maxima, winners) = pool(&lattice, &[]);
        assert_eq!((maxima, winners), (vec![f32::NEG_INFINITY; 33], vec![u32::MAX; 33]));
    }

    #[test]
    fn a_table_that_cannot_be_one_is_an_error() {
        let error = |nodes, channels, table| Lattice::new(nodes, channels, table).unwrap_err();
        assert_eq!(error(1, 3, vec![0.0; 3]), LatticeError::TooSmall { nodes: 1, channels: 3 });
        assert_eq!(error(2, 0, vec![]), LatticeError::TooSmall { nodes: 2, channels: 0 });
        let length = LatticeError::Length { nodes: 2, channels: 2, found: 15 };
        assert_eq!(error(2, 2, vec![0.0; 15]), length);
        let length = LatticeError::Length { nodes: usize::MAX, channels: 2, found: 0 };
        assert_eq!(error(usize::MAX, 2, vec![]), length);
        assert_eq!(Lattice::tabulate(usize::MAX, 2, |_, _| {}), Err(length));
        let mut table = vec![0.0; 16];
        table[5] = f32::NAN;
        assert_eq!(error(2, 2, table), LatticeError::NotFinite(5));
    }

    proptest! {
        #[test]
        fn a_range_of_channels_is_that_part_of_all(
            begin in 0usize..40, end in 0usize..40, n in 0usize..20,
        ) {
            let lattice = random(3, 40, 7);
            let range = begin.min(end)..begin.max(end);
            let points = uniform(n, 8);
            let (all_maxima, all_winners) = pool(&lattice, &points);
            let mut maxima = vec![f32::NEG_INFINITY; range.len()];
            let mut winners = vec![u32::MAX; range.len()];
            lattice.max(&points, &mut maxima, &mut winners, range.clone());
            prop_assert_eq!(&maxima, &all_maxima[range.clone()]);
            prop_assert_eq!(&winners, &all_winners[range]);
        }

        #[test]
        fn the_maximum_is_that_of_single_points(n in 1usize..30, seed in any::<u32>()) {
            let lattice = random(4, 18, 9);
            let points = uniform(n, seed);
            let (maxima, winners) = pool(&lattice, &points);
            let single: Vec<_> = points.iter().map(|&point| pool(&lattice, &[point]).0).collect();
            for channel in 0..18 {
                let values = single.iter().map(|values| values[channel]);
                let largest = values.clone().fold(f32::NEG_INFINITY, f32::max);
                let first = values.clone().position(|value| value == largest);
                prop_assert_eq!(maxima[channel], largest);
                prop_assert_eq!(Some(winners[channel] as usize), first);
            }
        }
    }
}
