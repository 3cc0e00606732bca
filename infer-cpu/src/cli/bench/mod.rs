//! `infer-cpu bench`: how fast this machine is.

mod grid;
mod latency;
mod machine;
mod statistics;
mod table;
mod variant;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[cfg(feature = "npz")]
use formats::labelled::read_labelled;
use infer_cpu::{Precision, TNets};

use variant::Variant;

/// Flags of `bench`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  infer-cpu bench --json > pi5.json
  infer-cpu bench --points 64,1024 --precision f32,f16 --threads 1,4

Latency is that of a whole classification, from coordinates to class. A sampler
is a name, perhaps with more behind colons: `fps`, `cpl`, `cpl:stn`,
`cpl:trunk`, `random:votes5`, `random:votes5:turned`.")]
pub struct Args {
    /// Model file [default: the bundled weights]
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,

    /// Points that the network sees
    #[arg(long, value_delimiter = ',', value_parser = at_least_one,
          default_value = "16,32,64,128,256,512,1024,2048,4096")]
    points: Vec<usize>,

    /// Precisions
    #[arg(long, value_delimiter = ',', default_value = "f32,f32-fc16,f16,i8")]
    precision: Vec<Precision>,

    /// Samplers; `all` takes clouds of as many points as the network is to see
    #[arg(long, value_delimiter = ',', default_value = "all")]
    sampler: Vec<Variant>,

    /// T-Nets: both, input, feature, none
    #[arg(long, value_delimiter = ',', default_value = "both")]
    t_nets: Vec<TNets>,

    /// Threads
    #[arg(long, value_delimiter = ',', default_value = "1,2,4")]
    threads: Vec<usize>,

    /// Kernels to use: scalar, avx2, avx512, neon, neon_f16, neon_dot
    /// [default: the fastest]
    #[arg(long)]
    kernel: Option<infer_cpu::kernel::KernelName>,

    /// Points of the clouds that samplers choose from
    #[arg(long, default_value_t = 1024, value_name = "N")]
    from: usize,

    /// Classifications of each setting
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,

    /// Print one JSON object with all samples instead of a table
    #[arg(long)]
    json: bool,

    #[cfg(feature = "npz")]
    /// Clouds to calibrate int8 with, a packed NPZ [default: the model's own
    /// calibration, else shapes made by rule]
    #[arg(long, value_name = "NPZ")]
    calibrate: Option<PathBuf>,
}

/// The largest activations on the clouds of `--calibrate`: none can be read.
#[cfg(not(feature = "npz"))]
fn calibration(_: &Args, _: &Path) -> anyhow::Result<Option<BTreeMap<String, f32>>> {
    Ok(None)
}

/// The largest activations on the clouds of `--calibrate`, if there are any.
#[cfg(feature = "npz")]
fn calibration(args: &Args, model: &Path) -> anyhow::Result<Option<BTreeMap<String, f32>>> {
    let Some(path) = &args.calibrate else { return Ok(None) };
    Ok(Some(infer_cpu::activation_ranges_of_set(model, &read_labelled(path)?)?))
}

fn at_least_one(word: &str) -> Result<usize, String> {
    word.parse().ok().filter(|&n| n > 0).ok_or_else(|| "not a number above 0".to_owned())
}

/// Measures what `args` ask for.
///
/// # Errors
/// A model or a set that cannot be read, a file that cannot be written.
pub fn run(args: &Args, model: &Path) -> anyhow::Result<()> {
    latency::run(args, model)
}
