use crate::Outcome;
use crate::flags::warn_of_sensor;
use formats::{atomic, counted};
use glam::DVec3;
use program::outputs::{Overwrite, need_extension};
use program::significant_digits::digits;
use sim_gpu::glam;
use sim_gpu::sensors::{BeamPattern, Layout, SensorProfile, builtin_names};
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct ProfileArgs {
    /// Sensor to check and describe: a built-in name, a TOML file, or the metadata (JSON) of an
    /// Ouster [default: list the built-in sensors]
    #[arg(value_name = "SENSOR")]
    sensor: Option<String>,

    /// Write every beam of a scan to this CSV file: time_s, ring, azimuth_deg (counterclockwise
    /// from forward), elevation_deg, and where it starts: x_m, y_m, z_m
    #[arg(long, value_name = "FILE", requires = "sensor")]
    beams: Option<PathBuf>,

    #[command(flatten)]
    overwrite: Overwrite,
}

/// Lists the built-in sensors, or describes one sensor. Prints warnings about unusual values of a
/// valid profile to standard error.
pub fn run(args: &ProfileArgs) -> anyhow::Result<Outcome> {
    let mut out = std::io::stdout().lock();
    let Some(name) = &args.sensor else {
        for name in builtin_names() {
            let sensor = SensorProfile::builtin(name).expect("invariant: a built-in name");
            writeln!(out, "{name:<20} {}", sensor.description)?;
        }
        return Ok(Outcome::Success);
    };
    args.beams.iter().try_for_each(|file| need_extension("--beams", file, &["csv"]))?;
    args.overwrite.check(args.beams.as_deref())?;
    let sensor = SensorProfile::resolve(name)?;
    let pattern = sensor.pattern();
    out.write_all(described(&sensor, &pattern).as_bytes())?;
    warn_of_sensor(&sensor);
    for oddity in oddities(&sensor, pattern.len()) {
        program::say!("warning: {oddity}");
    }
    if let Some(file) = &args.beams {
        atomic::write_bytes(file, beams(&pattern))?;
        program::say!("{}: {}", counted(pattern.len(), "beam"), file.display());
    }
    Ok(Outcome::Success)
}

/// A description of the sensor's scans, with a line for each property.
fn described(sensor: &SensorProfile, pattern: &BeamPattern) -> String {
    let mut text = format!("{}: {}\n", sensor.name, sensor.description);
    let mut line = |name: &str, value: String| {
        writeln!(text, "{name:<18} {value}").expect("invariant: a string takes all");
    };
    let kind = match &sensor.layout {
        Layout::Rotating(head) => counted(head.beam.len(), "beam") + " on a head that turns",
        Layout::Uniform(_) => "regular angles".to_owned(),
        Layout::Grid(grid) => format!("{} x {} pixels", grid.width, grid.height),
        Layout::Risley(risley) => {
            counted(risley.line.len(), "line") + " behind " + &counted(risley.prism.len(), "prism")
        }
        Layout::Table(table) => format!("a table of {} directions", table.directions_deg.len()),
    };
    line("layout", kind);
    line("rays of a scan", pattern.len().to_string());
    let last_s = pattern.last_s();
    if last_s > 0.0 {
        line("time of a scan", format!("{} s", digits(last_s)));
    }
    let [lowest, highest] = ends(pattern.directions.iter().map(elevation_deg));
    line("elevations", format!("{lowest:.3} to {highest:.3} degrees"));
    if let Some(step_rad) = sensor.angular_step_rad() {
        line("least step", format!("{} degrees", digits(step_rad.to_degrees())));
    }
    let range = &sensor.range;
    let quantum = range.quantum_m.map(|m| format!(", in steps of {m} m")).unwrap_or_default();
    line("range", format!("{} to {} m{quantum}", range.min_m, range.max_m));
    let stated = |found: Option<String>| found.unwrap_or_else(|| "not stated".to_owned());
    let measured = |m| format!(", {m} m from turn to turn");
    line(
        "noise",
        stated(sensor.noise.map(|noise| {
            let measured = noise.repeatability_m.map(measured).unwrap_or_default();
            format!("{} m{measured}", noise.typical_sigma_m)
        })),
    );
    line(
        "detects",
        stated(sensor.detection.map(|limit| {
            format!("{} % at {} m", digits(100.0 * limit.reflectivity), limit.range_m)
        })),
    );
    line(
        "beams are",
        stated(sensor.footprint.map(|shape| {
            let [wide, high] = shape.divergence_deg;
            format!("{wide} x {high} degrees wide; returns {} m apart", shape.separation_m)
        })),
    );
    for source in &sensor.sources {
        line("source", source.clone());
    }
    text
}

/// What else is probably a mistake in a valid profile.
fn oddities(sensor: &SensorProfile, n_rays: usize) -> Vec<String> {
    let few = || format!("a scan has only {}", counted(n_rays, "ray"));
    let mut found: Vec<String> = (n_rays < 100).then(few).into_iter().collect();
    if let Layout::Uniform(raster) = &sensor.layout
        && (raster.azimuth_to_deg - raster.azimuth_from_deg).rem_euclid(360.0) == 0.0
        && raster.azimuth_steps > 1
    {
        let cause = "uniform: the first and the last azimuth are the same direction";
        found.push(cause.to_owned());
    }
    if let Some(limit) = sensor.detection
        && limit.power() * sensor.range.max_m.powi(2) > 1.0 + 1e-9
    {
        let reach_m = limit.power().recip().sqrt();
        found.push(format!(
            "detection: even a white surface is lost beyond {reach_m:.1} m, before range.max_m = {} m",
            sensor.range.max_m
        ));
    }
    if let Layout::Rotating(head) = &sensor.layout {
        for (i, beam) in head.beam.iter().enumerate() {
            let same = |other: &&sim_gpu::sensors::Beam| {
                other.elevation_deg == beam.elevation_deg
                    && other.azimuth_offset_deg == beam.azimuth_offset_deg
            };
            if let Some(first) = head.beam[..i].iter().position(|other| same(&other)) {
                found.push(format!("rotating.beam[{i}] points as rotating.beam[{first}] does"));
            }
        }
    }
    found
}

fn beams(pattern: &BeamPattern) -> String {
    let mut text = "time_s,ring,azimuth_deg,elevation_deg,x_m,y_m,z_m\n".to_owned();
    for (ray, direction) in (0..).zip(&pattern.directions) {
        let [time_s, ring] = [pattern.time_s[ray as usize], pattern.ring[ray as usize].into()];
        let azimuth_deg = libm::atan2(direction.y, direction.x).to_degrees();
        // Adding zero turns minus zero into zero.
        let [x, y, z] = (pattern.start(ray).unwrap_or_default() + DVec3::ZERO).to_array();
        let elevation_deg = elevation_deg(direction);
        writeln!(text, "{time_s},{ring},{azimuth_deg},{elevation_deg},{x},{y},{z}")
            .expect("invariant: a string takes all");
    }
    text
}

fn elevation_deg(direction: &DVec3) -> f64 {
    libm::asin(direction.z.clamp(-1.0, 1.0)).to_degrees()
}

fn ends(numbers: impl Iterator<Item = f64>) -> [f64; 2] {
    numbers.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], x| [a.min(x), b.max(x)])
}
