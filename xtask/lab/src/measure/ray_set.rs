//! Rays to be cast at one target, as a caster and as the oracle see them.

use formats::rng::StreamKey;
use glam::{DAffine3, DQuat, DVec3, dvec3};
use sim_gpu::internals::cpu::oracle;
use sim_gpu::internals::job::{Aim, Cast, CastJob, Culling};
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::ray::{AMBIGUOUS, MISS, Ray, RayFrame};
use sim_gpu::internals::sensor::{BeamPattern, SensorProfile};
use sim_gpu::internals::target::Target;

/// Numbers the benchmark's own random streams.
const SEED: u64 = 0x000E_D6E9;

/// The sweeps stand 5 m away, as those of the published comparisons do.
const SENSOR_M: DVec3 = dvec3(5.0, 0.0, 0.5);

/// Rays against one target. Ray `i` of both lists is the same.
#[derive(Clone)]
pub struct RaySet {
    /// The rays as casters read them; beam `i` is number `i` of a sensor's pattern, or of this
    /// list.
    pub job: CastJob,
    /// The rays in f64, in the target's unit frame.
    pub rays: Vec<Ray>,
}

impl RaySet {
    pub fn sweep(target: &Target, pose: &Pose, pattern: &BeamPattern, culling: Culling) -> Self {
        let frame = RayFrame::new(&target.surface, &DAffine3::IDENTITY, pose);
        let stream = StreamKey::new(SEED, "sweep", 0);
        let job = CastJob::aim(target.clone(), frame, pattern, culling, stream, 1.0);
        let rays = job.beams.iter().map(|&beam| frame.beam(pattern, beam)).collect();
        Self { job, rays }
    }

    /// `n` rays from random places 5 m away through random points of the unit
    /// ball: hardly two of them traverse alike.
    pub fn incoherent(target: &Target, n: usize) -> Self {
        const DISTANCE_M: f64 = 5.0;
        let key = StreamKey::new(SEED, "incoherent", 0);
        let on_sphere = |i: u64| {
            let z = 2.0 * key.unit(i) - 1.0;
            let (sin, cos) = (std::f64::consts::TAU * key.unit(i + 1)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            DVec3::new(r * cos, r * sin, z)
        };
        let pairs = (0..n as u64).map(|i| {
            let point = on_sphere(5 * i + 2) * key.unit(5 * i + 4).cbrt();
            (on_sphere(5 * i) * DISTANCE_M, point)
        });
        Self::of(target, pairs)
    }

    fn of(target: &Target, pairs: impl Iterator<Item = (DVec3, DVec3)>) -> Self {
        let surface = &target.surface;
        let anywhere = Pose { position_m: DVec3::ZERO, rotation: DQuat::IDENTITY };
        let frame = RayFrame::new(surface, &DAffine3::IDENTITY, &anywhere);
        let rays: Vec<Ray> = pairs
            .map(|(origin, point)| Ray {
                origin: surface.frame.to_unit(origin),
                direction: (point - origin).normalize() / surface.frame.scale,
            })
            .collect();
        let job = CastJob {
            motion: None,
            target: target.clone(),
            frame,
            beams: (0..rays.len() as u32).collect(),
            aim: Aim::Rays(rays.iter().map(|ray| frame.trace_ray_unculled(ray, 0)).collect()),
            stream: StreamKey::new(SEED, "points", 0),
            reflectivity: 1.0,
        };
        Self { job, rays }
    }

    /// Each ray's origin and unit direction in the world, metres.
    pub fn in_world(&self) -> impl Iterator<Item = (DVec3, DVec3)> {
        let frame = self.job.target.surface.frame;
        self.rays
            .iter()
            .map(move |ray| (ray.origin * frame.scale + frame.centre, ray.direction * frame.scale))
    }

    /// The ranges that follow from a caster's codes, in metres, as
    /// `sim_gpu::internals::resolve` finds them; `[n_rays]`.
    pub fn ranges(&self, cast: &Cast) -> Vec<Option<f64>> {
        let target = &self.job.target;
        let range = |(ray, &code): (&Ray, &u32)| match code {
            MISS => None,
            code if code & AMBIGUOUS == 0 => oracle::range_to(target, ray, code),
            _ => oracle::nearest(target, ray).map(|nearest| nearest.range_m),
        };
        self.rays.iter().zip(&cast.codes).map(range).collect()
    }
}

pub fn vlp32c() -> SensorProfile {
    SensorProfile::builtin("vlp32c").expect("invariant: this profile is built in")
}

pub fn sweep_pose() -> Pose {
    Pose::look_at(SENSOR_M, DVec3::ZERO).expect("invariant: the sensor is not at the origin")
}
