//! Clouds that can be rotated: one mesh as several sensors see it.

use crate::render::page;
use anyhow::{Context, Result};
use formats::rng::StreamKey;
use glam::DVec3;
use maud::{Markup, html};
use sim_gpu::effects::{Effects, Noise, NoiseModel};
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::mesh::tree::discover;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::ScanRequest;
use sim_gpu::internals::sensor::SensorProfile;
use sim_gpu::internals::target::Target;
use std::path::Path;
use xtask::workspace::file_name;

/// Sensors, and noise along the ray in metres.
const SENSORS: [(&str, f64); 4] =
    [("vlp32c", 0.0), ("vlp32c", 0.02), ("vlp16", 0.0), ("generic-static", 0.0)];

/// As in gen-dataset's rotating set, from one side.
const DISTANCE_M: f64 = 3.0;
const ELEVATION_DEG: f64 = 20.0;
const AZIMUTH_DEG: f64 = 45.0;

/// Points that a canvas draws at most, so that a phone turns them.
const MOST_POINTS: usize = 6000;

pub fn body(assets: &Path) -> Result<Markup> {
    let folder = assets.join("meshes");
    let entries = if folder.exists() { discover(&folder, 0)? } else { Vec::new() };
    let Some(entry) = entries.into_iter().next() else {
        return Ok(html! { p { "There is no mesh under " (folder.display()) "." } });
    };
    let mesh = sim_gpu::Mesh::read(&entry.path)
        .with_context(|| format!("cannot scan {}", entry.relative))?
        .unit_sphere();
    let clouds: Vec<_> = SENSORS
        .into_iter()
        .map(|(sensor, noise_m)| Ok((sensor, noise_m, scan(mesh.target(), sensor, noise_m)?)))
        .collect::<Result<_>>()?;
    Ok(html! {
        p { (file_name(&entry.path)) ", in the unit sphere, " (DISTANCE_M) " m from the sensor and "
            (ELEVATION_DEG) "° below it. Made now, on the CPU." }
        div class="clouds" { @for (sensor, noise_m, cloud) in &clouds {
            (page::cloud(&thousandths(cloud), &"0".repeat(shown(cloud).count()), "#1763c7", &html! {
                (sensor) @if *noise_m > 0.0 { ", noise " (noise_m) " m" } ": " (cloud.len()) " points. "
                "Drag to rotate."
            }))
        } }
    })
}

fn scan(target: &Target, sensor: &str, sigma_m: f64) -> Result<Vec<[f32; 3]>> {
    let sensor = SensorProfile::builtin(sensor).expect("invariant: these profiles are built in");
    let noise = Noise { mean_m: 0.0, sigma_m, model: NoiseModel::Range };
    let effects = Effects { noise: (sigma_m > 0.0).then_some(noise), ..Effects::default() };
    let (elevation, azimuth) = (ELEVATION_DEG.to_radians(), AZIMUTH_DEG.to_radians());
    let pose = Pose::view(DISTANCE_M, elevation, azimuth, DVec3::ZERO);
    let pattern = sensor.pattern();
    let mut request = ScanRequest::new(&sensor, &pattern, pose);
    request.stream = StreamKey::new(0, "report", 0);
    Ok(sim_gpu::internals::scan::scan(&OpenCaster::Cpu(effects), target, &request)?.positions)
}

fn shown(cloud: &[[f32; 3]]) -> impl Iterator<Item = &[f32; 3]> {
    cloud.iter().step_by(cloud.len().div_ceil(MOST_POINTS).max(1))
}

/// Coordinates in thousandths, as the page's script takes them.
fn thousandths(cloud: &[[f32; 3]]) -> String {
    let numbers = shown(cloud).flatten().map(|x| format!("{:.0}", x * 1e3));
    numbers.collect::<Vec<_>>().join(" ")
}
