//! The casters, with and without culling of beams that cannot hit.

use super::scans::{Cloud, Object, Place, Scanned, places};
use super::sensors::Scanning;
use crate::measure::backends::{Backend, short};
use crate::measure::clock::{Workload, interleave, measured};
use crate::measure::methods::{self, Accuracy};
use crate::measure::ray_set::RaySet;
use anyhow::Result;
use edgepuck_program::trade_record::{Measurement, Part};
use glam::DVec3;
use rayon::prelude::*;
use sim_gpu::effects::Effects;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::job::{CastJob, Culling};
use std::collections::HashMap;
use std::hint::black_box;

/// The ranges of one ray_set's rays, metres.
type Ranges = Vec<Option<f64>>;

enum Method<'a> {
    Oracle,
    MollerTrumbore,
    /// The watertight test, and ranges in f32.
    F32,
    /// The product: the watertight test in f32, ranges in f64.
    Product(&'a OpenCaster),
}

struct Aimed {
    culling: Culling,
    ray_sets: Vec<RaySet>,
    jobs: Vec<CastJob>,
}

pub fn cast_all(
    objects: &[Object],
    backends: &[Backend],
    rounds: usize,
    test_set: &str,
) -> Result<Vec<Scanned>> {
    let cpu = OpenCaster::Cpu(Effects::default());
    let mut methods = vec![
        ("cpu f64".to_owned(), Method::Oracle, false),
        ("cpu f32 Möller-Trumbore, f32 range".to_owned(), Method::MollerTrumbore, false),
        ("cpu f32 watertight, f32 range".to_owned(), Method::F32, false),
        ("cpu f32 watertight, f64 range".to_owned(), Method::Product(&cpu), false),
    ];
    let adapters = backends.iter().filter(|backend| backend.name() != "cpu");
    methods.extend(adapters.map(|backend| {
        let name = format!("{} f32 watertight, f64 range", short(backend.name()));
        (name, Method::Product(&backend.caster), backend.is_gpu)
    }));
    let aimed = [Culling::On, Culling::Off].map(|culling| Aimed::at(objects, culling));
    let settings: Vec<_> =
        aimed.iter().flat_map(|aimed| methods.iter().map(move |method| (method, aimed))).collect();
    let mut workloads: Vec<Workload<'_>> = Vec::new();
    for &((_, method, _), aimed) in &settings {
        workloads.push(Box::new(move || {
            let (ranges, cost) = measured(|| method.cast(aimed));
            black_box(ranges?);
            Ok(cost)
        }));
    }
    let costs = interleave(rounds, &mut workloads)?;
    drop(workloads);
    let fired = &aimed[1].ray_sets;
    let truth: Vec<Ranges> = fired.par_iter().map(methods::in_f64).collect();
    let rays = Scanning::reference().sensor.pattern().len();
    let mut all = Vec::new();
    for (((name, method, is_gpu), aimed), costs) in settings.into_iter().zip(costs) {
        let culling = if aimed.culling == Culling::On { "on" } else { "off" };
        eprintln!("caster: {name}, culling {culling}");
        let Scanned { row, clouds } = assess(method, aimed, fired, &truth)?;
        let spent = if *is_gpu { costs.wall_s() } else { costs.cpu_s() };
        let mut row = row.with_time(rays, spent.median / clouds.len() as f64);
        (row.caster, row.culling) = (name.clone(), culling.to_owned());
        row.test_set = test_set.to_owned();
        if *is_gpu {
            (row.rays_per_cpu_s, row.scans_per_cpu_s) = (None, None);
        }
        all.push(Scanned { row, clouds });
    }
    Ok(all)
}

impl Aimed {
    fn at(objects: &[Object], culling: Culling) -> Self {
        let clean = Scanning::clean(Scanning::reference().distance_m);
        let pattern = clean.sensor.pattern();
        let aim =
            |place: &Place<'_>| RaySet::sweep(&place.object.target, &place.pose, &pattern, culling);
        let ray_sets: Vec<RaySet> = places(objects, clean.distance_m).par_iter().map(aim).collect();
        let jobs = ray_sets.iter().map(|ray_set| ray_set.job.clone()).collect();
        Self { culling, ray_sets, jobs }
    }
}

impl Method<'_> {
    fn cast(&self, Aimed { ray_sets, jobs, .. }: &Aimed) -> Result<Vec<Ranges>> {
        Ok(match self {
            Self::Oracle => ray_sets.iter().map(methods::in_f64).collect(),
            Self::MollerTrumbore => ray_sets.iter().map(methods::moller_trumbore).collect(),
            Self::F32 => ray_sets.iter().map(methods::watertight_in_f32).collect(),
            Self::Product(caster) => {
                let casts = caster.cast(jobs)?;
                ray_sets
                    .par_iter()
                    .zip(&casts)
                    .map(|(ray_set, cast)| ray_set.ranges(cast))
                    .collect()
            }
        })
    }
}

fn assess(
    method: &Method<'_>,
    aimed: &Aimed,
    fired: &[RaySet],
    truth: &[Ranges],
) -> Result<Scanned> {
    let ranges = method.cast(aimed)?;
    let of_all = aimed.ray_sets.iter().zip(&ranges).zip(fired).map(|((a, r), f)| of_fired(a, r, f));
    let accuracy = Accuracy::of(&of_all.collect::<Vec<_>>().concat(), &truth.concat());
    let wrong = accuracy.false_hits_per_million() + accuracy.misses_per_million();
    let clouds: Vec<Cloud> = aimed.ray_sets.iter().zip(&ranges).map(|(s, r)| cloud(s, r)).collect();
    let points: usize = clouds.iter().map(Vec::len).sum();
    let row = Measurement {
        part: Part::Caster,
        knob: "caster".to_owned(),
        sensor: Scanning::reference().name,
        points_per_scan: Some(points as f64 / clouds.len() as f64),
        range_rms_m: Some(accuracy.rms_m),
        range_worst_m: Some(accuracy.worst_m),
        wrong_rays_per_million: Some(wrong),
        ..Measurement::default()
    };
    Ok(Scanned { row, clouds })
}

/// The ranges of all fired rays; `None` for culled rays.
fn of_fired(aimed: &RaySet, ranges: &Ranges, fired: &RaySet) -> Ranges {
    let by_beam: HashMap<u32, Option<f64>> =
        aimed.job.beams.iter().copied().zip(ranges.iter().copied()).collect();
    fired.job.beams.iter().map(|beam| by_beam.get(beam).copied().flatten()).collect()
}

/// The points that a ray_set's rays hit, in the order of its beams.
fn cloud(ray_set: &RaySet, ranges: &Ranges) -> Cloud {
    let rays = ray_set.job.beams.iter().zip(ray_set.in_world()).zip(ranges);
    let hit = |((&beam, (origin, direction)), range): ((&u32, (DVec3, DVec3)), &Option<f64>)| {
        range.map(|range_m| (beam, (origin + range_m * direction).as_vec3().to_array()))
    };
    let mut points: Vec<(u32, [f32; 3])> = rays.filter_map(hit).collect();
    points.sort_unstable_by_key(|(beam, _)| *beam);
    points.into_iter().map(|(_, point)| point).collect()
}
