//! The objects that are scanned, from which places, and the cost and errors of each setting.

use super::sensors::Scanning;
use crate::measure::clock::{Workload, interleave, workload};
use crate::study::datasets::keep_at_most;
use anyhow::{Context, Result, ensure};
use edgepuck_program::trade_record::{Measurement, Part};
use formats::chamfer::chamfer;
use formats::hash::Hashing;
use formats::rng::StreamKey;
use formats::scan::{Attribute, AttributeSet, Scan};
use formats::scan_file::{ScanFormat, write_scan};
use glam::DVec3;
use rayon::prelude::*;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::mesh::tree::{MeshEntry, discover};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, scan_objects};
use sim_gpu::internals::sensor::{BeamPattern, Views};
use sim_gpu::internals::target::Target;
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

pub type Cloud = Vec<[f32; 3]>;

/// The Chamfer distance is measured on every `CHAMFER_EACH`-th scan, of all four sides in turn.
const CHAMFER_EACH: usize = 7;

struct Made {
    scan: Scan,
    exact_m: Vec<f64>,
}

pub struct Scanned {
    /// Costs and geometric errors, without the accuracy of classes.
    pub row: Measurement,
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
    let mut workloads: Vec<Workload<'_>> = Vec::new();
    for (setting, pattern) in settings.iter().zip(&patterns) {
        let places = places(objects, setting.distance_m);
        workloads.push(workload(move || scan(&places, setting, pattern, &AttributeSet::default())));
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
    let row = Measurement {
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
        ..Measurement::default()
    };
    Ok(Scanned { row, clouds })
}

fn scan(
    places: &[Place<'_>],
    setting: &Scanning,
    pattern: &BeamPattern,
    attributes: &AttributeSet,
) -> Result<Vec<Made>> {
    let caster = OpenCaster::Cpu(setting.effects());
    let made = |place: &Place<'_>| {
        let mut request = ScanRequest::new(&setting.sensor, pattern, place.pose);
        (request.attributes, request.stream) = (attributes.clone(), place.stream);
        let scanned = scan_objects(&caster, &[PlacedTarget::new(&place.object.target)], &request)?;
        let (scan, hits) = (scanned.scan, &scanned.hits[0].hits);
        let exact = |beam: &u32| {
            // That in the middle of a wide beam.
            let ray = beam * pattern.rays_per_beam;
            let at = hits.binary_search_by_key(&ray, |hit| hit.beam);
            at.map_or(f64::NAN, |at| hits[at].range_m)
        };
        let exact_m = scan.beam.iter().flatten().map(exact).collect();
        Ok(Made { scan, exact_m })
    };
    places.par_iter().map(made).collect()
}

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

/// Keys all random numbers of the chain.
pub const SEED: u64 = 0;

pub struct Object {
    pub class: String,
    /// Class and name.
    id: String,
    pub target: Target,
}

/// One scan to be made: an object from one of its sides.
pub struct Place<'a> {
    pub object: &'a Object,
    pub pose: Pose,
    /// Keys its noise.
    pub stream: StreamKey,
}

/// The test objects of the tree at `folder`, at most `per_class` of each class.
pub fn read(folder: &Path, per_class: u32) -> Result<Vec<Object>> {
    let mut entries = discover(folder, SEED)?;
    keep_at_most([0, per_class], &mut entries);
    let classes: BTreeSet<&str> = entries.iter().map(|entry| entry.class.as_str()).collect();
    ensure!(
        classes.len() > 1,
        "{}: expected test meshes of at least two classes",
        folder.display()
    );
    let object = |entry: &MeshEntry| {
        let mesh = sim_gpu::Mesh::read(&entry.path)
            .with_context(|| format!("cannot scan {}", entry.relative))?;
        let target = mesh.unit_sphere().target().clone();
        let id = format!("{}/{}", entry.class, entry.name);
        Ok(Object { class: entry.class.clone(), id, target })
    };
    entries.iter().map(object).collect()
}

/// The four sides of gen-dataset's rotating set, from `distance_m`.
pub fn places(objects: &[Object], distance_m: f64) -> Vec<Place<'_>> {
    let views = Views { distance_m, ..Views::ROTATING };
    let of_object = objects.iter().flat_map(|object| {
        let poses = views.poses(DVec3::ZERO, StreamKey::new(SEED, "trade", 0));
        poses.into_iter().zip(0..).map(move |(pose, view)| {
            // As gen-dataset keys its set `rotational`.
            let stream = StreamKey::new(SEED, &format!("rotational/{}", object.id), view);
            Place { object, pose, stream }
        })
    });
    of_object.collect()
}
