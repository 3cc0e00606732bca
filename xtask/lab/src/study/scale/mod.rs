//! `cargo xtask bench scale`: what a million, a billion and a trillion scans cost as tars, and what is
//! the first to keep more machines from making them sooner.
//!
//! Tasks of each plan are run and measured. What all tasks of a plan cost, and the link over which they
//! upload, are modelled from what one tar costs.

mod link;
mod model;
mod runs;

use crate::measure::clock::Spread;
use crate::measure::machine::Machine;
use crate::render::table::{Column, Table, digits, percent};
use anyhow::Result;
use clap::Args;
use formats::atomic;
use model::{CORES, PerCloud, costs};
use runs::{Plan, Program, Task};
use std::path::PathBuf;
use xtask::workspace::command_line;

/// Flags of `bench scale`.
#[derive(Args, Debug)]
pub struct ScaleArgs {
    /// Program to measure, which `cargo build --release -p edgepuck` builds.
    #[arg(default_value = "target/release/edgepuck")]
    program: PathBuf,
    /// Write the tables to this Markdown file.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// A split has at most a million tars, so that those of the largest plan are larger.
const PLANS: [Plan; 3] = [
    Plan { scans: 1_000_000, tar_clouds: 65_536 },
    Plan { scans: 1_000_000_000, tar_clouds: 65_536 },
    Plan { scans: 1_000_000_000_000, tar_clouds: 1 << 20 },
];

/// Gbit/s of the link that is simulated.
const LINK: f64 = 10.0;

/// Words about the tables.
const NOTES: &str = include_str!("notes.md");

/// Measures, prints the tables and writes the report.
pub fn run(args: &ScaleArgs) -> Result<()> {
    let (machine, program) = (Machine::here(), Program::new(&args.program)?);
    let mut start_ups = PLANS.map(Plan::no_tar);
    program.run(&mut start_ups, 3)?;
    let mut equal = [0, 1].map(|i| Plan { tar_clouds: 8192, ..PLANS[i] }.one_tar("clouds"));
    program.run(&mut equal, 5)?;
    let scans = Plan { tar_clouds: 16_384, ..PLANS[0] };
    let mut samples = [PLANS[0].one_tar("clouds"), scans.one_tar("scan")];
    program.run(&mut samples, 1)?;
    let cast_cpu_s = program.cast_cpu_s(20)?;
    let [clouds, scans] = samples.each_ref().map(|task| PerCloud {
        cpu_s: task.costs.cpu_s().median / task.clouds as f64,
        cast_cpu_s,
        bytes: task.bytes as f64 / task.clouds as f64,
    });
    let [small, large] = equal.each_ref().map(|task| task.costs.cpu_s().median);
    let tasks: Vec<Task> = start_ups.into_iter().chain(equal).chain(samples).collect();
    let tables = [
        measured(&tasks),
        modelled("clouds", &clouds),
        modelled("scan", &scans),
        links(&clouds, &scans),
        shares(&clouds),
    ];
    let mut text = heading(&machine, cast_cpu_s, small / large);
    tables.iter().for_each(|table| text += &(table.markdown() + "\n"));
    text += NOTES;
    print!("{text}");
    args.report.as_ref().map_or(Ok(()), |file| Ok(atomic::write_bytes(file, &text)?))
}

fn heading(machine: &Machine, cast_cpu_s: f64, ratio: f64) -> String {
    let Machine { commit, cpu, threads, system, load_average, .. } = machine;
    let [commit, cpu, load] = [commit, cpu, load_average].map(|x| x.as_deref().unwrap_or("?"));
    format!(
        "# Tars of a million to a trillion scans\n\n    {}\n\nCommit {commit}; {cpu}, {threads} \
         threads, {system}, load {load}. Measured: a CPU-second makes {} times as many clouds of the \
         plan of 1e9 scans as of that of 1e6; aiming and casting take {} CPU-ms a scan.\n\n",
        command_line(),
        digits(ratio),
        digits(1e3 * cast_cpu_s),
    )
}

fn measured(tasks: &[Task]) -> Table {
    let spread = |Spread { median, min, max }: Spread| match min == max {
        true => digits(median),
        false => format!("{} ({} to {})", digits(median), digits(min), digits(max)),
    };
    let per = |x: u64, y: f64| if x > 0 { digits(x as f64 / y) } else { "-".to_owned() };
    let columns: [Column<Task>; 10] = [
        ("plan, scans", &|t| format!("{:e}", t.plan.scans)),
        ("sample", &|t| t.sample.to_owned()),
        ("clouds", &|t| t.clouds.to_string()),
        ("wall s", &|t| spread(t.costs.wall_s())),
        ("CPU s", &|t| spread(t.costs.cpu_s())),
        ("cores busy", &|t| digits(t.costs.cpu_s().median / t.costs.wall_s().median)),
        ("clouds/wall s", &|t| per(t.clouds, t.costs.wall_s().median)),
        ("clouds/CPU s", &|t| per(t.clouds, t.costs.cpu_s().median)),
        ("bytes/cloud", &|t| per(t.bytes, t.clouds as f64)),
        ("peak MB", &|t| digits(t.peak_bytes as f64 / 1e6)),
    ];
    Table::of("Measured: tasks without a tar, and with one", tasks, &columns)
}

fn modelled(sample: &str, cloud: &PerCloud) -> Table {
    let title = format!("Modelled: all of a plan, `--sample {sample}`, machines of {CORES} cores");
    let mut table = Table::new(title, &["", "1e6 scans", "1e9 scans", "1e12 scans"]);
    let [small, medium, large] = PLANS.map(|plan| costs(plan, cloud));
    for ((small, medium), large) in small.into_iter().zip(medium).zip(large) {
        table.push(vec![small.0, small.1, medium.1, large.1]);
    }
    table
}

fn links(clouds: &PerCloud, scans: &PerCloud) -> Table {
    let cores = |cloud: &PerCloud, link: f64| digits(cloud.cores_to_fill(link));
    let columns: [Column<f64>; 3] = [
        ("Gbit/s", &|link| digits(*link)),
        ("cores, clouds", &|link| cores(clouds, *link)),
        ("cores, scan", &|link| cores(scans, *link)),
    ];
    Table::of("Modelled: cores that fill a link", &[1.0, 10.0, 100.0], &columns)
}

fn shares(cloud: &PerCloud) -> Table {
    let clouds = PLANS[0].tar_clouds as f64;
    let cast_s = cloud.cpu_s * clouds / CORES as f64;
    let upload_s = cloud.bytes * clouds * 8.0 / (LINK * 1e9);
    let title = format!(
        "Modelled: share of the rate without a link, %, of tasks of {CORES} cores that share {LINK} \
         Gbit/s ({} s to cast a tar of clouds, {} s to upload it alone: {} tasks fill the link)",
        digits(cast_s),
        digits(upload_s),
        digits((cast_s + upload_s) / upload_s),
    );
    let share =
        |tasks: usize, stagger_s| percent(link::share_of_rate(tasks, cast_s, upload_s, stagger_s));
    let columns: [Column<usize>; 3] = [
        ("tasks", &usize::to_string),
        ("started evenly over a tar's time", &|n| share(*n, (cast_s + upload_s) / *n as f64)),
        ("started together", &|n| share(*n, 0.0)),
    ];
    Table::of(title, &[1, 4, 16, 64, 256], &columns)
}
