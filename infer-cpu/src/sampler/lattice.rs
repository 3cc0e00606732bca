//! A front end as a look-up table: a perceptron that takes three coordinates,
//! sampled at the nodes of a lattice and interpolated between them (Sekikawa
//! and Suzuki, "Tabulated MLP for fast point feature embedding", 2019).

use std::ops::Range;

/// Channels that are interpolated at a time: of a lattice of 8 nodes an axis,
/// they fit into the first cache.
const BLOCK: usize = 16;

/// Points whose cells are found at a time, to be used for all channels.
const POINTS: usize = 256;

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
    /// No memory can hold the table.
    #[error("a lattice of {nodes} nodes an axis and {channels} channels is too large")]
    TooLarge {
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
    /// `[blocks of channels, nodes, nodes, nodes, BLOCK]`, nodes along x, y, z;
    /// zero where the last block has no channel.
    table: Vec<[f32; BLOCK]>,
}

/// Where a point lies.
#[derive(Clone, Copy, Default)]
struct Cell {
    /// The node at the cell's low corner.
    low: usize,
    /// How much each of its eight nodes weighs.
    weights: [f32; 8],
}

impl Lattice {
    /// A lattice of `nodes` nodes an axis, both ends of the cube among them,
    /// from a table `[nodes, nodes, nodes, channels]` along x, y, z.
    ///
    /// # Errors
    /// Fewer than 2 nodes, no channel, a table of another length than its
    /// shape's, a value that is not finite.
    pub fn new(nodes: usize, channels: usize, table: &[f32]) -> Result<Self, LatticeError> {
        let length = table_length(nodes, channels)?;
        if length != table.len() {
            return Err(LatticeError::Length { nodes, channels, found: table.len() });
        }
        if let Some(element) = table.iter().position(|value| !value.is_finite()) {
            return Err(LatticeError::NotFinite(element));
        }
        let n_nodes = length / channels;
        let mut blocks = vec![[0.0; BLOCK]; channels.div_ceil(BLOCK) * n_nodes];
        for (node, values) in table.chunks_exact(channels).enumerate() {
            for (block, values) in values.chunks(BLOCK).enumerate() {
                blocks[block * n_nodes + node][..values.len()].copy_from_slice(values);
            }
        }
        Ok(Self { nodes, channels, table: blocks })
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
        let mut table = vec![0.0; table_length(nodes, channels)?];
        let at = |node: usize| (node as f64 / (nodes - 1) as f64 * 2.0 - 1.0) as f32;
        let mut points = Vec::with_capacity(nodes * nodes);
        for (x, slab) in table.chunks_exact_mut(nodes * nodes * channels).enumerate() {
            points.clear();
            points.extend((0..nodes * nodes).map(|i| [at(x), at(i / nodes), at(i % nodes)]));
            mlp(&points, slab);
        }
        Self::new(nodes, channels, &table)
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
        let mut cells = [Cell::default(); POINTS];
        for (chunk, points) in points.chunks(POINTS).enumerate() {
            let cells = &mut cells[..points.len()];
            cells.iter_mut().zip(points).for_each(|(cell, point)| *cell = self.cell(point));
            let mut channel = channels.start;
            while channel < channels.end {
                let end = (channel / BLOCK + 1) * BLOCK;
                let part = channel - channels.start..end.min(channels.end) - channels.start;
                let first_row = (chunk * POINTS) as u32;
                self.raise(
                    cells,
                    first_row,
                    channel,
                    &mut maxima[part.clone()],
                    &mut winners[part],
                );
                channel = end;
            }
        }
    }

    /// Raises maxima of the channels from `channel` on, all of one block.
    fn raise(
        &self,
        cells: &[Cell],
        first_row: u32,
        channel: usize,
        maxima: &mut [f32],
        winners: &mut [u32],
    ) {
        let n_nodes = self.nodes.pow(3);
        let block = &self.table[channel / BLOCK * n_nodes..][..n_nodes];
        let lanes = channel % BLOCK..channel % BLOCK + maxima.len();
        let (mut largest, mut rows) = ([f32::INFINITY; BLOCK], [0; BLOCK]);
        largest[lanes.clone()].copy_from_slice(maxima);
        rows[lanes.clone()].copy_from_slice(winners);
        for (cell, row) in cells.iter().zip(first_row..) {
            let values = self.interpolate(block, cell);
            for lane in 0..BLOCK {
                // Without a branch, so that it is vectorised.
                let wins = values[lane] > largest[lane];
                largest[lane] = if wins { values[lane] } else { largest[lane] };
                rows[lane] = if wins { row } else { rows[lane] };
            }
        }
        maxima.copy_from_slice(&largest[lanes.clone()]);
        winners.copy_from_slice(&rows[lanes]);
    }

    /// The values of one block of channels.
    fn interpolate(&self, block: &[[f32; BLOCK]], cell: &Cell) -> [f32; BLOCK] {
        let nodes = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| &block[cell.low + self.offset(corner)]);
        let [a, b, c, d, e, f, g, h] = cell.weights;
        let mut values = [0.0; BLOCK];
        for (lane, value) in values.iter_mut().enumerate() {
            let [p, q, r, s, t, u, v, w] = nodes.map(|node| node[lane]);
            let low = multiply_add(d, s, multiply_add(c, r, multiply_add(b, q, a * p)));
            let high = multiply_add(h, w, multiply_add(g, v, multiply_add(f, u, e * t)));
            *value = low + high;
        }
        values
    }

    /// How far a cell's node is from its low one: bits of `corner` are the
    /// steps along x, y, z.
    fn offset(&self, corner: usize) -> usize {
        ((corner >> 2) * self.nodes + (corner >> 1 & 1)) * self.nodes + (corner & 1)
    }

    fn cell(&self, point: &[f32; 3]) -> Cell {
        let n_cells = self.nodes - 1;
        let edges = point.map(|x| (x.clamp(-1.0, 1.0) + 1.0) * 0.5 * n_cells as f32);
        let low = edges.map(|edges| (edges as usize).min(n_cells - 1));
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let high = edges[axis] - low[axis] as f32;
            [1.0 - high, high]
        });
        let weight = |corner: usize| x[corner >> 2] * y[corner >> 1 & 1] * z[corner & 1];
        Cell {
            low: (low[0] * self.nodes + low[1]) * self.nodes + low[2],
            weights: [0, 1, 2, 3, 4, 5, 6, 7].map(weight),
        }
    }
}

/// `a * b + c`, in one step where all machines of the target have it.
fn multiply_add(a: f32, b: f32, c: f32) -> f32 {
    if cfg!(any(target_arch = "aarch64", target_feature = "fma")) {
        a.mul_add(b, c)
    } else {
        a * b + c
    }
}

/// The elements of a table `[nodes, nodes, nodes, channels]`.
fn table_length(nodes: usize, channels: usize) -> Result<usize, LatticeError> {
    if nodes < 2 || channels == 0 {
        return Err(LatticeError::TooSmall { nodes, channels });
    }
    let n_nodes = nodes.checked_pow(3);
    let length = n_nodes.and_then(|n_nodes| n_nodes.checked_mul(channels));
    length
        .filter(|&length| length < isize::MAX as usize / size_of::<f32>())
        .ok_or(LatticeError::TooLarge { nodes, channels })
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
        let table = (0..length as u64).map(|i| (key.unit(i) * 8.0 - 4.0) as f32);
        Lattice::new(nodes, channels, &table.collect::<Vec<_>>()).unwrap()
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
        let at = |x: usize, y: usize, z: usize| {
            let node = ((low[0] + x) * n + low[1] + y) * n + low[2] + z;
            let block: &[f32; BLOCK] = &lattice.table[channel / BLOCK * n.pow(3) + node];
            f64::from(block[channel % BLOCK])
        };
        let along_z = |x, y| mix(2, at(x, y, 0), at(x, y, 1));
        let along_y = |x| mix(1, along_z(x, 0), along_z(x, 1));
        mix(0, along_y(0), along_y(1))
    }

    /// With u = 2^-24 and values of at most T: edges from the low end, up to
    /// n - 1, are rounded twice, so off by 2u(n - 1), and so is the share of
    /// two nodes that differ by at most 2T, along three axes. A weight is
    /// rounded three times, its product once, the sum four times; one u more
    /// for terms of higher order.
    fn tolerance(lattice: &Lattice, largest: f64) -> f64 {
        (12.0 * (lattice.nodes - 1) as f64 + 9.0) * 2f64.powi(-24) * largest
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
        let lattice = Lattice::new(2, 1, &[0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]).unwrap();
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
        let error =
            |nodes, channels, table: &[f32]| Lattice::new(nodes, channels, table).unwrap_err();
        assert_eq!(error(1, 3, &[0.0; 3]), LatticeError::TooSmall { nodes: 1, channels: 3 });
        assert_eq!(error(2, 0, &[]), LatticeError::TooSmall { nodes: 2, channels: 0 });
        let length = LatticeError::Length { nodes: 2, channels: 2, found: 15 };
        assert_eq!(error(2, 2, &[0.0; 15]), length);
        for nodes in [usize::MAX, 1 << 20] {
            let too_large = LatticeError::TooLarge { nodes, channels: 2 };
            assert_eq!(error(nodes, 2, &[]), too_large);
            assert_eq!(Lattice::tabulate(nodes, 2, |_, _| {}), Err(too_large));
        }
        let mut table = vec![0.0; 16];
        table[5] = f32::NAN;
        assert_eq!(error(2, 2, &table), LatticeError::NotFinite(5));
    }

    proptest! {
        #[test]
        fn a_range_of_channels_is_that_part_of_all(
            begin in 0usize..=40, end in 0usize..=40, n in 0usize..20,
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
