use crate::brightness::BrightnessArgs;
use crate::flags::of_flag;
use crate::points::SweepArgs;
use crate::{Outcome, Usage};
use formats::Scan;
use formats::hash::Hashing;
use formats::outputs::Overwrite;
use formats::scan_file::{ScanFormat, write_scan};
use formats::streams::Stream;
use glam::DVec3;
use sim_gpu::effects::{Effects, FogModel, Weather};
use sim_gpu::glam;
use sim_gpu::internals::sensor::SensorProfile;
use sim_gpu::internals::weather::{Air, Fates, Medium, in_weather};
use std::path::PathBuf;

#[derive(clap::Args)]
pub struct WeatherArgs {
    #[command(flatten)]
    input: SweepArgs,

    /// File to write: .npz, .ply, .csv or .pcd. It holds the strongest return of each beam that still has
    /// one. `intensity` is the intensity in the weather, and `medium` is the source of the return:
    /// 0 a surface, 1 rain, 2 snow, 3 fog
    #[arg(long, value_name = "FILE")]
    out: PathBuf,

    #[command(flatten)]
    overwrite: Overwrite,

    /// Rain, millimetres per hour
    #[arg(long, value_name = "MM/H")]
    rain: Option<f64>,

    /// Snow, millimetres of water per hour
    #[arg(long, value_name = "MM/H")]
    snow: Option<f64>,

    /// Fog with this visibility, metres
    #[arg(long, value_name = "M")]
    fog: Option<f64>,

    /// Model of the fog's returns: `physical`, by the scattered power, or `hahner`, in proportion
    /// to the return of the surface behind the fog, as in the simulation of Hahner et al. (ICCV
    /// 2021)
    #[arg(long, value_name = "MODEL", default_value = "physical", requires = "fog")]
    fog_model: FogModel,

    /// Haze with this visibility, metres
    #[arg(long, value_name = "M")]
    haze: Option<f64>,

    /// Sensor that recorded the scan: a built-in name or a TOML file. Its detection limit, beam
    /// width and minimum range determine which returns are detected
    #[arg(long, default_value = "vlp32c", value_name = "NAME")]
    profile: String,

    #[command(flatten)]
    brightness: BrightnessArgs,

    /// Seed of all random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

pub fn run(args: &WeatherArgs) -> anyhow::Result<Outcome> {
    let format = ScanFormat::of_path(&args.out)?;
    if format == ScanFormat::Pcap {
        let cause = "--out: expected .npz, .ply, .csv or .pcd, as packets hold a sensor's ranges";
        return Err(Usage(cause.to_owned()).into());
    }
    let weather = args.weather();
    weather.validate().map_err(of_flag)?;
    if weather.is_clear() {
        let cause = "expected one of --rain, --snow, --fog and --haze, above 0";
        return Err(Usage(cause.to_owned()).into());
    }
    let sensor = SensorProfile::resolve(&args.profile)?;
    let asked = Effects { weather: Some(Box::new(weather.clone())), ..Effects::default() };
    let effects = asked.for_sensor(&sensor).map_err(|error| Usage(error.to_string()))?;
    let limit = effects.detection.and_then(|detection| detection.limit);
    let limit = limit.expect("invariant: weather needs a detection limit");

    args.overwrite.check([&*args.out])?;
    let scan = args.input.read_whole()?;
    let brightness = args.brightness.brightness_of(&scan, &args.input.sweep)?;
    let air = Air::new(&weather, sensor.beam_divergence_deg(), &limit, &sensor.range);
    let stream = Stream::Weather {}.key(args.seed);
    let sensor_m = DVec3::from_array(args.input.sensor_m(&scan));
    let (mut changed, fates) = in_weather(&scan, &brightness, sensor_m, &air, &limit, stream);
    args.brightness.restore(&mut changed);
    write_scan(&args.out, format, Hashing::None, &changed)?;
    report(&fates, &changed);
    formats::say!("{} points: {}", changed.len(), args.out.display());
    if changed.is_empty() {
        formats::say!("warning: no point is left: expected milder weather, or another --profile");
        return Ok(Outcome::SomeRefused);
    }
    Ok(Outcome::Success)
}

impl WeatherArgs {
    fn weather(&self) -> Weather {
        Weather {
            rain_mm_h: self.rain,
            snow_mm_h: self.snow,
            fog_visibility_m: self.fog,
            fog_model: self.fog_model,
            haze_visibility_m: self.haze,
            ..Weather::default()
        }
    }
}

/// Prints the numbers of kept, added and lost points.
fn report(fates: &Fates, changed: &Scan) {
    let all = fates.kept + fates.scattered + fates.lost + fates.passed_over;
    let line = |what: &str, count: usize| {
        formats::say!("{what:<12}{count:>10}  {:5.1} %", 100.0 * count as f64 / all.max(1) as f64);
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
        formats::say!("  (too weak for the profile's detection limit in clear air, too)");
    }
    if fates.passed_over > 0 {
        line("no point", fates.passed_over);
    }
}
