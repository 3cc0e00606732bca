//! Packed sets of the same views of the same meshes, each with something else that goes wrong: how
//! robust a network is, as ModelNet-C measures it.

use crate::error::DatasetError;
use crate::mesh::{failed, failure, read};
use crate::record::{Entry, MeshFailure};
use formats::Split;
use formats::cloud::{normalize_unit_sphere, resample};
use formats::hash::Hashing;
use formats::packed::PackedWriter;
use formats::rng::StreamKey;
use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sim_gpu::effects::Effects;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::config::{InvalidValue, within};
use sim_gpu::internals::mesh::frame::{Normalize, Up};
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::pose::Pose;
use sim_gpu::internals::scan::{ScanError, ScanRequest, scan};
use sim_gpu::internals::sensor::{BeamPattern, SensorProfile, Views};
use sim_gpu::internals::target::{Surface, Target};
use std::collections::BTreeSet;
use std::path::Path;

/// What goes wrong with a clean scan of an object. The default is nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectCorruption {
    /// What the sensor and the air do.
    pub effects: Effects,
    /// Balls that hide parts of the object; they themselves are not in the cloud.
    pub occluders: u32,
    /// The balls' radius, metres. Each stands two thirds of the way to a point that it hides.
    pub radius_m: f64,
}

/// A set to write.
pub struct CorruptedSet {
    /// Its name: `NAME-test.npz`.
    pub name: String,
    /// What goes wrong with it.
    pub corruption: ObjectCorruption,
    /// Casts its rays: on the CPU, since test sets are small and have many effects.
    caster: OpenCaster,
    /// The beams that it casts.
    pattern: BeamPattern,
}

/// What was written.
pub struct Written {
    /// Clouds of each set, in their order.
    pub clouds: Vec<usize>,
    /// Clouds that each would have if a point of everything were seen.
    pub of: usize,
    /// The meshes that cannot be used.
    pub failures: Vec<MeshFailure>,
}

/// What all sets have in common.
pub struct Corrupted<'a> {
    /// The folder to write to.
    pub out: &'a Path,
    /// The sensor.
    pub sensor: &'a SensorProfile,
    /// Where it stands around each mesh.
    pub views: Views,
    /// The meshes' upward axis; `None` is each format's default.
    pub up: Option<Up>,
    /// Points of each cloud; of a scan with fewer, some are there more than once.
    pub points: u32,
    /// Keys every random number.
    pub seed: u64,
}

/// What is farther from the middle of the object than its radius of 1 m, and so much more, is not
/// of it: a robot cuts its objects out of what it sees.
const CUT_OUT_M: f32 = 1.1;

/// Meshes that are in memory together.
const AT_ONCE: usize = 32;

/// A cloud, and how many points its scan had.
type Drawn = Option<(Vec<[f32; 3]>, u32)>;

impl ObjectCorruption {
    /// Checks all numbers, which stand at `key`.
    ///
    /// # Errors
    /// On the first that is not finite or out of its bounds.
    pub fn validate(&self, key: &str) -> Result<(), InvalidValue> {
        let here =
            |error: InvalidValue| InvalidValue::new(format!("{key}.{}", error.key), error.cause);
        self.effects.validate().map_err(here)?;
        within(&format!("{key}.occluders"), f64::from(self.occluders), 0.0..=1000.0)?;
        within(&format!("{key}.radius_m"), self.radius_m, 0.0..=1000.0)?;
        if (self.occluders > 0) != (self.radius_m > 0.0) {
            let cause = "expected occluders and radius_m together, found one of them";
            return Err(InvalidValue::new(format!("{key}.occluders"), cause));
        }
        Ok(())
    }
}

impl CorruptedSet {
    /// The set `name` by `sensor`.
    ///
    /// # Errors
    /// Effects that do not fit the sensor.
    pub fn new(
        name: String,
        corruption: ObjectCorruption,
        sensor: &SensorProfile,
    ) -> Result<Self, InvalidValue> {
        corruption.effects.for_sensor(sensor)?;
        let pattern = corruption.effects.widen(sensor.pattern(), sensor)?;
        let caster = OpenCaster::Cpu(corruption.effects.clone());
        Ok(Self { name, corruption, caster, pattern })
    }
}

impl Corrupted<'_> {
    /// Writes `sets` of those of `meshes` that are for testing. Labels count the classes of all
    /// meshes. `each` is called after each mesh.
    ///
    /// # Errors
    /// A caster that fails; a file that cannot be written.
    pub fn write(
        &self,
        meshes: &[MeshEntry],
        sets: &[CorruptedSet],
        each: impl Fn() + Sync,
    ) -> Result<Written, DatasetError> {
        let classes: BTreeSet<&String> = meshes.iter().map(|entry| &entry.class).collect();
        let classes: Vec<String> = classes.into_iter().cloned().collect();
        let tested: Vec<&MeshEntry> =
            meshes.iter().filter(|entry| entry.split == Split::Test).collect();
        let mut writers = Vec::with_capacity(sets.len());
        for set in sets {
            let path = self.out.join(format!("{}-test.npz", set.name));
            writers.push(PackedWriter::create(&path, self.points as usize, classes.clone())?);
        }
        let (mut failures, mut of) = (Vec::new(), 0);
        for some in tested.chunks(AT_ONCE) {
            let clouds: Vec<Result<_, MeshFailure>> = some
                .par_iter()
                .map(|entry| {
                    let clouds = self.of_mesh(entry, sets);
                    each();
                    clouds
                })
                .collect::<Result<_, DatasetError>>()?;
            for (entry, clouds) in some.iter().zip(clouds) {
                let label = classes.partition_point(|class| *class < entry.class);
                match clouds {
                    Err(failure) => failures.push(failure),
                    Ok(views) => {
                        of += views.len();
                        push(&mut writers, entry, label, views)?;
                    }
                }
            }
        }
        let clouds = writers.iter().map(PackedWriter::len).collect();
        for writer in writers {
            writer.finish(Hashing::None)?;
        }
        Ok(Written { clouds, of, failures })
    }

    /// The clouds of one mesh, by view and by set.
    fn of_mesh(
        &self,
        entry: &MeshEntry,
        sets: &[CorruptedSet],
    ) -> Result<Result<Vec<Vec<Drawn>>, MeshFailure>, DatasetError> {
        let (mesh, kept) = match read(entry, self.up, Normalize::UnitSphere, Hashing::None) {
            Ok((_, mesh, kept)) => (mesh, kept),
            Err(error) => return Ok(Err(failure(entry, &error))),
        };
        if kept.is_empty() {
            let cause = "expected a triangle with an area, found none".to_owned();
            return Ok(Err(failed(entry, None, cause)));
        }
        let target = Target::new(Surface::new(mesh, kept), Builder::Sah);
        let id = Entry::from(entry).id();
        let jitter = StreamKey::new(self.seed, &format!("views/corrupted/{id}"), 0);
        let poses = self.views.poses(DVec3::ZERO, jitter);
        let of_view = |(pose, view): (Pose, u32)| {
            let stream = StreamKey::new(self.seed, &format!("corrupted/{id}"), view);
            let of_set = |set: &CorruptedSet| {
                Ok(self.cloud(&self.points_of(set, &target, pose, stream)?, stream))
            };
            sets.iter().map(of_set).collect::<Result<Vec<Drawn>, ScanError>>()
        };
        let views = poses.into_iter().zip(0..).map(of_view).collect::<Result<Vec<_>, _>>()?;
        Ok(Ok(views))
    }

    /// What is seen of the object in one view, around its middle.
    fn points_of(
        &self,
        set: &CorruptedSet,
        target: &Target,
        pose: Pose,
        stream: StreamKey,
    ) -> Result<Vec<[f32; 3]>, ScanError> {
        let mut request = ScanRequest::new(self.sensor, &set.pattern, pose);
        request.stream = stream;
        let scan = scan(&set.caster, target, &request)?;
        let origin = DVec3::from_array(scan.origin);
        let from_middle = |point: &[f32; 3]| origin + DVec3::from(point.map(f64::from));
        let mut points: Vec<DVec3> = scan.positions.iter().map(from_middle).collect();
        let ObjectCorruption { occluders, radius_m, .. } = set.corruption;
        // Points of the cloud are drawn by the stream itself.
        let [a, b] = stream.0;
        let places = StreamKey::new(u64::from(a) << 32 | u64::from(b), "corrupted/occluders", 0);
        let balls: Vec<DVec3> = (0..occluders)
            .filter(|_| !points.is_empty())
            .map(|n| {
                let hidden = points[places.below(points.len() as u64, n.into()) as usize];
                pose.position_m.lerp(hidden, 2.0 / 3.0)
            })
            .collect();
        let is_seen = |point: &DVec3| {
            !balls.iter().any(|&ball| hides(ball, radius_m, pose.position_m, *point))
        };
        points.retain(is_seen);
        let points = points.into_iter().map(|point| point.as_vec3());
        Ok(points.filter(|p| p.length() <= CUT_OUT_M).map(|p| p.to_array()).collect())
    }

    fn cloud(&self, points: &[[f32; 3]], stream: StreamKey) -> Drawn {
        let mut cloud = resample(points, self.points as usize, stream)?;
        normalize_unit_sphere(&mut cloud);
        Some((cloud, points.len() as u32))
    }
}

/// Whether a ball stands between the sensor and a point.
fn hides(ball: DVec3, radius_m: f64, sensor_m: DVec3, point: DVec3) -> bool {
    let (to_ball, to_point) = (ball - sensor_m, point - sensor_m);
    let along = to_ball.dot(to_point) / to_point.length_squared();
    (0.0..1.0).contains(&along) && ball.distance(sensor_m + to_point * along) < radius_m
}

/// Adds the views of one mesh to all sets.
fn push(
    writers: &mut [PackedWriter],
    entry: &MeshEntry,
    label: usize,
    views: Vec<Vec<Drawn>>,
) -> Result<(), DatasetError> {
    for (clouds, view) in views.into_iter().zip(0u32..) {
        let name = format!("{}_v{view}", Entry::from(entry).id());
        for (writer, cloud) in writers.iter_mut().zip(clouds) {
            if let Some((points, n_raw)) = cloud {
                writer.push(&points, label, &name, n_raw)?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_hides_what_is_behind_it_and_nothing_else() {
        let hidden = |point: [f64; 3]| {
            hides(DVec3::new(2.0, 0.0, 0.0), 0.2, DVec3::ZERO, DVec3::from_array(point))
        };
        assert!(hidden([3.0, 0.0, 0.0]) && hidden([3.0, 0.29, 0.0]));
        assert!(!hidden([3.0, 0.31, 0.0]) && !hidden([1.0, 0.0, 0.0]) && !hidden([-3.0, 0.0, 0.0]));
    }
}
