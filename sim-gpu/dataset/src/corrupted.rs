//! Packed sets of the same views of the same meshes with one corruption each, which measure how
//! robust a network is, as ModelNet-C does.

use crate::error::DatasetError;
use crate::mesh::{read, warnings};
use crate::packed_sets::{Drawn, classes, write_packed_sets};
use crate::progress::Progress;
use crate::record::{Entry, MeshFailure};
use formats::Split;
use formats::cloud::{normalize_unit_sphere, resample};
use formats::hash::Hashing;
use formats::rng::StreamKey;
use formats::streams::Stream;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use sim_gpu::effects::Effects;
use sim_gpu::internals::bvh::Builder;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::config::{InvalidValue, within};
use sim_gpu::internals::mesh::frame::{Normalize, Unit, Up};
use sim_gpu::internals::mesh::tree::MeshEntry;
use sim_gpu::internals::scan::{ScanError, ScanRequest, scan};
use sim_gpu::internals::sensor::{BeamPattern, Views};
use sim_gpu::internals::target::{Surface, Target};
use sim_gpu::{Pose, Sensor};
use std::path::Path;
use std::sync::Arc;

/// A corruption of the clean scan of an object. The default changes nothing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjectCorruption {
    /// Effects of the sensor and of the air.
    pub effects: Effects,
    /// Number of balls that hide parts of the object. The balls are not in the cloud.
    pub occluders: u32,
    /// The balls' radius, metres. Each ball stands at two thirds of the way to a point that it hides.
    pub radius_m: f64,
}

/// A packed set to write.
pub struct CorruptedSet {
    /// Its name; the file is `NAME-test.npz`.
    pub name: String,
    /// The corruption of its scans.
    pub corruption: ObjectCorruption,
    /// Casts its rays, on the CPU, since test sets are small and differ in their effects.
    caster: OpenCaster,
    pattern: Arc<BeamPattern>,
}

/// The result of [`Corrupted::write`].
pub struct Written {
    /// The number of clouds of each set.
    pub clouds: Vec<usize>,
    /// The number of clouds of a set in which every view sees a point.
    pub of: usize,
    /// The meshes that cannot be scanned.
    pub failures: Vec<MeshFailure>,
}

/// The settings that all sets share.
pub struct Corrupted<'a> {
    /// The folder to write to.
    pub out: &'a Path,
    /// The sensor.
    pub sensor: &'a Sensor,
    /// Its viewpoints around each mesh.
    pub views: Views,
    /// The meshes' upward axis; `None` is each format's default.
    pub up: Option<Up>,
    /// Points of each cloud. The cloud of a scan with fewer has some points more than once.
    pub points: u32,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Points farther than this from the centre of the object, whose radius is 1 m, are left out: a
/// robot cuts an object out of its scan.
const CUT_OUT_M: f32 = 1.1;

impl ObjectCorruption {
    /// Checks all numbers of the table `key`.
    ///
    /// # Errors
    /// The first number that is not finite or out of its bounds.
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
    /// The set `name`, scanned by `sensor`.
    ///
    /// # Errors
    /// Effects that do not fit the sensor.
    pub fn new(
        name: String,
        corruption: ObjectCorruption,
        sensor: &Sensor,
    ) -> Result<Self, InvalidValue> {
        corruption.effects.for_sensor(sensor.profile())?;
        let pattern = sensor.rays(&corruption.effects)?;
        let caster = OpenCaster::Cpu(corruption.effects.clone());
        Ok(Self { name, corruption, caster, pattern })
    }
}

impl Corrupted<'_> {
    /// Writes `sets` of those of `meshes` that are for testing. Labels are indices into the classes
    /// of all meshes. Notes what is doubtful about meshes in `progress`, and calls `each` after each.
    ///
    /// # Errors
    /// A caster that fails; a file that cannot be written.
    pub fn write(
        &self,
        meshes: &[MeshEntry],
        sets: &[CorruptedSet],
        progress: &Progress,
        each: impl Fn() + Sync,
    ) -> Result<Written, DatasetError> {
        let path = |set: &CorruptedSet| self.out.join(format!("{}-test.npz", set.name));
        let paths: Vec<_> = sets.iter().map(path).collect();
        let tested: Vec<&MeshEntry> =
            meshes.iter().filter(|entry| entry.split == Split::Test).collect();
        let draw = |entry: &MeshEntry| {
            let drawn = self.draw(entry, sets, progress);
            each();
            drawn
        };
        let (n, classes) = (self.points as usize, classes(meshes));
        let (clouds, failures) = write_packed_sets(&paths, n, &classes, &tested, draw)?;
        let of = (tested.len() - failures.len()) * self.views.count as usize;
        Ok(Written { clouds, of, failures })
    }

    /// The clouds of one mesh, by view and by set.
    fn draw(
        &self,
        entry: &MeshEntry,
        sets: &[CorruptedSet],
        progress: &Progress,
    ) -> Result<Vec<Drawn>, DatasetError> {
        let (record, mesh, kept) =
            read(entry, self.up, Unit::Metre, Normalize::UnitSphere, Hashing::None)?;
        warnings(&record, None).for_each(|warning| progress.note(warning));
        if kept.is_empty() {
            let cause = "expected a triangle with an area, found none";
            return Err(MeshFailure::new(entry, cause).into());
        }
        let target = Target::new(Surface::new(mesh, kept), Builder::Sah);
        let id = Entry::from(entry).id();
        let jitter = Stream::CorruptedViews { mesh: &id }.key(self.seed);
        let mut drawn = Vec::new();
        for (pose, view) in self.views.poses(DVec3::ZERO, jitter).into_iter().zip(0..) {
            let stream = Stream::Corrupted { mesh: &id, view }.key(self.seed);
            for (set, corrupted) in sets.iter().enumerate() {
                let seen = self.points_of(corrupted, &target, pose, stream)?;
                // A view in which nothing is seen has no cloud.
                let Some(mut points) = resample(&seen, self.points as usize, stream) else {
                    continue;
                };
                normalize_unit_sphere(&mut points);
                let (name, n_raw) = (format!("{id}_v{view}"), seen.len() as u32);
                drawn.push(Drawn { set, name, points, n_raw });
            }
        }
        Ok(drawn)
    }

    /// The points of the object in one view, around its centre.
    fn points_of(
        &self,
        set: &CorruptedSet,
        target: &Target,
        pose: Pose,
        stream: StreamKey,
    ) -> Result<Vec<[f32; 3]>, ScanError> {
        let mut request = ScanRequest::new(self.sensor.profile(), &set.pattern, pose);
        request.stream = stream;
        let scan = scan(&set.caster, target, &request)?;
        let origin = DVec3::from_array(scan.origin);
        let from_centre = |point: &[f32; 3]| origin + DVec3::from(point.map(f64::from));
        let mut points: Vec<DVec3> = scan.positions.iter().map(from_centre).collect();
        let ObjectCorruption { occluders, radius_m, .. } = set.corruption;
        // The stream itself draws the points of the cloud.
        let [a, b] = stream.0;
        let places = Stream::Occluders {}.key(u64::from(a) << 32 | u64::from(b));
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
}

/// Whether a ball stands between the sensor and `point`.
fn hides(ball: DVec3, radius_m: f64, sensor_m: DVec3, point: DVec3) -> bool {
    let (to_ball, to_point) = (ball - sensor_m, point - sensor_m);
    let along = to_ball.dot(to_point) / to_point.length_squared();
    (0.0..1.0).contains(&along) && ball.distance(sensor_m + to_point * along) < radius_m
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
