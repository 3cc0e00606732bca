//! What is wanted of a scan.

use super::{Caster, Error, Instance, Scan, Scene, Sensor};
use crate::caster::OpenCaster;
use crate::config::{InvalidValue, within};
use crate::effects::{Effects, Intensity};
use crate::pose::{Pose, Trajectory};
use crate::scan::{PlacedTarget, ScanRequest, Scanned, scan_objects_async};
use crate::scene::{check_motion, check_object, check_start};
use crate::sensor::BeamPattern;
use formats::rng::StreamKey;
use formats::scan::{Attribute, AttributeSet};
use formats::streams::{StartTime, Stream};
use std::sync::Arc;

/// A scan that [`ScanBuilder::run`] makes. Settings that are not given come from the [`Scene`].
#[derive(Clone, Debug)]
#[must_use = "`run` makes the scan"]
pub struct ScanBuilder<'a> {
    pub(super) scene: &'a Scene,
    pub(super) sensor: &'a Sensor,
    pose: Pose,
    key: Key<'a>,
    caster: Option<&'a Caster>,
    motion: Option<Arc<Trajectory>>,
    start_s: f64,
    deskew: bool,
    pub(super) effects: Effects,
    pub(super) attributes: AttributeSet,
    seed: u64,
}

/// What a scan needs of its sensor and effects.
pub(super) struct Prepared {
    pub effects: Effects,
    pub caster: Arc<OpenCaster>,
    pub rays: Arc<BeamPattern>,
}

/// What the random numbers of a scan belong to, besides its seed.
#[derive(Clone, Copy, Debug)]
struct Key<'a> {
    name: &'a str,
    number: u32,
}

impl Scene {
    /// A scan of the scene by `sensor` at `pose`: [`ScanBuilder::run`] makes it.
    pub fn scan<'a>(&'a self, sensor: &'a Sensor, pose: Pose) -> ScanBuilder<'a> {
        ScanBuilder::new(self, sensor, pose, Key { name: "scan", number: 0 })
    }

    /// A scan by each of the [`sensors`](Scene::sensors), in their order.
    ///
    /// # Errors
    /// As [`ScanBuilder::run`].
    pub fn scan_all(&self, caster: &Caster) -> Result<Vec<Scan>, Error> {
        (0..self.sensors.len()).map(|number| self.scan_mounted(number).with(caster).run()).collect()
    }

    /// The scan by sensor number `number` of [`sensors`](Scene::sensors).
    ///
    /// # Panics
    /// There is no such sensor.
    pub fn scan_mounted(&self, number: usize) -> ScanBuilder<'_> {
        let mounted = &self.sensors[number];
        let key = Key { name: &mounted.name, number: number as u32 };
        let scan = ScanBuilder::new(self, &mounted.sensor, mounted.pose, key);
        let scan = scan.start_s(mounted.start_s).deskewed(mounted.deskew);
        match &mounted.motion {
            Some(motion) => scan.along(Arc::clone(motion)),
            None => scan,
        }
    }
}

impl<'a> ScanBuilder<'a> {
    fn new(scene: &'a Scene, sensor: &'a Sensor, pose: Pose, key: Key<'a>) -> Self {
        Self {
            scene,
            sensor,
            pose,
            key,
            caster: None,
            motion: None,
            start_s: 0.0,
            deskew: false,
            effects: scene.effects.clone(),
            attributes: scene.attributes.clone(),
            seed: scene.seed,
        }
    }

    /// Casts on `caster`; by default the CPU casts.
    pub fn with(self, caster: &'a Caster) -> Self {
        Self { caster: Some(caster), ..self }
    }

    /// Applies these effects in place of the scene's.
    pub fn effects(self, effects: Effects) -> Self {
        Self { effects, ..self }
    }

    /// Gives points these attributes in place of the scene's. [`Attribute::Intensity`] asks for the
    /// effect of that name, too.
    pub fn attributes(self, attributes: impl IntoIterator<Item = Attribute>) -> Self {
        Self { attributes: attributes.into_iter().collect(), ..self }
    }

    /// Draws random numbers from this seed. Scans of one seed have the same noise: give each scan
    /// of a sequence a seed of its own.
    pub fn seed(self, seed: u64) -> Self {
        Self { seed, ..self }
    }

    /// Moves the sensor along these poses while it scans, in place of its pose.
    pub fn along(self, motion: impl Into<Arc<Trajectory>>) -> Self {
        Self { motion: Some(motion.into()), ..self }
    }

    /// Begins the scan at this time of all trajectories, seconds; 0 by default.
    pub fn start_s(self, start_s: f64) -> Self {
        Self { start_s, ..self }
    }

    /// Puts the points of a moving sensor where its beams met the surfaces. By default they are
    /// motion-distorted, as a driver that ignores ego-motion reports them.
    pub fn deskewed(self, deskew: bool) -> Self {
        Self { deskew, ..self }
    }

    pub(super) fn at(self, pose: Pose) -> Self {
        Self { pose, ..self }
    }

    /// Makes the scan.
    ///
    /// # Errors
    /// An effect, an instance, a pose or a time is out of its bounds; the sensor's profile lacks a value
    /// that an effect needs; a trajectory does not cover the scan; the adapter failed.
    pub fn run(self) -> Result<Scan, Error> {
        pollster::block_on(self.run_async())
    }

    /// As [`ScanBuilder::run`], in a browser too, where nothing may wait for an adapter.
    ///
    /// # Errors
    /// As [`ScanBuilder::run`].
    pub async fn run_async(self) -> Result<Scan, Error> {
        check_pose(|| "pose".to_owned(), self.pose)?;
        let Prepared { effects, caster, rays } = self.prepare_async().await?;
        let (request, placed) = (self.request(&rays), self.placed(|_| None));
        let Scanned { mut scan, tally, cast_on_cpu, .. } =
            scan_objects_async(&caster, &placed, &request).await?;
        let pose = self.motion.as_ref().map_or(self.pose, |motion| motion.at(self.start_s));
        scan.pose = (pose != Pose::IDENTITY).then(|| pose.matrix());
        Ok(Scan::new(scan, tally, cast_on_cpu, self.sensor.clone(), effects))
    }

    /// Checks everything but the pose of the sensor.
    pub(super) fn prepare(&self) -> Result<Prepared, Error> {
        pollster::block_on(self.prepare_async())
    }

    async fn prepare_async(&self) -> Result<Prepared, Error> {
        let mut effects = self.effects.clone();
        if self.attributes.contains(&Attribute::Intensity) {
            effects.intensity.get_or_insert(Intensity);
        }
        effects.validate()?;
        effects.for_sensor(self.sensor.profile())?;
        self.check_instances()?;
        let cpu = Caster::cpu();
        let caster = self.caster.unwrap_or(&cpu).for_effects_async(&effects).await?;
        let rays = self.sensor.rays(&effects)?;
        check_start("start_s", self.start_s)?;
        if let Some(motion) = &self.motion {
            let times_s = [self.start_s, self.start_s + rays.last_s()];
            check_motion("trajectory", motion, times_s)?;
        }
        Ok(Prepared { effects, caster, rays })
    }

    pub(super) fn request<'r>(&'r self, rays: &'r BeamPattern) -> ScanRequest<'r> {
        let mut request = ScanRequest::new(self.sensor.profile(), rays, self.pose);
        (request.motion, request.start_s) = (self.motion.clone(), self.start_s);
        request.deskew = self.deskew;
        request.attributes.clone_from(&self.attributes);
        request.stream = self.stream(self.key.name);
        request
    }

    /// The instances, those that `pose` names by their numbers elsewhere than in the scene.
    pub(super) fn placed(&self, pose: impl Fn(u32) -> Option<Pose>) -> Vec<PlacedTarget<'a>> {
        let (at, sensor) = (StartTime(self.start_s), self.key.number);
        self.scene.placed_at(pose, |name, number| match (name, number) {
            (Some(name), _) => Some(self.stream(name)),
            // A scene of one mesh has the random numbers of the scan.
            (None, 0) => None,
            (None, _) => Some(Stream::Instance { number, at, sensor }.key(self.seed)),
        })
    }

    /// The key of a name's random numbers. Scans of other times have other noise, other drops and
    /// other losses.
    fn stream(&self, name: &str) -> StreamKey {
        let at = StartTime(self.start_s);
        Stream::Scan { name, at, sensor: self.key.number }.key(self.seed)
    }

    fn check_instances(&self) -> Result<(), Error> {
        for (i, instance) in self.scene.instances().iter().enumerate() {
            let key = |field: &str| format!("instance[{i}].{field}");
            check_pose(|| key("pose"), instance.pose)?;
            let Instance { scale, reflectivity, retroreflection, .. } = *instance;
            check_object(key, scale.to_array(), reflectivity, retroreflection)?;
            within(&key("glass.returned"), instance.glass.as_ref().map(|g| g.returned), 0.0..=1.0)?;
            let n_faces = instance.materials.as_ref().map(|materials| materials.n_triangles());
            let n_triangles = instance.mesh.target().surface.triangles().len();
            if let Some(found) = n_faces.filter(|found| *found != n_triangles) {
                let cause =
                    format!("expected those of {n_triangles} triangles, found those of {found}");
                return Err(InvalidValue::new(key("materials"), cause).into());
            }
        }
        Ok(())
    }
}

/// That `pose`, which stands at `key`, is a place and a rotation.
pub(super) fn check_pose(key: impl Fn() -> String, pose: Pose) -> Result<(), InvalidValue> {
    let numbers = pose.position_m.to_array().into_iter().chain(pose.rotation.to_array());
    if let Some(number) = numbers.into_iter().find(|number| !number.is_finite()) {
        let cause = format!("expected finite numbers, found {number}");
        return Err(InvalidValue::new(key(), cause));
    }
    // Rounding moves the length of a product of rotations by a few ulps.
    if !pose.rotation.is_normalized() {
        let length = pose.rotation.length();
        let cause = format!("expected a rotation of length 1, found length {length}");
        return Err(InvalidValue::new(key(), cause));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pose_of_a_scan_is_that_when_it_begins() {
        let poses = [0.0, 9.0].map(|time_s| (time_s, Pose::at([3.0 * time_s, 0.0, 0.0])));
        let (scene, sensor) = (Scene::new(), Sensor::named("vlp16").unwrap());
        let scan =
            scene.scan(&sensor, Pose::IDENTITY).along(Trajectory::new(poses.into()).unwrap());
        assert_eq!(scan.start_s(2.0).run().unwrap().points.pose.unwrap()[3], 6.0);
    }
}
