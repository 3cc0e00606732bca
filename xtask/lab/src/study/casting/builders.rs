//! Which hierarchy pays for how many rays.
//!
//! [`sim_gpu::bvh::Builder::for_rays`] rests on what this prints.

use crate::measure::clock::{Cost, Costs, measured};
use crate::measure::shot::Shot;
use crate::measure::subject::Subject;
use crate::render::table::{Table, digits, milliseconds};
use crate::study::casting::speed::vlp32c;
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

/// One way of casting some rays at one mesh.
#[derive(Serialize)]
pub struct Way {
    mesh: String,
    triangles: usize,
    rays: usize,
    /// `Sah` or `Morton`.
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
    let surface = Surface::new(subject.mesh.clone(), validate::triangle_stats(&subject.mesh).kept);
    let sah = Target::new(surface.clone(), Builder::Sah);
    let shots = views(&sah, pattern, rays);
    let truth: Vec<_> = shots.iter().map(|shot| shot.ranges(&codes_of(shot))).collect();
    let mut ways = [("Sah", Builder::Sah), ("Morton", Builder::Morton)].map(|(name, builder)| {
        let way = Way {
            mesh: subject.name.clone(),
            triangles: surface.kept().len(),
            rays: shots.iter().map(|shot| shot.rays.len()).sum(),
            way: name,
            build: Costs::default(),
            trace: Costs::default(),
            different: 0,
        };
        (builder, way)
    });
    for round in 0..=rounds {
        for (builder, way) in &mut ways {
            let (build, trace, casts) = through_tree(surface.clone(), *builder, &shots);
            if round == 0 {
                way.different = different(&shots, &casts, &truth);
            } else {
                way.build.0.push(build);
                way.trace.0.push(trace);
            }
            black_box(casts);
        }
    }
    ways.map(|(_, way)| way).into()
}

/// About `rays` rays from at least four views, as the default set has them.
fn views(target: &Target, pattern: &BeamPattern, rays: usize) -> Vec<Shot> {
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
    Cast {
        codes: trace::trace(&bvh.nodes, &bvh.triangles, &shot.job.rays),
        effect_outputs: Vec::new(),
    }
}

fn through_tree(surface: Surface, builder: Builder, shots: &[Shot]) -> (Cost, Cost, Vec<Cast>) {
    let (target, build) = measured(|| Target::new(surface, builder));
    let bvh = &target.bvh;
    let (codes, cost) = measured(|| -> Vec<_> {
        shots.iter().map(|s| trace::trace(&bvh.nodes, &bvh.triangles, &s.job.rays)).collect()
    });
    let casts = codes.into_iter().map(|codes| Cast { codes, effect_outputs: Vec::new() });
    (build, cost, casts.collect())
}

fn different(shots: &[Shot], casts: &[Cast], truth: &[Vec<Option<f64>>]) -> usize {
    let of_view = |((shot, cast), truth): ((&Shot, &Cast), &Vec<Option<f64>>)| {
        shot.ranges(cast).iter().zip(truth).filter(|(a, b)| a != b).count()
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
            &["mesh", "triangles", "rays", "Sah", "Morton", "break-even / triangle", "different"],
        );
        for group in self.groups() {
            let [sah, morton] = group else { continue };
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
                break_even_rays(sah, morton)
                    .map_or("never".to_owned(), |rays| digits(rays / sah.triangles as f64)),
                group.iter().map(|way| way.different).sum::<usize>().to_string(),
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
fn break_even_rays(sah: &Way, morton: &Way) -> Option<f64> {
    let per_ray = |way: &Way| way.trace.cpu_s().median / way.rays as f64;
    let slower_build = sah.build.cpu_s().median - morton.build.cpu_s().median;
    let saved_per_ray = per_ray(morton) - per_ray(sah);
    (saved_per_ray > 0.0).then(|| slower_build / saved_per_ray)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn way(build_s: f64, trace_s: f64) -> Way {
        let costs = |s: f64| Costs(vec![Cost { wall_s: s, cpu_s: s }]);
        Way {
            mesh: "m".to_owned(),
            triangles: 1,
            rays: 100,
            way: "Sah",
            build: costs(build_s),
            trace: costs(trace_s),
            different: 0,
        }
    }

    #[test]
    fn a_tree_that_never_pays_has_no_break_even() {
        assert_eq!(break_even_rays(&way(2.0, 1.0), &way(1.0, 1.0)), None);
        assert_eq!(break_even_rays(&way(2.0, 1.0), &way(1.0, 0.5)), None);
        assert_eq!(break_even_rays(&way(2.0, 1.0), &way(1.0, 2.0)), Some(100.0));
    }
}
