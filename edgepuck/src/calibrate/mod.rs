//! `edgepuck calibrate`: what a sensor at rest says of itself, as a profile.

mod directions;
mod estimate;
mod figures;
mod firings;
mod median;
mod quantum;
mod report;
mod turning;

use std::io::Write;
use std::path::PathBuf;

use anyhow::{bail, ensure};
use formats::atomic;
use program::outputs::{Overwrite, need_extension};
use sim_gpu::sensors::{Layout, Rotating, SensorProfile, TypicalNoise};

use crate::flags::{copy_among, warn_of_sensor};
use crate::points::PointsArgs;
use crate::{Outcome, Usage};
use estimate::rounded;
use figures::{Figures, STEADY, STILL, figures};
use firings::Recording;
use median::median;

/// The fewest turns: fewer do not tell noise from change.
const LEAST_TURNS: usize = 5;

#[derive(clap::Args)]
pub struct CalibrateArgs {
    /// Recording of a sensor at rest, 5 turns or more: captures (.pcap or .pcapng) of a VLP-16 or
    /// VLP-32C, or with --metadata of an Ouster; or sweeps with rings (.npz, .ply, .pcd, .csv, ...),
    /// one turn each, in the order in which they were taken
    #[arg(value_name = "CAPTURE", required = true)]
    inputs: Vec<PathBuf>,

    /// Profile to write (.toml)
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    /// Sensor whose beams and data sheet the profile takes over: a built-in name, or the path of a
    /// profile [default: the sensor of the packets]
    #[arg(long, value_name = "NAME|FILE")]
    sensor: Option<String>,

    #[command(flatten)]
    points: PointsArgs,

    /// Print the figures as JSON
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    overwrite: Overwrite,
}

/// Measures the sensor, prints its figures, and writes its profile.
pub fn run(args: &CalibrateArgs) -> anyhow::Result<Outcome> {
    need_extension("--out", &args.out, &["toml"])?;
    args.overwrite.check([&*args.out])?;
    let named = args.sensor.as_deref().map(SensorProfile::resolve).transpose()?;
    named.iter().for_each(warn_of_sensor);
    let recording = firings::read(&args.inputs, &args.points)?;
    let base = match named {
        Some(base) => base,
        None => recorded_sensor(args, &recording)?,
    };
    let Layout::Rotating(head) = &base.layout else {
        bail!(Usage(format!("--sensor: expected a head that turns, found {}", base.name)));
    };
    // Of a recording twice, the noise would seem smaller.
    if let Some(copy) = copy_among(&args.inputs)? {
        bail!(Usage(format!(
            "{copy}; expected other turns in each file: give each recording once"
        )));
    }
    let name = match &args.inputs[..] {
        [one] => one.display().to_string(),
        [first, .., last] => format!("{} to {}", first.display(), last.display()),
        [] => String::new(),
    };
    ensure!(
        recording.n_turns >= LEAST_TURNS,
        "{name}: expected {LEAST_TURNS} complete turns or more, found {}: record for longer, or give \
         more captures of the same place, or sweeps of one turn each",
        recording.n_turns
    );
    if let Some(ring) = recording.rings.last()
        && usize::from(ring.number) >= head.beam.len()
    {
        bail!(Usage(format!(
            "{name}: expected the {} rings of {}, found ring {}: --sensor names another sensor",
            head.beam.len(),
            base.name,
            ring.number
        )));
    }
    let found = figures(&recording).map_err(|cause| {
        let moving = moving(args);
        anyhow::Error::msg(cause).context(if moving.is_empty() { name.clone() } else { moving })
    })?;
    if found.jumping.value > STILL {
        program::say!(
            "warning: {name}: ranges jump in {:.1} % of directions, which are left out: something \
             moved",
            100.0 * found.jumping.value
        );
    }
    if found.drift > STEADY {
        program::say!(
            "warning: {name}: ranges drift to {:.2} times the variance from turn to turn: does the \
             sensor warm up, or something move slowly?",
            found.drift
        );
    }
    if rounded(found.repeatability_m.value) == 0.0 {
        program::say!(
            "warning: {name}: ranges do not differ from turn to turn, beyond their rounding: the \
             profile keeps the noise of {}; are they copies of one turn, or simulated without noise?",
            base.name
        );
    }
    let name = args.out.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let profile = calibrated(base, name, &recording, &found);
    let text = report::text(&found, &recording, &args.out);
    atomic::write_bytes(&args.out, report::profile(&profile, &text)?)?;
    let mut out = std::io::stdout().lock();
    match args.json {
        true => writeln!(out, "{:#}", report::json(&found, &recording))?,
        false => out.write_all(text.as_bytes())?,
    }
    program::say!("profile from {} turns: {}", recording.n_turns, args.out.display());
    Ok(Outcome::Success)
}

/// Those of several captures that are not at rest by themselves.
fn moving(args: &CalibrateArgs) -> String {
    let moves = |file: &&PathBuf| {
        let alone = firings::read(std::slice::from_ref(*file), &args.points);
        alone.is_ok_and(|it| it.n_turns >= LEAST_TURNS && figures(&it).is_err())
    };
    let files = args.inputs.iter().filter(moves).map(|file| file.display().to_string());
    files.collect::<Vec<_>>().join(", ")
}

/// The profile of the sensor that sent the packets.
fn recorded_sensor(args: &CalibrateArgs, recording: &Recording) -> anyhow::Result<SensorProfile> {
    match (&args.points.metadata, recording.model) {
        (Some(metadata), _) => Ok(SensorProfile::load(metadata)?),
        (None, Some(model)) => Ok(SensorProfile::resolve(model.name())?),
        (None, None) => {
            let cause = "sweeps do not name their sensor: give --sensor NAME or FILE; `edgepuck \
                         profile` lists the names";
            Err(Usage(cause.to_owned()).into())
        }
    }
}

/// `base` with the figures that a profile holds.
fn calibrated(
    base: SensorProfile,
    name: String,
    recording: &Recording,
    found: &Figures,
) -> SensorProfile {
    let mut profile = SensorProfile {
        description: format!("{}, as calibrated from {} turns", base.name, recording.n_turns),
        name,
        ..base
    };
    profile.sources.push("edgepuck calibrate".to_owned());
    let sigma_m = rounded(found.repeatability_m.value);
    let typical_sigma_m = profile.noise.map_or(sigma_m, |noise| noise.typical_sigma_m);
    if sigma_m > 0.0 {
        profile.noise = Some(TypicalNoise { typical_sigma_m, repeatability_m: Some(sigma_m) });
    }
    // What the scene does not have does not narrow the sensor.
    let [least_m, largest_m] = found.ranges_m;
    profile.range.min_m = profile.range.min_m.min(rounded(least_m));
    profile.range.max_m = profile.range.max_m.max(rounded(largest_m));
    profile.range.quantum_m = found.quantum_m.map(|quantum| rounded(quantum.value));
    if let (Layout::Rotating(head), Some(turning)) = (&mut profile.layout, &found.turning) {
        turn(head, turning.rpm.value, recording);
    }
    profile
}

/// Lets the `head` turn at this rate. A head that fires at the same angles in each turn keeps them.
fn turn(head: &mut Rotating, rpm: f64, recording: &Recording) {
    let rpm = (1e3 * rpm).round() / 1e3;
    let firings = 60e6 / head.rpm / head.sequence_us;
    if (firings - firings.round()).abs() < 1e-6 {
        let mut counts: Vec<f64> = recording.rings.iter().map(|ring| ring.step.recip()).collect();
        let count = median(&mut counts).expect("invariant: what has figures has rings");
        let scale = 60e6 / rpm / count.round() / head.sequence_us;
        head.sequence_us *= scale;
        head.beam.iter_mut().for_each(|beam| beam.firing_us *= scale.min(1.0));
    }
    head.rpm = rpm;
}
