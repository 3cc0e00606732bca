use super::plan::{Plan, chosen};
use super::{CorruptArgs, Written, ended, remove_former, usage, write_list};
use crate::Outcome;
use crate::points::SweepArgs;
use edgepuck_segment::{Label, Segmenter, Settings, Sweep};
use formats::atomic::UnfinishedFolder;
use formats::hash::Hashing;
use formats::scan_file::{ScanFormat, write_scan};
use formats::streams::Stream;
use formats::{Scan, counted};
use glam::DVec3;
use sim_gpu::effects::{Detection, Effects};
use sim_gpu::glam;
use sim_gpu::recorded::{Air, in_weather};
use sim_gpu::recorded::{Corruption, Recorded};
use sim_gpu::sensors::{DetectionLimit, SensorProfile};
use std::path::Path;

/// Writes a scan for each corruption and severity.
pub(super) fn run(
    args: &CorruptArgs,
    input: &SweepArgs,
    out: &Path,
    plan: &Plan,
    sensor: &SensorProfile,
) -> anyhow::Result<Outcome> {
    let chosen = chosen(&plan.sweep, &args.only, &args.severity)?;
    let any = |is: fn(&Corruption) -> bool| chosen.iter().any(|(_, _, corruption)| is(corruption));
    let scan = input.read_whole()?;
    let brightness = match args.brightness.brightness_of(&scan, &input.sweep) {
        Ok(brightness) => Some(brightness),
        Err(error) if any(takes_light) => return Err(error),
        Err(_) => None,
    };
    let limit = any(takes_light).then(|| limit_of(sensor)).transpose()?;
    let limit = limit.unwrap_or(DetectionLimit { reflectivity: 1.0, range_m: 1.0 });
    let sensor_m = DVec3::from_array(input.sensor_m(&scan));
    let is_ground = match any(|corruption| matches!(corruption, Corruption::WetGround { .. })) {
        true => ground(input, &scan, sensor_m)?,
        false => Vec::new(),
    };

    remove_former(out, &input.sweep)?;
    let begun = UnfinishedFolder::begin_new(out);
    let is_dark = brightness.is_none();
    let (mut written, mut too_weak_before) = (Vec::new(), 0);
    for (entry, severity, corruption) in chosen {
        let stream = Stream::CorruptedSweep { corruption: &entry.name, severity }.key(args.seed);
        let dark = vec![0.0; scan.len()];
        let (scan, is_ground) = (&scan, &is_ground[..]);
        let range_m = [sensor.range.min_m, sensor.range.max_m];
        let brightness = brightness.as_deref().unwrap_or(&dark);
        let recorded = Recorded { scan, brightness, is_ground, sensor_m, limit, range_m, stream };
        let name = format!("{}-{severity}", entry.name);
        let Some(mut found) = corrupted(&recorded, corruption, sensor) else {
            let lacks = match corruption {
                Corruption::Motion { .. } => "times",
                _ => "rings",
            };
            program::say!("{name}: left out, since the points of the sweep have no {lacks}");
            continue;
        };
        if is_dark {
            found.intensity = None;
        }
        args.brightness.restore(&mut found);
        let file = format!("{name}.npz");
        write_scan(&out.join(&file), ScanFormat::Npz, Hashing::None, &found)?;
        program::say!("{name:<20} {:>9} of {} points", found.len(), scan.len());
        if takes_light(corruption) {
            too_weak_before = too_weak_before.max(recorded.too_weak_before());
        }
        let (corruption, by, count, of) = (&*entry.name, &*entry.by, found.len(), scan.len());
        written.push(Written { file, corruption, severity, count, of, by });
    }
    if !written.is_empty() {
        write_list(&written, out)?;
        begun.into_iter().for_each(UnfinishedFolder::finish);
    }
    if too_weak_before > 0 {
        program::say!(
            "warning: {too_weak_before} of the points are below the sensor's detection limit as \
             they were recorded: see --sensor, --white and --reflectivity"
        );
    }
    program::say!("{}: {}", counted(written.len(), "scan"), out.display());
    Ok(ended(&written))
}

/// Whether the corruption depends on the power of returns.
fn takes_light(corruption: &Corruption) -> bool {
    use Corruption::{DirtyWindow, Weather, WetGround};
    matches!(corruption, Weather(_) | WetGround { .. } | DirtyWindow { .. })
}

/// The weakest return that `sensor` detects.
fn limit_of(sensor: &SensorProfile) -> anyhow::Result<DetectionLimit> {
    let asked = Effects { detection: Some(Detection::default()), ..Effects::default() };
    let effects = asked.for_sensor(sensor).map_err(usage)?;
    let limit = effects.detection.and_then(|detection| detection.limit);
    Ok(limit.expect("invariant: the default of `detection` is the sensor's limit"))
}

/// The scan with this corruption. `None` if it lacks the times or rings that the corruption needs.
fn corrupted(recorded: &Recorded, corruption: &Corruption, sensor: &SensorProfile) -> Option<Scan> {
    match corruption {
        Corruption::Weather(weather) => {
            let Recorded { scan, brightness, sensor_m, limit, stream, .. } = *recorded;
            let air = Air::new(weather, sensor.beam_divergence_deg(), &limit, &sensor.range);
            Some(in_weather(scan, brightness, sensor_m, &air, &limit, stream).0)
        }
        Corruption::WetGround { film_m } => Some(recorded.wet_ground(*film_m)),
        Corruption::Motion { speed_m_s, yaw_rate_deg_s } => {
            recorded.motion(*speed_m_s, *yaw_rate_deg_s)
        }
        Corruption::BeamsMissing { share } => recorded.beams_missing(*share),
        Corruption::Crosstalk { share } => Some(recorded.crosstalk(*share)),
        Corruption::DirtyWindow { transmission } => Some(recorded.dirty_window(*transmission)),
        Corruption::FewerBeams { lasers, keep_each } => recorded.fewer_beams(*lasers, *keep_each),
    }
}

/// Whether each point is on the ground, by the segmentation that a robot runs.
fn ground(input: &SweepArgs, scan: &Scan, sensor_m: DVec3) -> anyhow::Result<Vec<bool>> {
    let origin = DVec3::from_array(scan.origin) - sensor_m;
    let from_sensor = |point: &[f32; 3]| (origin + DVec3::from(point.map(f64::from))).as_vec3();
    let points: Vec<[f32; 3]> = scan.positions.iter().map(|p| from_sensor(p).to_array()).collect();
    input.warn_of_frame(&points);
    let mut segmenter = Segmenter::new(Settings::default()).map_err(usage)?;
    let found = segmenter.segment(&Sweep { points: &points, rings: scan.ring.as_deref() })?;
    Ok(found.labels().iter().map(|label| *label == Label::Ground).collect())
}
