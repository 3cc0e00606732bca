//! Which builder is faster for how many rays.
//!
//! [`sim_gpu::bvh::Builder::for_rays`] rests on these figures.

use crate::measure::bench_mesh::BenchMesh;
use crate::measure::clock::{Cost, Costs, measured};
use crate::measure::ray_set::RaySet;
use crate::measure::ray_set::vlp32c;
use crate::render::table::{Table, digits, milliseconds};
use anyhow::Result;
use glam::DVec3;
use serde::Serialize;
use sim_gpu::bvh::Builder;
use sim_gpu::cpu::trace;
use sim_gpu::job::{Cast, Culling};
use sim_gpu::mesh::validate;
use sim_gpu::pose::ring_of_views;
use sim_gpu::sensor::BeamPattern;
use sim_gpu::target::{Surface, Target};
use std::hint::black_box;

/// Rays cast at each mesh, in turn.
const RAYS: [usize; 5] = [1_000, 10_000, 30_000, 100_000, 1_000_000];

/// Rays of one view of the default sensor at the default distance.
const RAYS_PER_VIEW: usize = 5_700;

/// One builder, and some rays cast at one mesh.
#[derive(Serialize)]
pub struct Measurement {
    mesh: String,
    triangles: usize,
    rays: usize,
    /// `Sah` or `Morton`.
    #[serde(rename = "way")]
    builder: &'static str,
    build: Costs,
    trace: Costs,
    /// Rays whose range is not, bit for bit, that found through the SAH tree.
    different: usize,
}

/// All builders, numbers of rays and meshes.
#[derive(Serialize)]
pub struct Measurements(Vec<Measurement>);

/// Measures each of `bench_meshes` in `rounds` rounds on the CPU.
///
/// # Errors
/// None: the CPU caster cannot fail.
pub fn measure(bench_meshes: &[BenchMesh], rounds: usize) -> Result<Measurements> {
    let pattern = vlp32c();
    let mut measurements = Vec::new();
    for bench_mesh in bench_meshes {
        eprintln!("{}", bench_mesh.name);
        for rays in RAYS {
            measurements.extend(at(bench_mesh, &pattern, rays, rounds));
        }
    }
    Ok(Measurements(measurements))
}

fn at(
    bench_mesh: &BenchMesh,
    pattern: &BeamPattern,
    rays: usize,
    rounds: usize,
) -> Vec<Measurement> {
    let surface =
        Surface::new(bench_mesh.mesh.clone(), validate::triangle_stats(&bench_mesh.mesh).kept);
    let sah = Target::new(surface.clone(), Builder::Sah);
    let ray_sets = views(&sah, pattern, rays);
    let truth: Vec<_> = ray_sets.iter().map(|ray_set| ray_set.ranges(&codes_of(ray_set))).collect();
    let mut measurements =
        [("Sah", Builder::Sah), ("Morton", Builder::Morton)].map(|(name, builder)| {
            let measurement = Measurement {
                mesh: bench_mesh.name.clone(),
                triangles: surface.kept().len(),
                rays: ray_sets.iter().map(|ray_set| ray_set.rays.len()).sum(),
                builder: name,
                build: Costs::default(),
                trace: Costs::default(),
                different: 0,
            };
            (builder, measurement)
        });
    for round in 0..=rounds {
        for (builder, measurement) in &mut measurements {
            let (build, trace, casts) = through_tree(surface.clone(), *builder, &ray_sets);
            if round == 0 {
                measurement.different = different(&ray_sets, &casts, &truth);
            } else {
                measurement.build.0.push(build);
                measurement.trace.0.push(trace);
            }
            black_box(casts);
        }
    }
    measurements.map(|(_, measurement)| measurement).into()
}

/// About `rays` rays from at least four views, as the default set has them.
fn views(target: &Target, pattern: &BeamPattern, rays: usize) -> Vec<RaySet> {
    let n_views = rays.div_ceil(RAYS_PER_VIEW).max(4);
    let poses = ring_of_views(n_views as u32, 3.0, 20f64.to_radians(), 0.0, DVec3::ZERO);
    let share = rays / n_views;
    let view = |pose| {
        let mut ray_set = RaySet::sweep(target, pose, pattern, Culling::On);
        let keep_each = ray_set.rays.len().div_ceil(share).max(1);
        let thinned = |i: &usize| i.is_multiple_of(keep_each);
        let chosen: Vec<usize> = (0..ray_set.rays.len()).filter(thinned).collect();
        ray_set.rays = chosen.iter().map(|&i| ray_set.rays[i]).collect();
        ray_set.job.rays = chosen.iter().map(|&i| ray_set.job.rays[i]).collect();
        ray_set.job.beams = chosen.iter().map(|&i| ray_set.job.beams[i]).collect();
        ray_set
    };
    poses.iter().map(view).collect()
}

fn codes_of(ray_set: &RaySet) -> Cast {
    let bvh = &ray_set.job.target.bvh;
    Cast {
        codes: trace::trace(&bvh.nodes, &bvh.triangles, &ray_set.job.rays),
        effect_outputs: Vec::new(),
    }
}

fn through_tree(
    surface: Surface,
    builder: Builder,
    ray_sets: &[RaySet],
) -> (Cost, Cost, Vec<Cast>) {
    let (target, build) = measured(|| Target::new(surface, builder));
    let bvh = &target.bvh;
    let (codes, cost) = measured(|| -> Vec<_> {
        ray_sets.iter().map(|s| trace::trace(&bvh.nodes, &bvh.triangles, &s.job.rays)).collect()
    });
    let casts = codes.into_iter().map(|codes| Cast { codes, effect_outputs: Vec::new() });
    (build, cost, casts.collect())
}

fn different(ray_sets: &[RaySet], casts: &[Cast], truth: &[Vec<Option<f64>>]) -> usize {
    let of_view = |((ray_set, cast), truth): ((&RaySet, &Cast), &Vec<Option<f64>>)| {
        ray_set.ranges(cast).iter().zip(truth).filter(|(a, b)| a != b).count()
    };
    ray_sets.iter().zip(casts).zip(truth).map(of_view).sum()
}

impl Measurement {
    fn total_s(&self) -> f64 {
        self.build.cpu_s().median + self.trace.cpu_s().median
    }
}

impl Measurements {
    /// The figures for people.
    pub fn tables(&self) -> Vec<Table> {
        vec![self.per_mesh(), self.regret()]
    }

    /// The builders of one mesh and number of rays.
    fn groups(&self) -> impl Iterator<Item = &[Measurement]> {
        self.0.chunk_by(|a, b| a.mesh == b.mesh && a.rays == b.rays)
    }

    fn per_mesh(&self) -> Table {
        let mut table = Table::new(
            "Build + trace, CPU ms (rays to break even: where SAH's slower build is paid back)",
            &["mesh", "triangles", "rays", "Sah", "Morton", "break-even / triangle", "different"],
        );
        for group in self.groups() {
            let [sah, morton] = group else { continue };
            let measurements = |measurement: &Measurement| {
                let (build, trace) =
                    (measurement.build.cpu_s().median, measurement.trace.cpu_s().median);
                format!("{} + {}", milliseconds(build), milliseconds(trace))
            };
            table.push(vec![
                sah.mesh.clone(),
                sah.triangles.to_string(),
                sah.rays.to_string(),
                measurements(sah),
                measurements(morton),
                break_even_rays(sah, morton)
                    .map_or("never".to_owned(), |rays| digits(rays / sah.triangles as f64)),
                group.iter().map(|measurement| measurement.different).sum::<usize>().to_string(),
            ]);
        }
        table
    }

    /// What each rule costs over all meshes, against the best choice for each.
    fn regret(&self) -> Table {
        let mut table = Table::new(
            "All meshes together, CPU ms, by what chooses",
            &["rays", "always Sah", "always Morton", "Builder::for_rays", "best of both"],
        );
        for rays in RAYS {
            let near = |group: &&[Measurement]| nearest_count(group[0].rays) == rays;
            let sum = |choose: &dyn Fn(&[Measurement]) -> f64| {
                milliseconds(self.groups().filter(near).map(choose).sum())
            };
            let by_rule = |group: &[Measurement]| match Builder::for_rays(
                group[0].triangles,
                group[0].rays,
            ) {
                Builder::Sah => group[0].total_s(),
                Builder::Morton => group[1].total_s(),
            };
            table.push(vec![
                rays.to_string(),
                sum(&|group| group[0].total_s()),
                sum(&|group| group[1].total_s()),
                sum(&by_rule),
                sum(&|group| group[0].total_s().min(group[1].total_s())),
            ]);
        }
        table
    }
}

/// Which of [`RAYS`] was asked for where `rays` were cast.
fn nearest_count(rays: usize) -> usize {
    let ratio = |n: usize| (rays as f64 / n as f64).ln().abs();
    RAYS.into_iter().min_by(|&a, &b| ratio(a).total_cmp(&ratio(b))).unwrap_or(rays)
}

/// Rays after which the SAH tree has won back what it took longer to build;
/// `None` where it never does, since its rays are not cheaper.
fn break_even_rays(sah: &Measurement, morton: &Measurement) -> Option<f64> {
    let per_ray =
        |measurement: &Measurement| measurement.trace.cpu_s().median / measurement.rays as f64;
    let slower_build = sah.build.cpu_s().median - morton.build.cpu_s().median;
    let saved_per_ray = per_ray(morton) - per_ray(sah);
    (saved_per_ray > 0.0).then(|| slower_build / saved_per_ray)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measurement(build_s: f64, trace_s: f64) -> Measurement {
        let costs = |s: f64| Costs(vec![Cost { wall_s: s, cpu_s: s }]);
        Measurement {
            mesh: "m".to_owned(),
            triangles: 1,
            rays: 100,
            builder: "Sah",
            build: costs(build_s),
            trace: costs(trace_s),
            different: 0,
        }
    }

    #[test]
    fn a_tree_that_never_pays_has_no_break_even() {
        assert_eq!(break_even_rays(&measurement(2.0, 1.0), &measurement(1.0, 1.0)), None);
        assert_eq!(break_even_rays(&measurement(2.0, 1.0), &measurement(1.0, 0.5)), None);
        assert_eq!(break_even_rays(&measurement(2.0, 1.0), &measurement(1.0, 2.0)), Some(100.0));
    }
}
