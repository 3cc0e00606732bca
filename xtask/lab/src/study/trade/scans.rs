//! Scans of all objects with one setting: their cost and their errors.

use super::objects::{Object, Place, places};
use super::sensors::Scanning;
use crate::measure::clock::{Workload, interleave, measured};
use crate::measure::energy::Energy;
use anyhow::Result;
use edgepuck_program::trade_record::{Part, Row};
use formats::chamfer::chamfer;
use formats::hash::Hashing;
use formats::scan::{Attribute, AttributeSet, Scan};
use formats::scan_file::{ScanFormat, write_scan};
use rayon::prelude::*;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::scan::{ScanRequest, scan_many};
use sim_gpu::internals::sensor::BeamPattern;
use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::hint::black_box;

/// A cloud as the classifier takes it.
pub type Cloud = Vec<[f32; 3]>;

/// The Chamfer distance is taken of one in so many scans, of all four sides in turn.
const CHAMFER_EACH: usize = 7;

/// A scan and its ranges without any effect.
struct Made {
    scan: Scan,
    /// Of each point of the scan.
    exact_m: Vec<f64>,
}

/// The scans of one setting.
pub struct Scanned {
    /// Costs and geometric errors, without the accuracy of classes.
    pub row: Row,
    /// One cloud a place.
    pub clouds: Vec<Cloud>,
}

/// Scans `objects` with all of `settings`, in turns, `rounds` times each.
pub fn scan_all(
    objects: &[Object],
    settings: &[Scanning],
    rounds: usize,
    test_set: &str,
) -> Result<Vec<Scanned>> {
    let patterns = settings.iter().map(|s| s.effects().widen(s.sensor.pattern(), &s.sensor));
    let patterns: Vec<BeamPattern> = patterns.collect::<Result<_, _>>()?;
    let energy = Energy::here();
    let mut joules: Vec<f64> = vec![0.0; settings.len()];
    let mut workloads: Vec<Workload<'_>> = Vec::new();
    for ((setting, pattern), joules) in settings.iter().zip(&patterns).zip(&mut joules) {
        let (energy, places) = (energy.as_ref(), places(objects, setting.distance_m));
        workloads.push(Box::new(move || {
            let before = energy.map(Energy::now);
            let (scans, cost) =
                measured(|| scan(&places, setting, pattern, &AttributeSet::default()));
            let spent = energy.zip(before).map_or(0.0, |(energy, then)| energy.joules_since(&then));
            *joules += spent / places.len() as f64;
            black_box(scans?);
            Ok(cost)
        }));
    }
    let costs = interleave(rounds, &mut workloads)?;
    drop(workloads);
    let mut truths: BTreeMap<u64, Vec<Made>> = BTreeMap::new();
    let mut all = Vec::new();
    for (i, (setting, pattern)) in settings.iter().zip(&patterns).enumerate() {
        let (noise_m, quantum_m) = (setting.noise_m, setting.range_quantum_m);
        let step =
            setting.azimuth_step_deg().map(|step| format!(" {step:.1}°")).unwrap_or_default();
        eprintln!(
            "{}: {}{step}, {} m, noise {noise_m} m, quantum {quantum_m} m",
            setting.parameter, setting.name, setting.distance_m
        );
        let truth = match truths.entry(setting.distance_m.to_bits()) {
            Entry::Occupied(known) => known.into_mut(),
            Entry::Vacant(place) => place.insert(truth_from(objects, setting.distance_m)?),
        };
        let Scanned { row, clouds } = assess(objects, setting, pattern, truth)?;
        let cpu_s = costs[i].cpu_s().median / clouds.len() as f64;
        let mut row = row.with_time(pattern.len(), cpu_s);
        row.test_set = test_set.to_owned();
        // The repeat that is not counted has its joules in the sum, too.
        row.joules = energy.is_some().then(|| joules[i] / (rounds + 1) as f64);
        all.push(Scanned { row, clouds });
    }
    Ok(all)
}

/// The errors of `setting` against the `truth` from the same places, and its clouds.
fn assess(
    objects: &[Object],
    setting: &Scanning,
    pattern: &BeamPattern,
    truth: &[Made],
) -> Result<Scanned> {
    let places = places(objects, setting.distance_m);
    let columns = AttributeSet::from([Attribute::Range, Attribute::Beam]);
    let made = scan(&places, setting, pattern, &columns)?;
    let (mut sum, mut worst, mut n) = (0.0, 0.0f64, 0usize);
    for made in &made {
        let ranges = made.scan.range_m.iter().flatten();
        for (range_m, exact_m) in ranges.zip(&made.exact_m) {
            let error = (f64::from(*range_m) - exact_m).abs();
            if error.is_nan() {
                // The middle of a wide beam met nothing.
                continue;
            }
            (sum, worst, n) = (sum + error * error, worst.max(error), n + 1);
        }
    }
    let clouds: Vec<Cloud> = made.into_iter().map(|made| made.scan.positions).collect();
    let n_points: usize = clouds.iter().map(Vec::len).sum();
    let row = Row {
        part: Part::Scan,
        knob: setting.parameter.to_owned(),
        sensor: setting.name.clone(),
        beams: Some(setting.beams()),
        azimuth_step_deg: setting.azimuth_step_deg(),
        range_quantum_m: Some(setting.range_quantum_m),
        distance_m: Some(setting.distance_m),
        noise_m: Some(setting.noise_m),
        caster: "cpu f32 watertight, f64 range".to_owned(),
        culling: "on".to_owned(),
        megabytes: Some(file_bytes(&clouds)? * 1e-6),
        points_per_scan: Some(n_points as f64 / clouds.len().max(1) as f64),
        range_rms_m: (n > 0).then(|| (sum / n as f64).sqrt()),
        range_worst_m: (n > 0).then_some(worst),
        chamfer_m: mean_chamfer(truth, &clouds),
        ..Row::default()
    };
    Ok(Scanned { row, clouds })
}

/// One scan a place, on the CPU, without files.
fn scan<'a>(
    places: &[Place<'a>],
    setting: &Scanning,
    pattern: &BeamPattern,
    attributes: &AttributeSet,
) -> Result<Vec<Made>> {
    let request = |place: &Place<'a>| {
        let mut request = ScanRequest::new(&setting.sensor, pattern, place.pose);
        (request.attributes, request.stream) = (attributes.clone(), place.stream);
        (&place.object.target, request)
    };
    let made = |sim_gpu::internals::scan::Scanned { scan, hits, .. }| {
        let hits = &hits[0].hits;
        let exact = |beam: &u32| {
            // That in the middle of a wide beam.
            let ray = beam * pattern.rays_per_beam;
            let at = hits.binary_search_by_key(&ray, |hit| hit.beam);
            at.map_or(f64::NAN, |at| hits[at].range_m)
        };
        let exact_m = scan.beam.iter().flatten().map(exact).collect();
        Made { scan, exact_m }
    };
    let requests: Vec<_> = places.iter().map(request).collect();
    let scans = scan_many(&OpenCaster::Cpu(setting.effects()), &requests)?;
    Ok(scans.into_iter().map(made).collect())
}

/// Mean bytes of an NPZ file of a scan.
fn file_bytes(clouds: &[Cloud]) -> Result<f64> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("scan.npz");
    let mut bytes = 0;
    for cloud in clouds {
        let scan = Scan { positions: cloud.clone(), ..Scan::default() };
        write_scan(&path, ScanFormat::Npz, Hashing::None, &scan)?;
        bytes += path.metadata()?.len();
    }
    Ok(bytes as f64 / clouds.len().max(1) as f64)
}

/// Some of the clean scans of the VLP-32C from `distance_m`.
fn truth_from(objects: &[Object], distance_m: f64) -> Result<Vec<Made>> {
    let clean = Scanning::clean(distance_m);
    let some: Vec<Place<'_>> =
        places(objects, distance_m).into_iter().step_by(CHAMFER_EACH).collect();
    scan(&some, &clean, &clean.sensor.pattern(), &AttributeSet::default())
}

/// The mean distance of those clouds to the `truth` from the same places; `None`
/// if there are none with points.
fn mean_chamfer(truth: &[Made], clouds: &[Cloud]) -> Option<f64> {
    let pairs: Vec<_> = truth.iter().zip(clouds.iter().step_by(CHAMFER_EACH)).collect();
    let distance = |(truth, cloud): &(&Made, &Cloud)| {
        let wide =
            |points: &[[f32; 3]]| points.iter().map(|p| p.map(f64::from)).collect::<Vec<_>>();
        chamfer(&wide(&truth.scan.positions), &wide(cloud)).plain
    };
    let distances: Vec<f64> = pairs.par_iter().map(distance).collect();
    let known: Vec<f64> = distances.into_iter().filter(|distance| distance.is_finite()).collect();
    (!known.is_empty()).then(|| known.iter().sum::<f64>() / known.len() as f64)
}
