//! `cargo xtask bench pi-model`: models the times of a Raspberry Pi 5.
//!
//! llvm-mca ([`mca`]) finds the cycles of the compiled inner loop of each NEON function
//! ([`kernels`]). The [`plan`] counts the iterations of each loop in a classification,
//! [`load`] divides the work among threads, and [`model`] finds the time. Instructions
//! outside the loops are [`count`]ed under QEMU.

use anyhow::{Context, Result, ensure};
use clap::Args;
use edgepuck_program::flags::positive;
use formats::atomic;
use infer_cpu::Precision;
use std::path::{Path, PathBuf};
use xtask::{build_pi, pi_target, workspace};

mod assembly;
mod count;
mod kernels;
mod live;
mod load;
mod mca;
mod model;
mod network;
mod number;
mod plan;
mod report;
mod rows;

pub use plan::Sampler;

/// Flags of `bench pi-model`.
#[derive(Args, Debug)]
pub struct PiModelArgs {
    /// Model file [default: the baseline network with weights drawn at random; street-128 with
    /// --live]
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Model `infer-cpu live` instead, by what the second of two captures of a drive takes more than
    /// the first, such as those of `gen-drive --seconds 1` and `--seconds 3`.
    #[arg(long, num_args = 2, value_names = ["SHORT", "LONG"])]
    live: Vec<PathBuf>,
    /// Numbers of points that the network sees, multiples of 8.
    #[arg(long, value_delimiter = ',', value_parser = eights,
          default_value = "16,32,64,128,256,512,1024,2048,4096")]
    points: Vec<usize>,
    /// Number of points in the clouds that samplers choose from.
    #[arg(long, value_parser = eights, default_value = "1024", value_name = "N")]
    from: usize,
    /// Number of points that a Critical Points Layer keeps.
    #[arg(long, value_parser = eights, default_value = "64", value_name = "N")]
    critical: usize,
    /// Precisions to model: f32, f32-fc16, f16, i8.
    #[arg(long, value_delimiter = ',', default_value = "f32,f32-fc16,f16,i8")]
    precision: Vec<Precision>,
    /// Number of cores that are used.
    #[arg(long, default_value_t = model::Machine::PI_5.threads as u16,
          value_parser = clap::value_parser!(u16).range(1..))]
    threads: u16,
    /// Clock rate of the cores, GHz.
    #[arg(long, default_value_t = model::Machine::PI_5.hertz / 1e9, value_name = "GHZ", value_parser = positive)]
    clock: f64,
    /// Memory bandwidth of all cores together, GB/s.
    #[arg(long, default_value_t = model::Machine::PI_5.bytes_per_s / 1e9, value_name = "GB/S", value_parser = positive)]
    bandwidth: f64,
    /// Instructions per cycle outside the inner loops; the core's two SIMD pipes allow two.
    #[arg(long, default_value_t = model::Machine::PI_5.instructions_per_cycle, value_name = "IPC", value_parser = positive)]
    other_ipc: f64,
    /// Do not count instructions under QEMU; model only the inner loops and memory.
    #[arg(long)]
    no_counts: bool,
    /// Fail if a tile's inner loop reaches less than this share of the peak FMA rate, percent.
    #[arg(long, value_name = "PERCENT", value_parser = positive)]
    least_peak: Option<f64>,
    /// llvm-mca of LLVM 19 or newer [default: the newest on the PATH]
    #[arg(long, value_name = "PROGRAM")]
    llvm_mca: Option<String>,
    /// Write all figures to this JSON file.
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Write the modelled times to this CSV file, one per row.
    #[arg(long, value_name = "FILE")]
    csv: Option<PathBuf>,
}

impl PiModelArgs {
    /// The machine that they describe.
    fn machine(&self) -> model::Machine {
        model::Machine {
            threads: self.threads.into(),
            hertz: self.clock * 1e9,
            bytes_per_s: self.bandwidth * 1e9,
            instructions_per_cycle: self.other_ipc,
        }
    }
}

/// Models what `args` ask for and prints it. Fails without an llvm-mca that knows the core, and
/// if a kernel is below the share of peak asked for.
pub fn run(args: &PiModelArgs) -> Result<()> {
    let board = Board::open(args.llvm_mca.as_deref())?;
    if !args.live.is_empty() {
        let street = || workspace::root().join("assets/weights/street-128.safetensors");
        let counter = board.counter(&args.model.clone().unwrap_or_else(street))?;
        print!("{}", live::table(&counter, &args.live, args.machine())?);
        return Ok(());
    }
    print!("{}", report::kernels(&board.kernels, &board.llvm_mca));
    check_peaks(&board.kernels, args.least_peak)?;

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
    let counter = match args.no_counts {
        true => None,
        false => board.counter(&model).inspect_err(warn).ok(),
    };
    let rows = rows::rows(args, &network, &board.kernels, counter.as_ref())?;
    let report = report::Report::new(args, &board.llvm_mca, &board.kernels, rows);
    print!("{report}");
    if let Some(file) = &args.json {
        atomic::write_bytes(file, serde_json::to_string_pretty(&report)? + "\n")?;
    }
    if let Some(file) = &args.csv {
        atomic::write_bytes(file, report.csv()?)?;
    }
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
    fn open(llvm_mca: Option<&str>) -> Result<Self> {
        let mca = mca::Mca::find(llvm_mca)?;
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

    /// What counts instructions, where that is possible.
    fn counter(&self, model: &Path) -> Result<count::Counter> {
        count::Counter::new(&self.folder, &self.binary, model)
    }
}

/// The model of one model file on a Raspberry Pi 5.
pub struct Modelled {
    board: Board,
    network: network::Network,
    counter: count::Counter,
}

impl Modelled {
    /// Analyses the build and the model file at `model`. Fails without an emulator that can
    /// count: times without what is outside the inner loops would be too good.
    pub fn open(model: &Path) -> Result<Self> {
        let board = Board::open(None)?;
        let counter = board.counter(model)?;
        let network = network::Network::read(model)?;
        Ok(Self { board, network, counter })
    }

    /// Milliseconds to a class of `points` of a cloud of `from`, by threads;
    /// `None` if the network lacks what the sampler needs.
    pub fn total_ms(
        &self,
        sampler: Sampler,
        (from, points): (usize, usize),
        precision: Precision,
        threads: &[usize],
    ) -> Result<Option<Vec<f64>>> {
        let setting = plan::Setting { sampler, from, points, precision };
        let Some(stages) = setting.stages(&self.network) else { return Ok(None) };
        let (network, kernels) = (&self.network, &self.board.kernels);
        let counted = rows::count(&self.counter, network, kernels, setting)?;
        let of = |&threads: &usize| {
            let machine = model::Machine { threads, ..model::Machine::PI_5 };
            let other = Some(counted.other);
            model::time(&machine, kernels, &stages, counted.columns_read, other).total_ms
        };
        Ok(Some(threads.iter().map(of).collect()))
    }
}

fn check_peaks(kernels: &kernels::Kernels, least_percent: Option<f64>) -> Result<()> {
    let Some(least) = least_percent else { return Ok(()) };
    for kernel in kernels.all() {
        if let Some(share) = kernel.share_of_peak() {
            let percent = share * 100.0;
            ensure!(percent >= least, "{}: {percent:.1} % of peak, below {least}", kernel.name);
        }
    }
    Ok(())
}

fn eights(word: &str) -> Result<usize, String> {
    match word.parse::<usize>() {
        Ok(n) if n > 0 && n.is_multiple_of(8) => Ok(n),
        _ => Err("expected a positive multiple of 8".to_owned()),
    }
}
