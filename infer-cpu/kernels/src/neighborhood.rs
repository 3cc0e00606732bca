//! The points around a point, a tile of the cloud at a time.
//!
//! Layers over neighborhoods compute the products of a tile's points once, while it is in the
//! first-level cache; each neighbour then costs a maximum over channels.

/// Points of a tile.
pub const TILE: usize = 64;
/// Channels whose maxima stay in registers during the loop over neighbours. Layers are padded to
/// multiples of it.
pub const LANES: usize = 32;

/// The numbers of [`LANES`] channels.
pub type Lanes = [f32; LANES];

/// All points of a cloud as one array per coordinate, padded with points at infinity to whole
/// tiles.
#[derive(Clone, Debug, Default)]
pub struct Neighborhood {
    axes: [Vec<f32>; 3],
}

impl Neighborhood {
    /// The neighborhood of `points`.
    #[must_use]
    pub fn of(points: &[[f32; 3]]) -> Self {
        let mut neighborhood = Self::default();
        neighborhood.set(points);
        neighborhood
    }

    /// The points within `radius` of `p`, with their indices.
    pub fn within(&self, p: [f32; 3], radius: f32) -> impl Iterator<Item = (usize, [f32; 3])> {
        self.tiles().enumerate().flat_map(move |(number, tile)| {
            let near = within(&tile.squared_distances(p), radius * radius);
            bits(near).map(move |i| (number * TILE + i, [tile.x[i], tile.y[i], tile.z[i]]))
        })
    }

    /// Allocates memory for `n` points.
    pub fn reserve(&mut self, n: usize) {
        for axis in &mut self.axes {
            axis.reserve(n.next_multiple_of(TILE).saturating_sub(axis.len()));
        }
    }

    /// Replaces the points.
    pub fn set(&mut self, points: &[[f32; 3]]) {
        for (k, axis) in self.axes.iter_mut().enumerate() {
            axis.clear();
            axis.extend(points.iter().map(|point| point[k]));
            axis.resize(points.len().next_multiple_of(TILE), f32::INFINITY);
        }
    }

    /// Tile `number` of the points.
    pub fn tile(&self, number: usize) -> Tile<'_> {
        let [x, y, z] = self.axes.each_ref().map(|axis| &axis.as_chunks().0[number]);
        Tile { x, y, z }
    }

    /// The points, a tile at a time.
    #[inline(always)]
    pub fn tiles(&self) -> impl Iterator<Item = Tile<'_>> {
        let [xs, ys, zs] = self.axes.each_ref().map(|axis| axis.as_chunks().0.iter());
        xs.zip(ys).zip(zs).map(|((x, y), z)| Tile { x, y, z })
    }
}

/// Points of a cloud that are processed together.
#[derive(Clone, Copy)]
pub struct Tile<'a> {
    /// Coordinates along x; those of padding are infinite.
    pub x: &'a [f32; TILE],
    /// Along y.
    pub y: &'a [f32; TILE],
    /// Along z.
    pub z: &'a [f32; TILE],
}

impl Tile<'_> {
    #[inline(always)]
    pub(crate) fn squared_distances(&self, [x, y, z]: [f32; 3]) -> [f32; TILE] {
        let mut squared = [0.0; TILE];
        for (i, squared) in squared.iter_mut().enumerate() {
            let (x, y, z) = (self.x[i] - x, self.y[i] - y, self.z[i] - z);
            *squared = x * x + y * y + z * z;
        }
        squared
    }
}

/// The products of a point and the weights of `N` channels. `FUSED` is for processors with a fused
/// multiply-add; without it, `mul_add` would be a slow library call.
#[inline(always)]
pub(crate) fn product<const FUSED: bool, const N: usize>(
    [wx, wy, wz]: [&[f32; N]; 3],
    [x, y, z]: [f32; 3],
) -> [f32; N] {
    let mut out = [0.0; N];
    for (i, out) in out.iter_mut().enumerate() {
        *out = if FUSED {
            wx[i].mul_add(x, wy[i].mul_add(y, wz[i] * z))
        } else {
            wx[i] * x + (wy[i] * y + wz[i] * z)
        };
    }
    out
}

/// The points of a tile within a radius, one bit each.
#[inline(always)]
pub(crate) fn within(squared: &[f32; TILE], squared_radius: f32) -> u64 {
    /// Moves the lowest bit of byte i to bit 56 + i: the factor has the bits 56 - 7 i.
    const GATHER: u64 = 0x0102_0408_1020_4080;
    let mut is_near = [0; TILE];
    for (is_near, squared) in is_near.iter_mut().zip(squared) {
        *is_near = u8::from(*squared <= squared_radius);
    }
    let (eights, _) = is_near.as_chunks();
    let bits = eights.iter().map(|&eight| u64::from_le_bytes(eight).wrapping_mul(GATHER) >> 56);
    bits.rev().fold(0, |near, bits| near << 8 | bits)
}

/// The positions of the set bits.
#[inline(always)]
pub(crate) fn bits(mut of: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let lowest = of.trailing_zeros() as usize;
        of &= of.wrapping_sub(1);
        (lowest < TILE).then_some(lowest)
    })
}

/// Raises the maxima to the products of the points whose bits are set in `near`.
#[inline(always)]
pub(crate) fn raise(maxima: &mut Lanes, products: &[Lanes; TILE], near: u64) {
    let mut most = *maxima;
    for i in bits(near) {
        for (most, &product) in most.iter_mut().zip(&products[i]) {
            *most = greater(*most, product);
        }
    }
    *maxima = most;
}

/// The greater of two numbers, in one instruction on each architecture. Neither is NaN unless a
/// product overflows f32.
#[inline(always)]
fn greater(most: f32, product: f32) -> f32 {
    if cfg!(target_arch = "aarch64") {
        most.max(product)
    } else if product > most {
        product
    } else {
        most
    }
}

const _: () = assert!(TILE == u64::BITS as usize);
