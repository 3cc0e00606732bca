//! The same meshes on every adapter and on the CPU.
//!
//! Positions must be equal within the promised bound, classes must be equal, and so must
//! the number of points but for beams at silhouettes, which are listed.

use crate::measure::backends::Backend;
use crate::measure::bench_mesh::{BenchMesh, target};
use crate::measure::ray_set::vlp32c;
use crate::table::{Column, Table, digits};
use anyhow::Result;
use edgepuck_shapes::{ShapeClass, generate};
use glam::{DAffine3, DVec3};
use harness::judge::{RANGE_TOLERANCE, SILHOUETTE_RAD, near_edge};
use infer_cpu::Classifier;
use serde::Serialize;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::mesh::frame::{Normalize, Up, to_world};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::ray::RayFrame;
use sim_gpu::internals::resolve::{Hit, Hits};
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest, scan_objects};
use sim_gpu::internals::target::Target;

/// From the middle of a mesh of the unit sphere, metres.
const DISTANCE_M: f64 = 3.0;

/// One mesh from one side, on one adapter beside the CPU.
#[derive(Serialize)]
pub struct Comparison {
    pub mesh: String,
    view: u32,
    pub adapter: String,
    points: [usize; 2],
    /// Beams that see another surface or miss.
    silhouettes: Vec<u32>,
    /// Of them, those without a silhouette nearby.
    unexplained: usize,
    /// Between positions where both see one.
    apart_m: f64,
    bound_m: f64,
    classes: [String; 2],
}

/// Compares each of `others` with the CPU, on `views` of each mesh.
pub fn compare(
    bench_meshes: &[BenchMesh],
    views: u32,
    (cpu, others): (&Backend, &[Backend]),
    classifier: &mut Classifier,
) -> Result<Vec<Comparison>> {
    let sensor = vlp32c();
    let pattern = sensor.pattern();
    let mut all = Vec::new();
    for bench_mesh in bench_meshes {
        let target = target(bench_mesh.mesh.clone(), Builder::Sah);
        for view in 0..views {
            let azimuth = std::f64::consts::TAU * f64::from(view) / f64::from(views) + 0.3;
            let pose = Pose::view(DISTANCE_M, 20f64.to_radians(), azimuth, DVec3::ZERO);
            let request = ScanRequest::new(&sensor, &pattern, pose);
            let seen = View { target: &target, request };
            let reference = seen.cast(cpu)?;
            for backend in others {
                let found = seen.cast(backend)?;
                let place = (bench_mesh.name.as_str(), view, backend.name());
                all.push(seen.compare(place, &reference, &found, classifier)?);
            }
        }
    }
    Ok(all)
}

pub fn shape(class: ShapeClass) -> BenchMesh {
    let mesh = to_world(&generate(class, 0, 0), Up::Z, Normalize::UnitSphere).mesh;
    BenchMesh { name: format!("shape {class}"), mesh }
}

struct View<'a> {
    target: &'a Target,
    request: ScanRequest<'a>,
}

impl View<'_> {
    fn cast(&self, backend: &Backend) -> Result<Hits> {
        let object = PlacedTarget::new(self.target);
        Ok(scan_objects(&backend.caster, &[object], &self.request)?.hits.swap_remove(0))
    }

    fn compare(
        &self,
        (mesh, view, adapter): (&str, u32, &str),
        cpu: &Hits,
        other: &Hits,
        classifier: &mut Classifier,
    ) -> Result<Comparison> {
        let mut ranges = vec![[None; 2]; self.request.pattern.len()];
        for (side, hits) in [cpu, other].into_iter().enumerate() {
            hits.hits.iter().for_each(|hit| ranges[hit.beam as usize][side] = Some(hit.range_m));
        }
        let (mut apart_m, mut bound_m) = (0.0f64, 0.0f64);
        let (mut silhouettes, mut unexplained) = (Vec::new(), 0);
        for (beam, pair) in (0u32..).zip(&ranges) {
            let same = match pair {
                [Some(a), Some(b)] if (a - b).abs() <= RANGE_TOLERANCE * a => {
                    apart_m = apart_m.max((a - b).abs());
                    bound_m = bound_m.max(RANGE_TOLERANCE * a);
                    true
                }
                [a, b] => a.is_none() && b.is_none(),
            };
            if !same {
                silhouettes.push(beam);
                unexplained += usize::from(!self.is_near_edge(beam));
            }
        }
        let mut class = |hits: &Hits| -> Result<String> {
            let points: Vec<[f64; 3]> = hits.hits.iter().map(|hit| self.position(hit)).collect();
            Ok(classifier.classify_f64(&points)?.label.to_string())
        };
        let classes = [class(cpu)?, class(other)?];
        Ok(Comparison {
            mesh: mesh.to_owned(),
            view,
            adapter: adapter.to_owned(),
            points: [cpu.hits.len(), other.hits.len()],
            silhouettes,
            unexplained,
            apart_m,
            bound_m,
            classes,
        })
    }

    fn position(&self, hit: &Hit) -> [f64; 3] {
        let ScanRequest { pose, pattern, .. } = &self.request;
        let direction = pose.rotation * pattern.directions[hit.beam as usize];
        (pose.position_m + direction * hit.range_m).to_array()
    }

    /// Whether an edge is near enough to `beam` to be a silhouette.
    fn is_near_edge(&self, beam: u32) -> bool {
        let frame = RayFrame::new(&self.target.surface, &DAffine3::IDENTITY, &self.request.pose);
        let ray = frame.ray(self.request.pattern.directions[beam as usize]);
        near_edge(self.target, &ray, SILHOUETTE_RAD)
    }
}

impl Comparison {
    /// Positions and classes equal, and as many points but for silhouettes.
    pub fn is_equal(&self) -> bool {
        self.unexplained == 0 && self.classes[0] == self.classes[1]
    }
}

pub fn csv(all: &[Comparison]) -> Result<Vec<u8>> {
    let beams = |all: &[u32]| all.iter().map(u32::to_string).collect::<Vec<_>>().join(" ");
    let columns: [Column<'_, Comparison>; 11] = [
        ("mesh", &|c| c.mesh.clone()),
        ("view", &|c| c.view.to_string()),
        ("adapter", &|c| c.adapter.clone()),
        ("points_cpu", &|c| c.points[0].to_string()),
        ("points", &|c| c.points[1].to_string()),
        ("silhouette_beams", &|c| beams(&c.silhouettes)),
        ("largest_difference_m", &|c| format!("{:e}", c.apart_m)),
        ("bound_m", &|c| format!("{:.3e}", c.bound_m)),
        ("class_cpu", &|c| c.classes[0].clone()),
        ("class", &|c| c.classes[1].clone()),
        ("equal", &|c| c.is_equal().to_string()),
    ];
    Table::of("", all, &columns).to_csv()
}

pub fn summary(all: &[Comparison], others: &[Backend]) -> Table {
    let scans = |backend: &Backend| {
        all.iter().filter(|c| c.adapter == backend.name()).collect::<Vec<&Comparison>>()
    };
    let sum = |backend: &Backend, of: fn(&Comparison) -> usize| {
        scans(backend).into_iter().map(of).sum::<usize>().to_string()
    };
    let apart_m = |backend: &Backend| scans(backend).iter().map(|c| c.apart_m).fold(0.0, f64::max);
    let columns: [Column<'_, Backend>; 6] = [
        ("adapter", &|backend| backend.name().to_owned()),
        ("scans", &|backend| scans(backend).len().to_string()),
        ("points", &|backend| sum(backend, |c| c.points[1])),
        ("silhouette beams", &|backend| sum(backend, |c| c.silhouettes.len())),
        ("apart, m", &|backend| digits(apart_m(backend))),
        ("equal", &|backend| sum(backend, |c| usize::from(c.is_equal()))),
    ];
    Table::of("Each adapter beside the CPU", others, &columns)
}
