//! Ranges: what f32 finds by itself, and what is delivered once f64 has solved it.

use formats::rng::StreamKey;
use glam::{DAffine3, DVec3};
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::cpu::oracle;
use sim_gpu::cpu::traverse::traverse;
use sim_gpu::effects::Effects;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::Mesh;
use sim_gpu::pose::Pose;
use sim_gpu::ray::{MISS, RayFrame};
use sim_gpu::resolve::resolve;
use sim_gpu::sensor::{BeamPattern, Sensor};
use sim_gpu::target::Target;

use super::Row;
use crate::measure::bench_mesh::target as target_of;
use crate::measure::scenes::torus;

/// Beams this close to a surface's plane are promised less: 0.1 degree.
const GRAZING_TANGENT: f64 = 573.0;
/// Half a unit in the last place of f64, relative.
const U64: f64 = 1.0 / (1u64 << 53) as f64;

/// One value of one parameter.
struct Setting {
    parameter: &'static str,
    value: f64,
    triangles: usize,
    scale: f64,
    offset: f64,
    distance: f64,
}

/// Measures every setting on the CPU twin; other adapters find the same triangles
/// and have their ranges from the same f64.
pub fn measure() -> Vec<Row> {
    let plain = |parameter, value| Setting {
        parameter,
        value,
        triangles: 10_000,
        scale: 1.0,
        offset: 0.0,
        distance: 3.0,
    };
    let mut settings = Vec::new();
    let scales = [1e-30, 1e-12, 1e-6, 1e-3, 1e3, 1e6, 1e12, 1e30];
    settings.extend(scales.map(|scale| Setting { scale, ..plain("scale", scale) }));
    let offsets = [1e1, 1e3, 1e5, 1e6, 1e7];
    settings.extend(offsets.map(|offset| Setting { offset, ..plain("offset", offset) }));
    let distances = [1.5, 3.0, 10.0, 50.0, 200.0];
    settings.extend(distances.map(|d| Setting { distance: d, ..plain("distance", d) }));
    let sizes = [100, 1000, 10_000, 100_000];
    settings.extend(sizes.map(|n| Setting { triangles: n, ..plain("N", n as f64) }));
    let pattern = Sensor::builtin("vlp32c").expect("invariant: it is built in").pattern();
    settings.iter().flat_map(|setting| setting.measure(&pattern)).collect()
}

impl Setting {
    /// Errors of f32 alone, and of what is delivered, in metres.
    fn measure(&self, pattern: &BeamPattern) -> [Row; 2] {
        let Self { scale, offset, distance, .. } = *self;
        let mesh = torus(self.triangles);
        let pose = Pose::view(distance, 0.35, 0.3, DVec3::ZERO);
        let at_home = job(target(&mesh, |v| v), pose, pattern);
        let shift = DVec3::splat(offset);
        let moved = Pose { position_m: pose.position_m * scale + shift, ..pose };
        let there = job(target(&mesh, |v| v * scale + shift), moved, pattern);
        let unit = there.target.surface.frame.scale;

        // What is lost before anything is computed: vertices and the sensor round to
        // f64 of their own place; then some ten roundings of the range itself.
        let kept = U64 * (2.0 * 3f64.sqrt() * offset + 10.0 * (distance + 2.0) * scale);
        let delivered_bound = 2.0 * kept * (1.0 + GRAZING_TANGENT);
        let (mut in_f32, mut delivered) = (Vec::new(), Vec::new());
        let (mut f32_bound, mut largest) = (0.0f64, 0.0f64);
        let hits = {
            let casts = Caster::Cpu(Effects::default()).cast_on_cpu(std::slice::from_ref(&there));
            resolve(&there, &casts[0], pattern, &Effects::default()).hits
        };
        let mut ray_of = vec![None; pattern.len()];
        there.beams.iter().zip(&there.rays).for_each(|(&b, ray)| ray_of[b as usize] = Some(ray));
        for hit in &hits {
            let ray = at_home.frame.ray(pattern.directions[hit.beam as usize]);
            let Some(truth) = oracle::nearest(&at_home.target, &ray) else { continue };
            let incidence =
                oracle::normal(&at_home.target, truth.index).dot(ray.direction.normalize()).abs();
            // At a silhouette another triangle is another range.
            if truth.index != hit.triangle || incidence * GRAZING_TANGENT < 1.0 {
                continue;
            }
            let truth_m = truth.range_m * scale;
            largest = largest.max(truth_m);
            delivered.push((hit.range_m - truth_m).abs());
            let Some(trace) = ray_of[hit.beam as usize] else { continue };
            let bvh = &there.target.bvh;
            let nearest = traverse(&bvh.nodes, &bvh.triangles, trace);
            if nearest.index == hit.triangle && nearest.index != MISS {
                let found = f64::from(trace.skipped) + f64::from(nearest.t);
                in_f32.push((found * unit - truth_m).abs());
                // The caster's own account, and the rounding of what was skipped.
                let skipped = f64::from(trace.skipped) / f64::from(1u32 << 24);
                f32_bound = f32_bound.max((f64::from(nearest.error) + skipped) * unit);
            }
        }
        let row = |precision: &str, errors, bound| Row {
            quantity: "range",
            layer: String::new(),
            precision: precision.to_owned(),
            parameter: self.parameter,
            value: self.value,
            errors,
            bound,
            magnitude: largest,
            unit: "m",
        };
        [
            row("f32 alone", in_f32, f32_bound + delivered_bound),
            row("f64 on f32's triangle", delivered, delivered_bound),
        ]
    }
}

fn target(mesh: &Mesh, map: impl Fn(DVec3) -> DVec3) -> Target {
    let vertices = mesh.vertices.iter().map(|&v| map(v)).collect();
    target_of(Mesh { vertices, triangles: mesh.triangles.clone() }, Builder::Sah)
}

fn job(target: Target, pose: Pose, pattern: &BeamPattern) -> CastJob {
    let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, &pose);
    let stream = StreamKey::new(0, "growth", 0);
    CastJob::aim(target, frame, pattern, Culling::On, stream, 1.0)
}
