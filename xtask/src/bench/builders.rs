//! Which hierarchy pays for how many rays.
//!
//! [`sim_gpu::bvh::Builder::for_rays`] rests on what this prints.

use super::bins;
use super::clock::{Cost, Costs, measured};
use super::shot::Shot;
use super::speed::vlp32c;
use super::subject::Subject;
use super::table::{Table, digits, milliseconds};
use anyhow::Result;
use glam::DVec3;
use serde::Serialize;
use sim_gpu::bvh::Builder;
use sim_gpu::cpu::trace;
use sim_gpu::job::{Cast, Culling};
use sim_gpu::mesh::census;
use sim_gpu::pose::ring_of_views;
use sim_gpu::sensor::BeamPattern;
use sim_gpu::target::{Surface, Target};
use std::hint::black_box;
use std::sync::Arc;

/// Rays cast at each mesh, in turn.
const RAYS: [usize; 5] = [1_000, 10_000, 30_000, 100_000, 1_000_000];

/// Beyond this many rays casting without a hierarchy is a lost cause.
const MOST_RAYS_BINNED: usize = 100_000;

/// Rays of one view of the default sensor at the default distance.
const RAYS_PER_VIEW: usize = 5_700;

/// One way of casting some rays at one mesh.
#[derive(Serialize)]
pub struct Way {
    mesh: String,
    triangles: usize,
    rays: usize,
    /// `Sah`, `Morton` or `bins`.
    way: &'static str,
    build: Costs,
    trace: Costs,
    /// Rays whose range is not, bit for bit, that found through the SAH tree.
    different: usize,
}

/// All ways at all meshes.
#[derive(Serialize)]
pub struct Ways(Vec<Way>);

/// Measures each of `subjects` in `rounds` rounds on the CPU twin.
///
/// # Errors
/// None yet known.
pub fn measure(subjects: &[Subject], rounds: usize) -> Result<Ways> {
    let pattern = vlp32c();
    let mut ways = Vec::new();
    for subject in subjects {
        eprintln!("{}", subject.name);
        for rays in RAYS {
            ways.extend(at(subject, &pattern, rays, rounds));
        }
    }
    Ok(Ways(ways))
}

fn at(subject: &Subject, pattern: &BeamPattern, rays: usize, rounds: usize) -> Vec<Way> {
    let kept = census::survey(&subject.mesh).kept;
    let surface = Surface::new(subject.mesh.clone(), kept.clone());
    let sah = Arc::new(Target::new(surface.clone(), Builder::Sah));
    let shots = views(&sah, pattern, rays);
    let truth: Vec<_> = shots.iter().map(|shot| shot.ranges(&codes_of(shot))).collect();
    let mut ways: Vec<Way> = ["Sah", "Morton", "bins"]
        .into_iter()
        .filter(|&way| way != "bins" || rays <= MOST_RAYS_BINNED)
        .map(|way| Way {
            mesh: subject.name.clone(),
            triangles: kept.len(),
            rays: shots.iter().map(|shot| shot.rays.len()).sum(),
            way,
            build: Costs::default(),
            trace: Costs::default(),
            different: 0,
        })
        .collect();
    for round in 0..=rounds {
        for way in &mut ways {
            let surface = surface.clone();
            let (build, trace, casts) = match way.way {
                "Sah" => through_tree(surface, Builder::Sah, &shots),
                "Morton" => through_tree(surface, Builder::Morton, &shots),
                _ => through_bins(&surface, &kept, &shots),
            };
            if round == 0 {
                way.different = different(&shots, &casts, &truth);
            } else {
                way.build.0.push(build);
                way.trace.0.push(trace);
            }
            black_box(casts);
        }
    }
    ways
}

/// About `rays` rays from at least four views, as the default set has them.
fn views(target: &Arc<Target>, pattern: &BeamPattern, rays: usize) -> Vec<Shot> {
    let n_views = rays.div_ceil(RAYS_PER_VIEW).max(4);
    let poses = ring_of_views(n_views as u32, 3.0, 20f64.to_radians(), 0.0, DVec3::ZERO);
    let share = rays / n_views;
    let view = |pose| {
        let mut shot = Shot::sweep(target, pose, pattern, Culling::On);
        let keep_each = shot.rays.len().div_ceil(share).max(1);
        let thinned = |i: &usize| i.is_multiple_of(keep_each);
        let chosen: Vec<usize> = (0..shot.rays.len()).filter(thinned).collect();
        shot.rays = chosen.iter().map(|&i| shot.rays[i]).collect();
        shot.job.rays = chosen.iter().map(|&i| shot.job.rays[i]).collect();
        shot.job.beams = chosen.iter().map(|&i| shot.job.beams[i]).collect();
        shot
    };
    poses.iter().map(view).collect()
}

fn codes_of(shot: &Shot) -> Cast {
    let bvh = &shot.job.target.bvh;
    Cast { codes: trace::trace(&bvh.nodes, &bvh.triangles, &shot.job.rays), words: Vec::new() }
}

fn through_tree(
    surface: Surface,
    builder: Builder,
    shots: &[Shot],
) -> (Cost, Cost, Vec<Option<Cast>>) {
    let (target, build) = measured(|| Target::new(surface, builder));
    let bvh = &target.bvh;
    let (codes, cost) = measured(|| -> Vec<_> {
        shots.iter().map(|s| trace::trace(&bvh.nodes, &bvh.triangles, &s.job.rays)).collect()
    });
    let casts = codes.into_iter().map(|codes| Some(Cast { codes, words: Vec::new() }));
    (build, cost, casts.collect())
}

fn through_bins(
    surface: &Surface,
    kept: &[u32],
    shots: &[Shot],
) -> (Cost, Cost, Vec<Option<Cast>>) {
    let (triangles, build) = measured(|| bins::leaf_triangles(surface, kept));
    let (codes, cost) =
        measured(|| shots.iter().map(|shot| bins::cast(&triangles, shot)).collect::<Vec<_>>());
    let casts = codes.into_iter().map(|codes| Some(Cast { codes: codes?, words: Vec::new() }));
    (build, cost, casts.collect())
}

fn different(shots: &[Shot], casts: &[Option<Cast>], truth: &[Vec<Option<f64>>]) -> usize {
    let of_view = |((shot, cast), truth): ((&Shot, &Option<Cast>), &Vec<Option<f64>>)| match cast {
        Some(cast) => shot.ranges(cast).iter().zip(truth).filter(|(a, b)| a != b).count(),
        None => shot.rays.len(),
    };
    shots.iter().zip(casts).zip(truth).map(of_view).sum()
}

impl Way {
    fn total_s(&self) -> f64 {
        self.build.cpu_s().median + self.trace.cpu_s().median
    }
}

impl Ways {
    /// The figures for people.
    pub fn tables(&self) -> Vec<Table> {
        vec![self.per_mesh(), self.regret()]
    }

    /// The ways of one mesh and number of rays, side by side.
    fn groups(&self) -> impl Iterator<Item = &[Way]> {
        self.0.chunk_by(|a, b| a.mesh == b.mesh && a.rays == b.rays)
    }

    fn per_mesh(&self) -> Table {
        let mut table = Table::new(
            "Build + trace, CPU ms (rays to break even: where SAH's slower build is paid back)",
            &[
                "mesh",
                "triangles",
                "rays",
                "Sah",
                "Morton",
                "bins",
                "break-even / triangle",
                "different",
            ],
        );
        for group in self.groups() {
            let [sah, morton, rest @ ..] = group else { continue };
            let ways = |way: &Way| {
                let (build, trace) = (way.build.cpu_s().median, way.trace.cpu_s().median);
                format!("{} + {}", milliseconds(build), milliseconds(trace))
            };
            table.push(vec![
                sah.mesh.clone(),
                sah.triangles.to_string(),
                sah.rays.to_string(),
                ways(sah),
                ways(morton),
                rest.first().map_or("-".into(), ways),
                digits(break_even_rays(sah, morton) / sah.triangles as f64),
                group.iter().map(|way| way.different).sum::<usize>().to_string(),
            ]);
        }
        table
    }

    /// What each rule costs over all meshes, against the best choice for each.
    fn regret(&self) -> Table {
        let mut table = Table::new(
            "All meshes together, CPU ms, by what chooses",
            &["rays", "always Sah", "always Morton", "Builder::for_rays", "best tree", "bins"],
        );
        for rays in RAYS {
            let near = |group: &&[Way]| nearest_count(group[0].rays) == rays;
            let sum = |choose: &dyn Fn(&[Way]) -> f64| {
                milliseconds(self.groups().filter(near).map(choose).sum())
            };
            let by_rule = |group: &[Way]| match Builder::for_rays(group[0].triangles, group[0].rays)
            {
                Builder::Sah => group[0].total_s(),
                Builder::Morton => group[1].total_s(),
            };
            table.push(vec![
                rays.to_string(),
                sum(&|group| group[0].total_s()),
                sum(&|group| group[1].total_s()),
                sum(&by_rule),
                sum(&|group| group[0].total_s().min(group[1].total_s())),
                if rays <= MOST_RAYS_BINNED {
                    sum(&|group| group[2].total_s())
                } else {
                    "-".to_owned()
                },
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

/// Rays after which the SAH tree has won back what it took longer to build.
fn break_even_rays(sah: &Way, morton: &Way) -> f64 {
    let per_ray = |way: &Way| way.trace.cpu_s().median / way.rays as f64;
    let slower_build = sah.build.cpu_s().median - morton.build.cpu_s().median;
    slower_build / (per_ray(morton) - per_ray(sah)).max(f64::MIN_POSITIVE)
}
