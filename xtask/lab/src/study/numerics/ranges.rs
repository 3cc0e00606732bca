//! Ranges in f32 alone, and as delivered after solving in f64.

use glam::DVec3;
use sim_gpu::effects::Effects;
use sim_gpu::internals::bvh::{Builder, Stack};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::cpu::oracle;
use sim_gpu::internals::cpu::traverse::traverse;
use sim_gpu::internals::job::CastJob;
use sim_gpu::internals::mesh::TriangleMesh;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::resolve::resolve;
use sim_gpu::internals::scan::{PlacedTarget, ScanRequest};
use sim_gpu::internals::sensor::{BeamPattern, SensorProfile};

use super::{Row, Setting, U64, settings};
use crate::measure::bench_mesh::{target, torus};
use crate::measure::ray_set::vlp32c;

/// Beams this close to a surface's plane are promised less: 0.1 degree.
const GRAZING_TANGENT: f64 = 573.0;

/// Every value of every parameter of a scan.
const SETTINGS: [(&str, &[f64]); 4] = [
    ("scale", &[1e-30, 1e-12, 1e-6, 1e-3, 1e3, 1e6, 1e12, 1e30]),
    ("offset", &[1e1, 1e3, 1e5, 1e6, 1e7]),
    ("distance", &[1.5, 3.0, 10.0, 50.0, 200.0]),
    ("N", &[100.0, 1000.0, 10_000.0, 100_000.0]),
];

/// Measures every setting on the CPU twin; other adapters find the same triangles
/// and have their ranges from the same f64.
pub fn measure() -> Vec<Row> {
    let sensor = vlp32c();
    let pattern = sensor.pattern();
    let rows = |setting| measure_at(setting, &sensor, &pattern);
    settings(&SETTINGS).into_iter().flat_map(rows).collect()
}

/// Errors of f32 alone, and of the delivered ranges, in metres.
fn measure_at(setting: Setting, sensor: &SensorProfile, pattern: &BeamPattern) -> [Row; 2] {
    let [scale, offset] = [setting.of("scale", 1.0), setting.of("offset", 0.0)];
    let distance = setting.of("distance", 3.0);
    let mesh = torus(setting.of("N", 10_000.0) as usize);
    let pose = Pose::view(distance, 0.35, 0.3, DVec3::ZERO);
    let shift = DVec3::splat(offset);
    let moved = Pose { position_m: pose.position_m * scale + shift, ..pose };
    let job = |pose, map: &dyn Fn(DVec3) -> DVec3| -> CastJob {
        let vertices = mesh.vertices.iter().map(|&v| map(v)).collect();
        let mesh = TriangleMesh { vertices, triangles: mesh.triangles.clone() };
        let target = target(mesh, Builder::Sah);
        ScanRequest::new(sensor, pattern, pose).aim(&PlacedTarget::new(&target))
    };
    let at_home = job(pose, &|v| v);
    let there = job(moved, &|v| v * scale + shift);
    let unit = there.target.surface.frame.scale;

    // Lost before any computation: vertices and the sensor round to
    // f64 of their own place; then some ten roundings of the range itself.
    let kept = U64 * (2.0 * 3f64.sqrt() * offset + 10.0 * (distance + 2.0) * scale);
    let delivered_bound = 2.0 * kept * (1.0 + GRAZING_TANGENT);
    let (mut in_f32, mut delivered) = (Vec::new(), Vec::new());
    let (mut f32_bound, mut magnitude) = (0.0f64, 0.0f64);
    let effects = Effects::default();
    let casts = OpenCaster::Cpu(effects.clone()).cast_on_cpu(std::slice::from_ref(&there));
    for hit in resolve(&there, &casts[0], pattern, &effects).hits {
        let ray = at_home.frame.ray(pattern.directions[hit.beam as usize]);
        let Some(truth) = oracle::nearest(&at_home.target, &ray) else { continue };
        let incidence =
            oracle::normal(&at_home.target, truth.index).dot(ray.direction.normalize()).abs();
        // At a silhouette another triangle is another range.
        if truth.index != hit.triangle || incidence * GRAZING_TANGENT < 1.0 {
            continue;
        }
        let truth_m = truth.range_m * scale;
        magnitude = magnitude.max(truth_m);
        delivered.push((hit.range_m - truth_m).abs());
        let ray = there.frame.beam(pattern, hit.beam);
        let Some(trace) = there.frame.trace_ray(&ray, 0) else { continue };
        let nearest = traverse(&there.target.bvh.wide, &mut Stack::default(), &trace);
        if nearest.index == hit.triangle {
            let found = f64::from(trace.skipped) + f64::from(nearest.t);
            in_f32.push((found * unit - truth_m).abs());
            // The caster's own bound, and the rounding of the skipped distance.
            let skipped = f64::from(trace.skipped) / f64::from(1u32 << 24);
            f32_bound = f32_bound.max((f64::from(nearest.error) + skipped) * unit);
        }
    }
    let row = |precision: &str, errors, bound| Row {
        quantity: "range",
        layer: String::new(),
        precision: precision.to_owned(),
        setting,
        errors,
        bound,
        magnitude,
        unit: "m",
    };
    [
        row("f32 alone", in_f32, f32_bound + delivered_bound),
        row("f64 on f32's triangle", delivered, delivered_bound),
    ]
}
