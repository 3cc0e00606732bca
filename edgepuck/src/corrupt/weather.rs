//! `edgepuck corrupt --rain 25`: weather in a recorded scan.

use super::{CorruptArgs, usage};
use crate::flags::{first_given, of_flag};
use crate::points::SweepArgs;
use crate::{Outcome, Usage};
use formats::hash::Hashing;
use formats::scan_file::{ScanFormat, write_scan};
use formats::streams::Stream;
use formats::{Scan, counted};
use glam::DVec3;
use sim_gpu::effects::{Effects, Weather};
use sim_gpu::glam;
use sim_gpu::recorded::{Air, Fates, Medium, in_weather};
use sim_gpu::sensors::SensorProfile;

#[derive(clap::Args)]
#[command(next_help_heading = "Weather, in place of the corruptions")]
pub(super) struct WeatherArgs {
    /// Rain, millimetres per hour
    #[arg(long, value_name = "MM/H")]
    rain: Option<f64>,

    /// Snow, millimetres of water per hour
    #[arg(long, value_name = "MM/H")]
    snow: Option<f64>,

    /// Fog with this visibility, metres
    #[arg(long, value_name = "M")]
    fog: Option<f64>,

    /// Haze with this visibility, metres
    #[arg(long, value_name = "M")]
    haze: Option<f64>,
}

impl WeatherArgs {
    /// A flag that was given.
    pub(super) fn given(&self) -> Option<&'static str> {
        first_given(&[
            (self.rain.is_some(), "--rain"),
            (self.snow.is_some(), "--snow"),
            (self.fog.is_some(), "--fog"),
            (self.haze.is_some(), "--haze"),
        ])
    }

    fn weather(&self) -> Weather {
        Weather {
            rain_mm_h: self.rain,
            snow_mm_h: self.snow,
            fog_visibility_m: self.fog,
            haze_visibility_m: self.haze,
            ..Weather::default()
        }
    }
}

/// Writes the strongest return of each beam that still has one in the weather.
pub(super) fn run(
    args: &CorruptArgs,
    input: &SweepArgs,
    sensor: &SensorProfile,
) -> anyhow::Result<Outcome> {
    let out = args.out.as_deref();
    let out = out.ok_or_else(|| usage("expected --out FILE for a scan in weather"))?;
    let format = ScanFormat::of_path(out)?;
    if format == ScanFormat::Pcap {
        let cause = "--out: expected .npz, .ply, .csv or .pcd, as packets hold a sensor's ranges";
        return Err(usage(cause).into());
    }
    let weather = args.weather.weather();
    weather.validate().map_err(of_flag)?;
    if weather.is_clear() {
        return Err(usage("expected one of --rain, --snow, --fog and --haze, above 0").into());
    }
    let asked = Effects { weather: Some(Box::new(weather.clone())), ..Effects::default() };
    let effects = asked.for_sensor(sensor).map_err(|error| Usage(error.to_string()))?;
    let limit = effects.detection.and_then(|detection| detection.limit);
    let limit = limit.expect("invariant: weather needs a detection limit");

    args.overwrite.check([out])?;
    let scan = input.read_whole()?;
    let brightness = args.brightness.brightness_of(&scan, &input.sweep)?;
    let air = Air::new(&weather, sensor.beam_divergence_deg(), &limit, &sensor.range);
    let stream = Stream::Weather {}.key(args.seed);
    let sensor_m = DVec3::from_array(input.sensor_m(&scan));
    let (mut changed, fates) = in_weather(&scan, &brightness, sensor_m, &air, &limit, stream);
    args.brightness.restore(&mut changed);
    write_scan(out, format, Hashing::None, &changed)?;
    report(&fates, &changed);
    program::say!("{}: {}", counted(changed.len(), "point"), out.display());
    if changed.is_empty() {
        program::say!("warning: no point is left: expected milder weather, or another --sensor");
        return Ok(Outcome::SomeRefused);
    }
    Ok(Outcome::Success)
}

/// Prints the numbers of kept, added and lost points.
fn report(fates: &Fates, changed: &Scan) {
    let all = fates.kept + fates.scattered + fates.lost + fates.passed_over;
    let line = |what: &str, count: usize| {
        program::say!("{what:<12}{count:>10}  {:5.1} %", 100.0 * count as f64 / all.max(1) as f64);
    };
    line("kept", fates.kept);
    for medium in Medium::ALL.into_iter().filter(|medium| *medium != Medium::Surface) {
        let is_this = |found: &&u8| **found == medium as u8;
        let count = changed.medium.iter().flatten().filter(is_this).count();
        if count > 0 {
            line(medium.name(), count);
        }
    }
    line("lost", fates.lost);
    if fates.too_weak_before > 0 {
        line("  before", fates.too_weak_before);
        program::say!("  (too weak for the sensor's detection limit in clear air, too)");
    }
    if fates.passed_over > 0 {
        line("no point", fates.passed_over);
    }
}
