//! The inner loop of each NEON kernel, as compiled, and what it costs.

use super::assembly::{Function, Loop, functions};
use super::mca::{Cost, Mca};
use anyhow::{Context, ensure};

/// One round of a kernel's inner loop.
#[derive(Clone, Debug)]
pub struct Kernel {
    pub name: String,
    /// Products of a round; of farthest point sampling, points.
    pub work: usize,
    pub cost: Cost,
}

#[derive(Clone, Debug)]
pub struct Tile {
    pub kernel: Kernel,
    pub rows: usize,
    pub channels: usize,
    /// Inputs of a round.
    pub inputs: usize,
}

/// All kernels in the model of the Raspberry Pi.
pub struct Kernels {
    /// In the order of [`Number::ALL`].
    tiles: Vec<Tile>,
    /// In the order of [`Number::ALL`]; a round is one input of one block.
    gemv: Vec<Kernel>,
    pub farthest: Kernel,
}

impl Kernels {
    /// Finds the kernels in an assembly listing, all of which must be there, and has their
    /// loops analysed.
    pub fn of(listing: &str, mca: &Mca) -> anyhow::Result<Self> {
        let functions: Vec<(String, Function<'_>)> = functions(listing)
            .map(|function| (demangled(function.symbol), function))
            .filter(|(name, _)| name.contains("edgepuck_kernels::neon"))
            .collect();
        let tiles = Number::ALL.map(|number| tile(&functions, number, mca));
        let gemv = Number::ALL.map(|number| {
            let products = |inner: &Loop<'_>| match number.widens(inner) {
                true => 4 * inner.count("fmla", "4s"),
                false => 0,
            };
            let kernel = slowest(&functions, "gemv::gemv", products, mca)?;
            let name = format!("gemv, {number:?} weights").to_lowercase();
            Ok(Kernel { name, ..kernel })
        });
        // FMINNM lowers the distances of four points.
        let points = |inner: &Loop<'_>| 4 * inner.count("fminnm", "4s");
        let farthest = slowest(&functions, "fps::step", points, mca)?;
        Ok(Self {
            tiles: tiles.into_iter().collect::<anyhow::Result<_>>()?,
            gemv: gemv.into_iter().collect::<anyhow::Result<_>>()?,
            farthest: Kernel { name: "farthest point step".into(), ..farthest },
        })
    }

    pub fn tile(&self, number: Number) -> &Tile {
        &self.tiles[number as usize]
    }

    /// The matrix-vector product whose weights are stored in a format.
    pub fn gemv(&self, number: Number) -> &Kernel {
        &self.gemv[number as usize]
    }

    pub fn all(&self) -> impl Iterator<Item = &Kernel> {
        let tiles = self.tiles.iter().map(|tile| &tile.kernel);
        tiles.chain(&self.gemv).chain([&self.farthest])
    }
}

/// A symbol as Rust writes it, without hashes.
pub fn demangled(symbol: &str) -> String {
    format!("{:#}", rustc_demangle::demangle(symbol))
}

fn tile(functions: &[(String, Function<'_>)], number: Number, mca: &Mca) -> anyhow::Result<Tile> {
    let (mnemonic, arrangement, products) = number.multiplier();
    let prefix = number.tile_prefix();
    let work = |inner: &Loop<'_>| products * inner.count(mnemonic, arrangement);
    let kernel = slowest(functions, prefix, work, mca)?;
    let (rows, channels) = shape(&kernel.name, prefix)
        .with_context(|| format!("{}: expected a name that ends in ROWSxCHANNELS", kernel.name))?;
    let name = format!("{prefix}{rows}x{channels}");
    ensure!(
        kernel.work.is_multiple_of(rows * channels),
        "the inner loop of {name}: expected products of whole inputs, found {}",
        kernel.work
    );
    let inputs = kernel.work / (rows * channels);
    let kernel = Kernel { name, ..kernel };
    Ok(Tile { kernel, rows, channels, inputs })
}

/// (8, 8) of a path that ends in `tile_i8_8x8`, perhaps with generics.
fn shape(name: &str, prefix: &str) -> Option<(usize, usize)> {
    let (_, shape) = name.split_once(prefix)?;
    let (rows, channels) = shape.split_once('x')?;
    let end = channels.find(|c: char| !c.is_ascii_digit()).unwrap_or(channels.len());
    Some((rows.parse().ok()?, channels[..end].parse().ok()?))
}

/// The slowest of the loops with the most `work` in functions whose name contains `part`; their
/// code differs in what follows the loop.
fn slowest(
    functions: &[(String, Function<'_>)],
    part: &str,
    work: impl Fn(&Loop<'_>) -> usize,
    mca: &Mca,
) -> anyhow::Result<Kernel> {
    let named = functions.iter().filter(|(name, _)| name.contains(part));
    let loops: Vec<(&String, Loop<'_>)> = named
        .flat_map(|(name, function)| function.innermost_loops().into_iter().map(move |l| (name, l)))
        .collect();
    let most = loops.iter().map(|(_, inner)| work(inner)).max().unwrap_or(0);
    ensure!(most > 0, "expected an inner loop of `{part}` among the binary's NEON kernels");
    let mut slowest: Option<Kernel> = None;
    for (name, inner) in loops.into_iter().filter(|(_, inner)| work(inner) == most) {
        let cost = mca.cost(&inner.text()).with_context(|| format!("the inner loop of {name}"))?;
        if slowest.as_ref().is_none_or(|kernel| cost.cycles > kernel.cost.cycles) {
            slowest = Some(Kernel { name: name.clone(), work: most, cost });
        }
    }
    slowest.context("invariant: one loop has most work")
}

/// A format that kernels multiply in, or that weights are stored in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Number {
    F32,
    I8,
}

impl Number {
    pub const ALL: [Self; 2] = [Self::F32, Self::I8];

    pub fn bytes(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::I8 => 1,
        }
    }

    /// The names of the tile functions of this format, up to their shape.
    pub fn tile_prefix(self) -> &'static str {
        match self {
            Self::F32 => "tile_f32_",
            Self::I8 => "tile_i8_",
        }
    }

    /// The instruction that tiles of this format multiply by, the arrangement
    /// of its result, and its products.
    pub fn multiplier(self) -> (&'static str, &'static str, usize) {
        match self {
            Self::F32 => ("fmla", "4s", 4),
            Self::I8 => ("sdot", "4s", 16),
        }
    }

    /// Whether a loop of matrix-vector products widens weights of this format.
    pub fn widens(self, inner: &Loop<'_>) -> bool {
        (self == Self::I8) == inner.has("scvtf")
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// Kernels of round figures: tiles of 8 rows by 8 channels, and a cycle
    /// and two instructions for each input of a tile, each input of a block
    /// and each four points.
    pub fn round_kernels() -> Kernels {
        let cost = Cost { cycles: 1.0, instructions: 2.0 };
        let kernel = |work| Kernel { name: String::new(), work, cost };
        let tile = || Tile { kernel: kernel(64), rows: 8, channels: 8, inputs: 1 };
        Kernels {
            tiles: Number::ALL.map(|_| tile()).to_vec(),
            gemv: Number::ALL.map(|_| kernel(64)).to_vec(),
            farthest: kernel(4),
        }
    }

    #[test]
    fn a_tile_s_name_says_its_shape() {
        assert_eq!(shape("edgepuck_kernels::neon_dot::tile_i8_8x16", "tile_i8_"), Some((8, 16)));
        assert_eq!(shape("tile_f32_12x8::<Max, 8>", "tile_f32_"), Some((12, 8)));
        assert_eq!(shape("tile_f32_8", "tile_f32_"), None);
        assert_eq!(shape("gemv", "tile_f32_"), None);
    }
}
