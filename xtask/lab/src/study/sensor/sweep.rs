//! Sweeps with the laser and the time of each point, real and simulated.

use crate::measure::bench_mesh::target;
use anyhow::{Context, Result, bail};
use formats::labelled_sweep::LabelledSweep;
use formats::rng::StreamKey;
use formats::scan::Attribute;
use glam::{DQuat, DVec3, dvec3};
use half::f16;
use sim_gpu::effects::{Effects, Noise, NoiseModel, Quantum};
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::mesh::TriangleMesh;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{ScanRequest, scan};
use sim_gpu::internals::sensor::{Rotating, SensorProfile};

/// Height of the simulated sensor above the ground, metres: on a car's roof.
const HEIGHT_M: f64 = 1.65;

#[derive(Clone, Copy)]
pub struct Return {
    /// Where, in the car's frame, metres.
    pub position_m: DVec3,
    /// Number of its laser, from 0 for each sensor. The order is unknown.
    pub laser: usize,
    /// Since the sweep's reference, seconds.
    pub time_s: f64,
}

/// The returns of `sweep` by sensor, each of which has `n_lasers`.
pub fn by_sensor(sweep: &LabelledSweep, n_lasers: usize) -> Result<Vec<Vec<Return>>> {
    let lasers = sweep.lasers.as_ref().context("expected `laser`, found none")?;
    let times = sweep.times_s.as_ref().context("expected `offset_ns`, found none")?;
    let n_sensors = lasers.iter().max().map_or(0, |&most| usize::from(most) / n_lasers + 1);
    let mut sensors = vec![Vec::new(); n_sensors];
    for ((&point, &laser), &time_s) in sweep.points.iter().zip(lasers).zip(times) {
        let position_m = DVec3::from_array(point);
        let (sensor, laser) = (usize::from(laser) / n_lasers, usize::from(laser) % n_lasers);
        sensors[sensor].push(Return { position_m, laser, time_s });
    }
    for (i, returns) in sensors.iter().enumerate() {
        let mut counts = vec![0; n_lasers];
        returns.iter().for_each(|r| counts[r.laser] += 1);
        if let Some(few) = counts.iter().position(|&n| n < 100) {
            let laser = i * n_lasers + few;
            bail!("laser {laser}: expected 100 returns, found {}", counts[few]);
        }
    }
    Ok(sensors)
}

/// A sweep of `sensor` in a street of even ground between walls, with the noise and the quantum of
/// its profile, in the precision of Argoverse 2's files.
pub fn simulated(sensor: &SensorProfile, table: &Rotating) -> Result<Vec<Return>> {
    let pattern = sensor.pattern();
    let sigma_m = sensor.noise.map_or(0.0, |noise| noise.typical_sigma_m);
    let effects = Effects {
        noise: Some(Noise { mean_m: 0.0, sigma_m, model: NoiseModel::Range }),
        quantum: sensor.range.quantum_m.map(|_| Quantum { step_m: None }),
        ..Effects::default()
    };
    let pose = Pose { position_m: dvec3(0.0, 0.0, HEIGHT_M), rotation: DQuat::IDENTITY };
    let mut request = ScanRequest::new(sensor, &pattern, pose);
    request.attributes = [Attribute::Beam, Attribute::Time].into();
    request.stream = StreamKey::new(0, "sensor", 0);
    let street = target(street(), Builder::Sah);
    let scan = scan(&OpenCaster::Cpu(effects), &street, &request)?;
    let (beams, times) = (scan.beam.context("no beams")?, scan.time_s.context("no times")?);
    let order = table.firing_order();
    let returns =
        scan.positions.iter().zip(beams.iter().zip(&times)).map(|(p, (&beam, &time_s))| {
            let laser = order[beam as usize % order.len()];
            let position_m = DVec3::from_array(p.map(|x| f16::from_f32(x).to_f64()));
            Return { position_m, laser, time_s: f64::from(time_s) }
        });
    Ok(returns.collect())
}

/// Ground of 240 m by 240 m, and walls 15 m high: a street 24 m wide and 120 m long.
fn street() -> TriangleMesh {
    let mut mesh = TriangleMesh::default();
    let mut quad = |corner: DVec3, a: DVec3, b: DVec3| {
        let first = mesh.vertices.len() as u32;
        mesh.vertices.extend([corner, corner + a, corner + a + b, corner + b]);
        mesh.triangles.extend([[first, first + 1, first + 2], [first, first + 2, first + 3]]);
    };
    quad(dvec3(-120.0, -120.0, 0.0), 240.0 * DVec3::X, 240.0 * DVec3::Y);
    for side in [-1.0, 1.0] {
        quad(dvec3(-60.0, side * 12.0, 0.0), 120.0 * DVec3::X, 15.0 * DVec3::Z);
        quad(dvec3(side * 60.0, -12.0, 0.0), 24.0 * DVec3::Y, 15.0 * DVec3::Z);
    }
    mesh
}
