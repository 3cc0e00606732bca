//! Clouds to turn: one mesh as several sensors see it.

use super::entries;
use anyhow::{Context, Result};
use formats::rng::StreamKey;
use formats::scan::AttributeSet;
use glam::{DAffine3, DVec3};
use maud::{Markup, html};
use sim_gpu::bvh::Builder;
use sim_gpu::caster::Caster;
use sim_gpu::effects::{Effects, Noise, NoiseModel};
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::census::survey;
use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::load;
use sim_gpu::pose::Pose;
use sim_gpu::ray::RayFrame;
use sim_gpu::resolve::resolve;
use sim_gpu::scan::{Seen, View, assemble};
use sim_gpu::sensor::Sensor;
use sim_gpu::target::{Surface, Target};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Sensors, and noise along the ray in metres.
const SENSORS: [(&str, f64); 4] =
    [("vlp32c", 0.0), ("vlp32c", 0.02), ("vlp16", 0.0), ("generic-static", 0.0)];

/// As gen-dataset's rotating set has it, from one of its sides.
const DISTANCE_M: f64 = 3.0;
const ELEVATION_DEG: f64 = 20.0;
const AZIMUTH_DEG: f64 = 45.0;

/// Points that a canvas draws at most, so that a phone turns them.
const MOST_POINTS: usize = 6000;

/// One mesh of `assets`, as each of the sensors sees it.
///
/// # Errors
/// A mesh that cannot be read.
pub fn body(assets: &Path) -> Result<Markup> {
    let Some(path) = first_mesh(&assets.join("meshes")) else {
        return Ok(html! { p { "There is no mesh under " (assets.join("meshes").display()) "." } });
    };
    let loaded = load(&path).with_context(|| format!("cannot scan {}", path.display()))?;
    let world = to_world(&loaded.mesh, loaded.format.default_up(), Normalize::default());
    let kept = survey(&world.mesh).kept;
    let target = Arc::new(Target::new(Surface::new(world.mesh, kept), Builder::Sah));
    let clouds = SENSORS.map(|(sensor, noise_m)| (sensor, noise_m, scan(&target, sensor, noise_m)));
    Ok(html! {
        p { (super::name(&path)) ", in the unit sphere, " (DISTANCE_M) " m from the sensor and "
            (ELEVATION_DEG) "° below it. Made now, on the CPU." }
        div class="clouds" { @for (sensor, noise_m, cloud) in &clouds {
            figure {
                canvas class="cloud" width="480" height="360" data-points=(thousandths(cloud))
                    data-colours=("0".repeat(shown(cloud).count())) data-palette="#1763c7" {}
                figcaption {
                    (sensor) @if *noise_m > 0.0 { ", noise " (noise_m) " m" } ": " (cloud.len()) " points. "
                    "Drag to turn."
                }
            }
        } }
    })
}

/// The first mesh below `folder`.
fn first_mesh(folder: &Path) -> Option<PathBuf> {
    entries(folder).into_iter().find_map(|path| match path.is_dir() {
        true => first_mesh(&path),
        false => sim_gpu::mesh::MeshFormat::of(&path).map(|_| path),
    })
}

fn scan(target: &Arc<Target>, sensor: &str, sigma_m: f64) -> Vec<[f32; 3]> {
    let sensor = Sensor::builtin(sensor).expect("invariant: these profiles are built in");
    let noise = Noise { mean_m: 0.0, sigma_m, model: NoiseModel::Range };
    let effects = Effects { noise: (sigma_m > 0.0).then_some(noise), ..Effects::default() };
    let (elevation, azimuth) = (ELEVATION_DEG.to_radians(), AZIMUTH_DEG.to_radians());
    let pose = Pose::view(DISTANCE_M, elevation, azimuth, DVec3::ZERO);
    let pattern = sensor.pattern();
    let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, &pose);
    let stream = StreamKey::new(0, "report", 0);
    let job = CastJob::aim(Arc::clone(target), frame, &pattern, Culling::On, stream, 1.0);
    let casts = Caster::Cpu(effects.clone()).cast_on_cpu(std::slice::from_ref(&job));
    let hits = resolve(&job, &casts[0], &pattern, &effects);
    let view = View {
        sensor: &sensor,
        pattern: &pattern,
        pose: &pose,
        cast_effects: &effects,
        effects: &effects,
        attributes: &AttributeSet::default(),
        stream,
    };
    let world_from_object = &DAffine3::IDENTITY;
    let seen = [Seen { object: 0, world_from_object, job: &job, hits: &hits }];
    assemble(&view, &seen).0.positions
}

/// Some of the points, spread over all.
fn shown(cloud: &[[f32; 3]]) -> impl Iterator<Item = &[f32; 3]> {
    cloud.iter().step_by(cloud.len().div_ceil(MOST_POINTS).max(1))
}

/// Coordinates in thousandths, as the page's script takes them.
fn thousandths(cloud: &[[f32; 3]]) -> String {
    let numbers = shown(cloud).flatten().map(|x| format!("{:.0}", x * 1e3));
    numbers.collect::<Vec<_>>().join(" ")
}
