//! One turn of the plain scene on the CPU: cast, solved, made into points. The
//! program beside this file and `cargo xtask bench plain` both run it, each
//! against its own build of `sim-gpu`.

use cpu_time::ProcessTime;
use formats::Scan;
use formats::rng::StreamKey;
use glam::{DAffine3, DVec3};
use sim_gpu::bvh::Builder;
use sim_gpu::cpu::trace;
use sim_gpu::effects::Effects;
use sim_gpu::job::{CastJob, Culling};
use sim_gpu::mesh::census::survey;
use sim_gpu::mesh::frame::{Normalize, to_world};
use sim_gpu::mesh::{MeshError, load};
use sim_gpu::pose::Pose;
use sim_gpu::ray::RayFrame;
use sim_gpu::resolve::resolve;
use sim_gpu::scan::{Seen, View, assemble};
use sim_gpu::sensor::{BeamPattern, Sensor};
use sim_gpu::target::{Surface, Target};
use std::hint::black_box;
use std::path::Path;
use std::sync::Arc;

/// Revolutions of one turn: some tenths of a second.
const REVOLUTIONS: usize = 40;

/// A mesh, a sensor 3 m away, and nothing that was asked for.
pub struct Plain {
    sensor: Sensor,
    pattern: BeamPattern,
    pose: Pose,
    job: CastJob,
}

impl Plain {
    /// The scene with the mesh at `path`.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn new(path: &Path) -> Result<Self, MeshError> {
        let loaded = load(path)?;
        let world = to_world(&loaded.mesh, loaded.format.default_up(), Normalize::UnitSphere);
        let kept = survey(&world.mesh).kept;
        let target = Arc::new(Target::new(Surface::new(world.mesh, kept), Builder::Sah));
        let sensor = Sensor::builtin("vlp32c").expect("invariant: this profile is built in");
        let pattern = sensor.pattern();
        let pose = Pose::view(3.0, 20f64.to_radians(), 0.0, DVec3::ZERO);
        let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, &pose);
        let stream = StreamKey::new(0, "plain", 0);
        let job = CastJob::aim(target, frame, &pattern, Culling::On, stream, 1.0);
        Ok(Self { sensor, pattern, pose, job })
    }

    /// Rays of one turn.
    pub fn rays(&self) -> usize {
        REVOLUTIONS * self.job.rays.len()
    }

    /// The scan.
    pub fn scan(&self) -> Scan {
        let effects = Effects::default();
        let cast = trace::cast(&self.job, &effects);
        let hits = resolve(&self.job, &cast, &self.pattern, &effects);
        let view = View {
            sensor: &self.sensor,
            pattern: &self.pattern,
            pose: &self.pose,
            cast_effects: &effects,
            effects: &effects,
            attributes: &[].into(),
            stream: self.job.stream,
        };
        let world_from_object = &DAffine3::IDENTITY;
        let seen = [Seen { object: 0, world_from_object, job: &self.job, hits: &hits }];
        assemble(&view, &seen).0
    }

    /// Seconds of CPU time that one turn takes.
    pub fn turn(&self) -> f64 {
        let start = ProcessTime::now();
        for _ in 0..REVOLUTIONS {
            black_box(self.scan());
        }
        start.elapsed().as_secs_f64()
    }
}

/// The scan's points as one number: equal for equal bits, and hardly else.
/// FNV-1a.
pub fn fingerprint(scan: &Scan) -> u64 {
    let words = scan.positions.as_flattened().iter().map(|x| x.to_bits());
    words.fold(0xCBF2_9CE4_8422_2325, |hash, word| {
        (hash ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01B3)
    })
}
