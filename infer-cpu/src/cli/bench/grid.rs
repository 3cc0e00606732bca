//! The settings that a benchmark goes through.

use infer_cpu::{Options, Precision, TNets};

use super::Args;
use super::variant::Variant;

/// One setting.
#[derive(Clone)]
pub struct Setting {
    /// Points that the network sees.
    pub points: usize,
    /// What it computes in.
    pub precision: Precision,
    /// How the points are chosen.
    pub sampler: Variant,
    /// The T-Nets in use.
    pub t_nets: TNets,
    /// Threads.
    pub threads: usize,
}

impl Setting {
    /// How a classifier is to be loaded for it.
    pub fn options(&self, args: &Args, capacity: usize) -> Options {
        let mut options = Options {
            precision: self.precision,
            kernel: args.kernel,
            threads: self.threads,
            t_nets: self.t_nets,
            capacity,
            ..Options::default()
        };
        self.sampler.set(&mut options, self.points);
        options
    }
}

/// All settings that `args` name; fp32 comes first among precisions, since the
/// others are compared with it.
pub fn settings(args: &Args) -> Vec<Setting> {
    let mut precisions = args.precision.clone();
    precisions.sort_unstable();
    let mut settings = Vec::new();
    for sampler in &args.sampler {
        for &t_nets in &args.t_nets {
            for &points in &args.points {
                for &threads in &args.threads {
                    settings.extend(precisions.iter().map(|&precision| Setting {
                        points,
                        precision,
                        sampler: sampler.clone(),
                        t_nets,
                        threads,
                    }));
                }
            }
        }
    }
    settings
}
