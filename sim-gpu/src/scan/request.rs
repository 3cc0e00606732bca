//! The request for a scan.

use crate::aim::{Culling, aim};
use crate::config::InvalidValue;
use crate::effects::Effects;
use crate::job::CastJob;
use crate::motion::Motion;
use crate::pose::{Pose, Trajectory};
use crate::ray::RayFrame;
use crate::sensor::{BeamPattern, SensorProfile};
use crate::target::Target;
use edgepuck_mesh::material::Materials;
use formats::rng::StreamKey;
use formats::scan::{Attribute, AttributeSet};
use formats::streams::{StartTime, Stream};
use glam::DAffine3;
use std::ops::Range;
use std::sync::Arc;

/// A sensor, its pose, and the properties of its scan. [`ScanRequest::new`] fills in the defaults.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ScanRequest<'a> {
    /// The sensor.
    pub sensor: &'a SensorProfile,
    /// The beams of the sensor, [`SensorProfile::pattern`], which many requests share.
    pub pattern: &'a BeamPattern,
    /// The pose of a sensor that does not move.
    pub pose: Pose,
    /// The poses of a sensor that moves.
    pub motion: Option<Arc<Trajectory>>,
    /// The time of trajectories at which the scan begins, seconds; 0 by default.
    pub start_s: f64,
    /// Whether the motion of the sensor is compensated in its points. By default points are
    /// motion-distorted, as a driver that ignores ego-motion reports them.
    pub deskew: bool,
    /// The effects to apply, some of the caster's; `None`, the default, applies all of them.
    pub effects: Option<Effects>,
    /// The attributes of points besides their positions; none by default.
    pub attributes: AttributeSet,
    /// The stream of all random numbers of the scan; by default that of seed 0.
    pub stream: StreamKey,
    /// Whether beams that cannot hit an object are cast. The scan is the same.
    pub culling: Culling,
}

/// An object in view of a sensor.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct PlacedTarget<'a> {
    /// The object.
    pub target: &'a Target,
    /// Its pose in the world or, if it moves, in the frame that moves with it.
    pub world_from_object: DAffine3,
    /// The poses of the frame of an object that moves.
    pub motion: Option<Arc<Trajectory>>,
    /// Its reflectivity, 0 to 1; 1 by default.
    pub reflectivity: f32,
    /// The stream of the random numbers of its returns; `None`, the default, is the request's.
    pub stream: Option<StreamKey>,
    /// Its panes; none by default.
    pub glass: Option<Glass>,
    /// As [`Material::retroreflection`](edgepuck_mesh::material::Material::retroreflection); default 0.
    pub retroreflection: f64,
    /// The materials of its triangles, instead of its reflectivity and retroreflection, if any.
    pub materials: Option<&'a Materials>,
}

/// Panes of an object. Glass reflects and transmits most of the light elsewhere, and returns few
/// beams.
#[derive(Clone, Debug, PartialEq)]
pub struct Glass {
    /// The triangles that are glass, as indices into the mesh.
    pub triangles: Range<u32>,
    /// The part of the beams that return from glass, 0 to 1; the others are lost.
    pub returned: f64,
}

impl<'a> ScanRequest<'a> {
    /// A scan of `sensor`, whose beams are `pattern`, from `pose`, with the defaults of the fields.
    #[must_use]
    pub fn new(sensor: &'a SensorProfile, pattern: &'a BeamPattern, pose: Pose) -> Self {
        Self {
            sensor,
            pattern,
            pose,
            motion: None,
            start_s: 0.0,
            deskew: false,
            effects: None,
            attributes: AttributeSet::new(),
            stream: Stream::Scan { name: "scan", at: StartTime(0.0), sensor: 0 }.key(0),
            culling: Culling::On,
        }
    }

    /// The effects that this scan applies of `cast_effects`, with the sensor's quantum filled in.
    pub fn applied_effects(&self, cast_effects: &Effects) -> Result<Effects, InvalidValue> {
        if self.attributes.contains(&Attribute::Intensity) && cast_effects.intensity.is_none() {
            let cause = "expected a caster that models intensity, found one without";
            return Err(InvalidValue::new("attributes", cause));
        }
        let effects = self.effects.as_ref().unwrap_or(cast_effects).for_sensor(self.sensor)?;
        let found = self.pattern.rays_per_beam;
        match effects.footprint.map(|footprint| footprint.samples) {
            Some(expected) if expected != found => {
                let cause = format!(
                    "expected a pattern of {expected} rays for each beam, as Effects::widen makes \
                     it, found {found}"
                );
                Err(InvalidValue::new("effects.footprint", cause))
            }
            _ => Ok(effects),
        }
    }

    /// The same request; if its effects move the sensor, and it has no poses over time, with those.
    pub(super) fn in_motion(&self, cast_effects: &Effects) -> Self {
        let mut request = self.clone();
        let effects = self.effects.as_ref().unwrap_or(cast_effects);
        if let (None, Some(motion)) = (&self.motion, &effects.motion) {
            let times_s = [self.start_s, self.start_s + self.pattern.last_s()];
            request.motion = Some(Arc::new(motion.trajectory(self.pose, times_s)));
        }
        request
    }

    /// The rays of the sensor at `placed`.
    #[must_use]
    pub fn aim(&self, placed: &PlacedTarget) -> CastJob {
        self.aim_where(placed, |_| true)
    }

    pub(super) fn aim_where(
        &self,
        placed: &PlacedTarget,
        is_wanted: impl Fn(u32) -> bool,
    ) -> CastJob {
        let PlacedTarget { target, reflectivity, stream, .. } = placed;
        let frame = self.frame(placed);
        let stream = stream.unwrap_or(self.stream);
        // Materials are applied once the triangles that were hit are known.
        let reflectivity = if placed.materials.is_some() { 1.0 } else { *reflectivity };
        let target = (*target).clone();
        let motion = self.motion_at(placed);
        let (beams, aim) = match &motion {
            None => aim(&frame, self.pattern, self.culling, is_wanted),
            Some(motion) => motion.aim(&target.surface, self.pattern, self.culling, is_wanted),
        };
        CastJob { target, frame, motion, beams, aim, stream, reflectivity }
    }

    pub(super) fn pose_at_start(&self) -> Pose {
        self.motion.as_ref().map_or(self.pose, |motion| motion.at(self.start_s))
    }

    pub(super) fn pose_at(&self, ray: u32) -> Pose {
        self.motion
            .as_ref()
            .map_or(self.pose, |motion| motion.at(self.start_s + self.pattern.time_s[ray as usize]))
    }

    /// The motion of the sensor and of `placed`, if one of them moves.
    fn motion_at(&self, placed: &PlacedTarget) -> Option<Motion> {
        (self.motion.is_some() || placed.motion.is_some()).then(|| Motion {
            pose: self.pose,
            sensor: self.motion.clone(),
            world_from_object: placed.world_from_object,
            object: placed.motion.clone(),
            start_s: self.start_s,
        })
    }

    /// A lower bound of the range of `placed`, metres.
    pub(super) fn nearest_m(&self, placed: &PlacedTarget) -> f64 {
        if self.motion.is_some() || placed.motion.is_some() {
            return 0.0;
        }
        self.frame(placed).nearest_m(self.pattern)
    }

    fn frame(&self, placed: &PlacedTarget) -> RayFrame {
        if let Some(motion) = self.motion_at(placed) {
            return motion.frame_at(&placed.target.surface, 0.0);
        }
        RayFrame::new(&placed.target.surface, &placed.world_from_object, &self.pose)
    }
}

impl<'a> PlacedTarget<'a> {
    /// `target` with the coordinates of its mesh as world coordinates.
    #[must_use]
    pub fn new(target: &'a Target) -> Self {
        Self {
            target,
            world_from_object: DAffine3::IDENTITY,
            motion: None,
            reflectivity: 1.0,
            stream: None,
            glass: None,
            retroreflection: 0.0,
            materials: None,
        }
    }
}
