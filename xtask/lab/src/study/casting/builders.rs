//! Which builder is faster for how many rays.
//!
//! [`sim_gpu::internals::bvh::Builder::for_rays`] rests on these figures.

use super::speed::building;
use crate::measure::bench_mesh::BenchMesh;
use crate::measure::clock::{Costs, interleave, workload};
use crate::measure::ray_set::{RaySet, vlp32c};
use crate::render::table::{Column, Table, digits, milliseconds};
use anyhow::Result;
use glam::DVec3;
use serde::Serialize;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::cpu::trace;
use sim_gpu::internals::job::{Cast, Culling};
use sim_gpu::internals::pose::ring_of_views;
use sim_gpu::internals::sensor::BeamPattern;
use sim_gpu::internals::target::{Surface, Target};

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
pub fn measure(bench_meshes: &[BenchMesh], rounds: usize) -> Result<Measurements> {
    let pattern = vlp32c().pattern();
    let mut measurements = Vec::new();
    for bench_mesh in bench_meshes {
        eprintln!("{}", bench_mesh.name);
        for rays in RAYS {
            measurements.extend(at(bench_mesh, &pattern, rays, rounds)?);
        }
    }
    Ok(Measurements(measurements))
}

fn at(
    bench_mesh: &BenchMesh,
    pattern: &BeamPattern,
    rays: usize,
    rounds: usize,
) -> Result<[Measurement; 2]> {
    let surface = Surface::of_mesh(bench_mesh.mesh.clone());
    let builders = [Builder::Sah, Builder::Morton];
    let [sah, morton] = builders.map(|builder| Target::new(surface.clone(), builder));
    let ray_sets = views(&sah, pattern, rays);
    let through = |target: &Target| {
        let bvh = &target.bvh;
        let codes = |set: &RaySet| trace::trace(&bvh.wide, set.job.rays());
        ray_sets.iter().map(codes).collect::<Vec<_>>()
    };
    let mut workloads = [
        building(&surface, builders[0]),
        workload(|| Ok(through(&sah))),
        building(&surface, builders[1]),
        workload(|| Ok(through(&morton))),
    ];
    let mut costs = interleave(rounds, &mut workloads)?.into_iter();
    let mut next = || costs.next().unwrap_or_default();
    let ranges = |target: &Target| -> Vec<Option<f64>> {
        let cast = |codes| Cast { codes, effect_outputs: Vec::new() };
        let casts = ray_sets.iter().zip(through(target));
        casts.flat_map(|(set, codes)| set.ranges(&cast(codes))).collect()
    };
    let truth = ranges(&sah);
    Ok([("Sah", &sah), ("Morton", &morton)].map(|(builder, target)| Measurement {
        mesh: bench_mesh.name.clone(),
        triangles: surface.len(),
        rays: truth.len(),
        builder,
        build: next(),
        trace: next(),
        different: ranges(target).iter().zip(&truth).filter(|(a, b)| a != b).count(),
    }))
}

/// About `rays` rays from at least four views, as the default set has them.
fn views(target: &Target, pattern: &BeamPattern, rays: usize) -> Vec<RaySet> {
    let n_views = rays.div_ceil(RAYS_PER_VIEW).max(4);
    let poses = ring_of_views(n_views as u32, 3.0, 20f64.to_radians(), 0.0, DVec3::ZERO);
    let share = rays / n_views;
    let view = |pose| {
        let ray_set = RaySet::sweep(target, pose, pattern, Culling::On);
        let keep_each = ray_set.rays.len().div_ceil(share).max(1);
        ray_set.only(&(0..ray_set.rays.len()).step_by(keep_each).collect::<Vec<_>>())
    };
    poses.iter().map(view).collect()
}

impl Measurement {
    fn total_s(&self) -> f64 {
        self.build.cpu_s().median + self.trace.cpu_s().median
    }
}

impl Measurements {
    /// The figures for people.
    pub fn tables(&self) -> Vec<Table> {
        let same_rays = |a: &Measurement, b: &Measurement| a.mesh == b.mesh && a.rays == b.rays;
        let groups: Vec<&[Measurement]> = self.0.chunk_by(same_rays).collect();
        vec![per_mesh(&groups), regret(&groups)]
    }
}

fn per_mesh(groups: &[&[Measurement]]) -> Table {
    let costs = |Measurement { build, trace, .. }: &Measurement| {
        let [build, trace] = [build, trace].map(|costs| milliseconds(costs.cpu_s().median));
        format!("{build} + {trace}")
    };
    let break_even = |group: &[Measurement]| match break_even_rays(&group[0], &group[1]) {
        Some(rays) => digits(rays / group[0].triangles as f64),
        None => "never".to_owned(),
    };
    let different = |group: &[Measurement]| group.iter().map(|m| m.different).sum::<usize>();
    let columns: [Column<'_, &[Measurement]>; 7] = [
        ("mesh", &|group| group[0].mesh.clone()),
        ("triangles", &|group| group[0].triangles.to_string()),
        ("rays", &|group| group[0].rays.to_string()),
        ("Sah", &|group| costs(&group[0])),
        ("Morton", &|group| costs(&group[1])),
        ("break-even / triangle", &|group| break_even(group)),
        ("different", &|group| different(group).to_string()),
    ];
    let title = "Build + trace, CPU ms (rays to break even: where SAH's slower build is paid back)";
    Table::of(title, groups, &columns)
}

/// What each rule costs over all meshes, against the best choice for each.
fn regret(groups: &[&[Measurement]]) -> Table {
    let sum = |rays: usize, choose: fn(&[Measurement]) -> f64| {
        let near = groups.iter().filter(|group| nearest_count(group[0].rays) == rays);
        milliseconds(near.map(|group| choose(group)).sum())
    };
    let by_rule = |group: &[Measurement]| match Builder::for_rays(group[0].triangles, group[0].rays)
    {
        Builder::Sah => group[0].total_s(),
        Builder::Morton => group[1].total_s(),
    };
    let best = |group: &[Measurement]| group[0].total_s().min(group[1].total_s());
    let columns: [Column<'_, usize>; 5] = [
        ("rays", &|rays| rays.to_string()),
        ("always Sah", &|rays| sum(*rays, |group| group[0].total_s())),
        ("always Morton", &|rays| sum(*rays, |group| group[1].total_s())),
        ("Builder::for_rays", &|rays| sum(*rays, by_rule)),
        ("best of both", &|rays| sum(*rays, best)),
    ];
    Table::of("All meshes together, CPU ms, by what chooses", &RAYS, &columns)
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
    use crate::measure::clock::Cost;

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
