//! `cargo xtask bench pi-model`: models the times of a Raspberry Pi 5.
//!
//! llvm-mca ([`mca`]) finds the cycles of the compiled inner loop of each NEON function
//! ([`kernels`]). The [`plan`] counts the iterations of each loop in a classification, and [`model`]
//! divides the work among threads and finds the time. Instructions outside the loops are [`count`]ed
//! under QEMU.

use anyhow::{Context, Result};
use clap::Args;
use infer_cpu::Precision;
use std::path::{Path, PathBuf};
use xtask::{build_pi, pi_target, workspace};

mod assembly;
mod count;
mod kernels;
mod mca;
mod model;
mod network;
mod plan;
mod rows;

#[derive(Args, Debug)]
pub struct PiModelArgs {
    /// Model file [default: the baseline network with weights drawn at random].
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Numbers of points that the network sees, multiples of 8.
    #[arg(long, value_delimiter = ',', value_parser = eights,
          default_value = "16,32,64,128,256,512,1024,2048,4096")]
    points: Vec<usize>,
    /// Precisions to model: f32, i8.
    #[arg(long, value_delimiter = ',', default_value = "f32,i8")]
    precision: Vec<Precision>,
}

/// Models what `args` ask for and prints it. Fails without an llvm-mca that knows the core.
pub fn run(args: &PiModelArgs) -> Result<()> {
    let board = Board::open()?;
    print!("{}", rows::kernels(&board.kernels, &board.llvm_mca));
    let model = match &args.model {
        Some(model) => model.clone(),
        None => {
            let stand_in = board.folder.join("untrained-baseline.safetensors");
            network::write_stand_in(&stand_in)?;
            stand_in
        }
    };
    let network = network::Network::read(&model)?;
    let warn = |error: &anyhow::Error| {
        eprintln!("instructions outside inner loops are not counted: {error:#}");
    };
    let counter = board.counter(&model).inspect_err(warn).ok();
    let rows = rows::rows(args, &network, &board.kernels, counter.as_ref())?;
    print!("{}", rows::times(&rows));
    print!("\n{}", rows::LEFT_OUT);
    Ok(())
}

/// The Raspberry Pi's build of infer-cpu, analysed.
struct Board {
    llvm_mca: String,
    folder: PathBuf,
    binary: PathBuf,
    kernels: kernels::Kernels,
}

impl Board {
    fn open() -> Result<Self> {
        let mca = mca::Mca::find()?;
        workspace::need_standard_library(pi_target::TRIPLE)?;
        let folder = workspace::root().join("target/pi-model");
        std::fs::create_dir_all(&folder)?;
        let listing = folder.join("infer-cpu.s");
        let emit = format!("asm={}", listing.display());
        let binary = build_pi::build(&["-C", "strip=none", "--emit", &emit])?;
        let text = std::fs::read_to_string(&listing).with_context(|| {
            format!("cannot read {}; remove target and retry", listing.display())
        })?;
        let kernels = kernels::Kernels::of(&text, &mca)?;
        Ok(Self { llvm_mca: mca.version, folder, binary, kernels })
    }

    fn counter(&self, model: &Path) -> Result<count::Counter> {
        count::Counter::new(&self.folder, &self.binary, model)
    }
}

fn eights(word: &str) -> Result<usize, String> {
    match word.parse::<usize>() {
        Ok(n) if n > 0 && n.is_multiple_of(8) => Ok(n),
        _ => Err("expected a positive multiple of 8".to_owned()),
    }
}
