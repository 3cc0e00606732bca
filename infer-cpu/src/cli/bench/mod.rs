//! `infer-cpu bench`: measures the latency on this machine.

mod latency;
mod machine;
mod table;
mod variant;

use std::path::PathBuf;

use crate::Precision;

pub use latency::run;
use variant::Variant;

/// Flags of `bench`.
#[derive(clap::Args)]
#[command(after_help = include_str!("help.txt"))]
pub struct BenchArgs {
    /// Model file [default: the bundled model]
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,

    /// Numbers of points that the network sees
    #[arg(long, value_delimiter = ',', value_parser = at_least_one,
          default_value = "16,32,64,128,256,512,1024,2048,4096")]
    points: Vec<usize>,

    /// Precisions to measure
    #[arg(long, value_delimiter = ',', default_value = "f32,i8")]
    precision: Vec<Precision>,

    /// Samplers to measure; for `all`, the clouds have as many points as the network sees
    #[arg(long, value_delimiter = ',', default_value = "all")]
    sampler: Vec<Variant>,

    /// Numbers of threads to measure
    #[arg(long, value_delimiter = ',', value_parser = at_least_one, default_value = "1,2,4")]
    threads: Vec<usize>,

    /// Kernels to use: scalar, avx2, avx512, neon, neon_dot [default: the fastest]
    #[arg(long)]
    kernel: Option<crate::kernel::KernelName>,

    /// Number of points in the clouds that the samplers choose from
    #[arg(long, default_value_t = 1024, value_name = "N")]
    from: usize,

    /// Number of clouds that are classified together, a thread a cloud; the time is that of all of
    /// them. A single one is shared out among the threads
    #[arg(long, default_value = "1", value_parser = at_least_one, value_name = "N")]
    clouds: usize,

    /// Number of classifications per setting
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..))]
    repeats: u32,

    /// Print one JSON object with all samples instead of a table
    #[arg(long)]
    json: bool,
}

fn at_least_one(word: &str) -> Result<usize, String> {
    word.parse().ok().filter(|&n| n > 0).ok_or_else(|| "expected a whole number above 0".to_owned())
}
