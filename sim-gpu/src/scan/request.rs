//! What is wanted of one scan.

use crate::config::InvalidValue;
use crate::effects::Effects;
use crate::job::{CastJob, Culling};
use crate::pose::Pose;
use crate::ray::RayFrame;
use crate::sensor::{BeamPattern, Sensor};
use crate::target::Target;
use formats::rng::StreamKey;
use formats::scan::{Attribute, AttributeSet};
use glam::DAffine3;

/// One sensor at one place, and what is wanted of its scan.
///
/// [`ScanRequest::new`] fills in the defaults; every field may be set after it:
///
/// ```
/// # use sim_gpu::{pose::Pose, scan::ScanRequest, sensor::Sensor};
/// # use sim_gpu::formats::scan::Attribute;
/// # use sim_gpu::glam::DVec3;
/// let sensor = Sensor::builtin("vlp32c").expect("a built-in sensor");
/// let pattern = sensor.pattern();
/// let pose = Pose::look_at(DVec3::new(3.0, 0.0, 1.0), DVec3::ZERO)?;
/// let mut request = ScanRequest::new(&sensor, &pattern, pose);
/// request.attributes = [Attribute::Range, Attribute::Ring].into();
/// # Ok::<(), sim_gpu::config::InvalidValue>(())
/// ```
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ScanRequest<'a> {
    /// The sensor.
    pub sensor: &'a Sensor,
    /// The beams of the sensor, [`Sensor::pattern`], which many requests share.
    pub pattern: &'a BeamPattern,
    /// Where the sensor stands.
    pub pose: Pose,
    /// The effects to apply, which must be among those that the caster models;
    /// `None`, the default, applies all of them.
    pub effects: Option<Effects>,
    /// What each point carries besides its position; nothing by default.
    pub attributes: AttributeSet,
    /// Keys all random numbers of the scan. Requests of the same key have the
    /// same noise.
    pub stream: StreamKey,
    /// Whether beams that cannot hit are cast; the scan is the same.
    pub culling: Culling,
}

/// An object that a sensor looks at.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct PlacedTarget<'a> {
    /// The object.
    pub target: &'a Target,
    /// Where it stands.
    pub world_from_object: DAffine3,
    /// Its reflectivity, 0 to 1; 1 by default.
    pub reflectivity: f32,
    /// Keys the random numbers of the object's returns; `None`, the default,
    /// takes the request's key.
    pub stream: Option<StreamKey>,
}

impl<'a> ScanRequest<'a> {
    /// A scan of `sensor`, whose beams are `pattern`, from `pose`: positions
    /// alone, with all effects of the caster, and random numbers of seed 0.
    #[must_use]
    pub fn new(sensor: &'a Sensor, pattern: &'a BeamPattern, pose: Pose) -> Self {
        Self {
            sensor,
            pattern,
            pose,
            effects: None,
            attributes: AttributeSet::new(),
            stream: StreamKey::new(0, "scan", 0),
            culling: Culling::On,
        }
    }

    /// The effects that this scan applies if the caster models `cast_effects`,
    /// with the sensor's own quantum filled in.
    ///
    /// # Errors
    /// If quantisation is wanted and the sensor states no quantum, or if
    /// intensity is wanted as an attribute and the caster does not model it.
    pub fn applied_effects(&self, cast_effects: &Effects) -> Result<Effects, InvalidValue> {
        if self.attributes.contains(&Attribute::Intensity) && cast_effects.intensity.is_none() {
            let cause = "expected a caster that models intensity, found one without";
            return Err(InvalidValue::new("attributes", cause));
        }
        self.effects.as_ref().unwrap_or(cast_effects).for_sensor(self.sensor)
    }

    /// The rays of the sensor at `placed`.
    #[must_use]
    pub fn aim(&self, placed: &PlacedTarget) -> CastJob {
        let &PlacedTarget { target, world_from_object, reflectivity, stream } = placed;
        let frame = RayFrame::new(&target.surface, &world_from_object, &self.pose);
        let stream = stream.unwrap_or(self.stream);
        CastJob::aim(target.clone(), frame, self.pattern, self.culling, stream, reflectivity)
    }
}

impl<'a> PlacedTarget<'a> {
    /// `target` where its mesh stands, in the world's frame.
    #[must_use]
    pub fn new(target: &'a Target) -> Self {
        Self { target, world_from_object: DAffine3::IDENTITY, reflectivity: 1.0, stream: None }
    }
}
