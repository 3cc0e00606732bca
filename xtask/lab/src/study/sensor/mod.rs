//! `cargo xtask bench sensor`: a profile beside real sweeps of the sensor.
//!
//! [`sweep`] reads and simulates sweeps, [`mounting`] finds where the sensor stands and
//! where its lasers point, [`patches`] measures noise and missing returns.

pub mod mounting;
mod patches;
pub mod sweep;

use crate::render::table::{Table, percent, publish};
use anyhow::{Context, Result, bail};
use clap::Args;
use formats::labelled_sweep::read_labelled_sweep;
use mounting::Mounting;
use patches::{Patch, Shown, typical_mm};
use sim_gpu::internals::sensor::{Layout, Rotating, SensorProfile};
use std::path::PathBuf;
use sweep::Return;

#[derive(Args, Debug)]
pub struct SensorArgs {
    /// Frames of Argoverse 2 as NPZ files with `xyz_mm`, `laser` and `offset_ns`. Files without
    /// lasers are skipped.
    #[arg(required = true, value_name = "FRAME")]
    frames: Vec<PathBuf>,
    /// Profile of the sensor that took them.
    #[arg(long, default_value = "vlp32c")]
    sensor: String,
    /// Write the tables to this Markdown file.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

/// Borders of the bins of range, metres.
const RANGES_M: [f64; 6] = [0.0, 10.0, 15.0, 20.0, 30.0, 50.0];
/// Borders of the bins of incidence, degrees.
const INCIDENCES_DEG: [f64; 4] = [0.0, 40.0, 70.0, 85.0];
/// Fewer patches are no figure of a bin.
const MIN_PATCHES: usize = 5;

struct Sweep {
    name: String,
    mounting: Mounting,
    shown: Shown,
}

impl Sweep {
    fn of(name: String, returns: &[Return], table: &Rotating) -> Self {
        let mounting = Mounting::fit(returns, table);
        let shown = Shown::of(returns, &mounting, table);
        Self { name, mounting, shown }
    }
}

pub fn run(args: &SensorArgs) -> Result<()> {
    let sensor = SensorProfile::resolve(&args.sensor)?;
    let Layout::Rotating(table) = &sensor.layout else {
        bail!("{}: expected a table of rotating beams, found another layout", sensor.name);
    };
    let mut real = Vec::new();
    for file in &args.frames {
        let sensors = read_labelled_sweep(file).map_err(anyhow::Error::from);
        let sensors = sensors.and_then(|sweep| sweep::by_sensor(&sweep, table.beam.len()));
        match sensors.with_context(|| file.display().to_string()) {
            Ok(sensors) => real.extend(sensors.iter().zip(1..).map(|(returns, number)| {
                let frame = file.file_stem().unwrap_or_default().to_string_lossy();
                Sweep::of(format!("{frame}, sensor {number}"), returns, table)
            })),
            Err(error) => eprintln!("skipped: {error:#}"),
        }
    }
    if real.is_empty() {
        bail!("expected a frame with `laser`, the number of each point's laser, found none");
    }
    let returns = sweep::simulated(&sensor, table).context("simulating a sweep")?;
    let simulated = [Sweep::of("simulated".to_owned(), &returns, table)];
    let tables = [
        mountings(real.iter().chain(&simulated)),
        beams(&real, &simulated, table),
        figures(&real, &simulated, table),
    ];
    publish(&tables, args.report.as_deref())
}

fn mountings<'a>(sweeps: impl Iterator<Item = &'a Sweep>) -> Table {
    let heading = [
        "sweep",
        "origin, m",
        "hangs",
        "car moves, m/s",
        "car tilts, deg/s",
        "scatter of elevation, deg",
        "of azimuth, deg",
    ];
    let mut table = Table::new("Estimated mounting", &heading);
    for Sweep { name, mounting, .. } in sweeps {
        let [elevation, azimuth] = mounting.scatter_deg;
        table.push(vec![
            name.clone(),
            mounting.origin_m().to_array().map(|x| format!("{x:.3}")).join(" "),
            if mounting.is_upside_down() { "upside down" } else { "upright" }.to_owned(),
            mounting.velocity_m_s().to_array().map(|x| format!("{x:.2}")).join(" "),
            format!("{:.2}", mounting.tilting_deg_s()),
            format!("{elevation:.4}"),
            format!("{azimuth:.4}"),
        ]);
    }
    table
}

/// Each laser's angles and returns. The standard error is from the differences between
/// sweeps and sensors.
fn beams(real: &[Sweep], simulated: &[Sweep], table: &Rotating) -> Table {
    let heading = [
        "laser",
        "elevation in profile, deg",
        "found less profile",
        "standard error",
        "azimuth offset in profile, deg",
        "found less profile",
        "standard error",
        "returns a turn, real",
        "simulated",
    ];
    let mut rows = Table::new("Each laser", &heading);
    for (row, beam) in table.beam.iter().enumerate() {
        let mut cells = vec![row.to_string()];
        for (kind, stated) in [beam.elevation_deg, beam.azimuth_offset_deg].into_iter().enumerate()
        {
            let (mean, error) =
                mean_and_error(real.iter().map(|s| s.mounting.differences_deg[kind][row]));
            cells.extend([stated.to_string(), format!("{mean:+.4}"), format!("{error:.4}")]);
        }
        cells.extend([real, simulated].map(|sweeps| {
            let (mean, _) = mean_and_error(sweeps.iter().map(|s| s.shown.counts[row] as f64));
            format!("{mean:.0}")
        }));
        rows.push(cells);
    }
    rows
}

fn mean_and_error(values: impl Iterator<Item = f64> + Clone) -> (f64, f64) {
    let n = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / n;
    let variance = values.map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0);
    (mean, (variance / n).sqrt())
}

fn figures(real: &[Sweep], simulated: &[Sweep], profile: &Rotating) -> Table {
    let mut table = Table::new("Real and simulated", &["figure", "real", "simulated"]);
    let mut push = |name: String, of: &dyn Fn(&[Sweep]) -> Option<String>| {
        let [a, b] = [real, simulated].map(|sweeps| of(sweeps).unwrap_or_else(|| "-".to_owned()));
        table.push(vec![name, a, b]);
    };
    let mean = |sweeps: &[Sweep], of: &dyn Fn(&Sweep) -> f64| {
        Some(format!("{:.4}", mean_and_error(sweeps.iter().map(of)).0))
    };
    push("firing sequences a sweep".into(), &|s| mean(s, &|s| s.shown.sequences as f64));
    push("azimuth between firings of a laser, deg".into(), &|s| {
        mean(s, &|s| s.mounting.spacing_deg(profile))
    });
    let ranges = |s: &[Sweep]| s.iter().flat_map(|s| s.shown.ranges_m.clone()).collect::<Vec<_>>();
    push("smallest range, m".into(), &|s| {
        ranges(s).into_iter().reduce(f64::min).map(|r| format!("{r:.2}"))
    });
    push("largest range, m".into(), &|s| {
        ranges(s).into_iter().reduce(f64::max).map(|r| format!("{r:.2}"))
    });
    for range in RANGES_M.windows(2) {
        push(format!("missing between neighbours, {} to {} m, %", range[0], range[1]), &|s| {
            let gaps = s
                .iter()
                .flat_map(|s| &s.shown.gaps)
                .filter(|g| (range[0]..range[1]).contains(&g.0));
            let (missing, firings) = gaps.fold((0, 0), |(m, n), gap| (m + gap.1, n + gap.1 + 1));
            (firings > 0).then(|| percent(missing as f64 / firings as f64))
        });
    }
    for incidence in INCIDENCES_DEG.windows(2) {
        for range in RANGES_M.windows(2) {
            let place = format!(
                "{} to {} m, incidence {} to {} deg",
                range[0], range[1], incidence[0], incidence[1]
            );
            let of = |s: &[Sweep], variance: fn(&Patch) -> f64| {
                let patches = s.iter().flat_map(|s| &s.shown.patches).filter(|p| {
                    (range[0]..range[1]).contains(&p.range_m)
                        && (incidence[0]..incidence[1]).contains(&p.incidence_deg)
                });
                let variances: Vec<f64> = patches.map(variance).collect();
                let n = variances.len();
                (n >= MIN_PATCHES).then(|| format!("{:.1} ({n})", typical_mm(variances)))
            };
            if of(real, |_| 0.0).is_some() {
                let name = format!("noise from return to return, {place}, mm (patches)");
                push(name, &|s| of(s, |p| p.next_m2));
            }
            // Seen at a slant, a surface's relief and bends look like noise.
            if incidence[0] == 0.0 && of(real, |_| 0.0).is_some() {
                let name = format!("noise around a plane of three rings, {place}, mm (patches)");
                push(name, &|s| of(s, |p| p.plane_m2));
            }
        }
    }
    for quantum_mm in [2.0, 3.0, 4.0, 5.0, 6.0] {
        push(format!("coherence with steps of {quantum_mm} mm, ranges below 8 m"), &|s| {
            mean(s, &|s| s.shown.coherence(quantum_mm * 1e-3))
        });
    }
    table
}

/// The `share` quantile of `values`, NaN of none.
fn quantile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    let place = (share * values.len() as f64) as usize;
    values.get(place.min(values.len().saturating_sub(1))).copied().unwrap_or(f64::NAN)
}
