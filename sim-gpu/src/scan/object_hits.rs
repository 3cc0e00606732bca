//! The hits of one object, and the counts of a scan's returns.

use super::request::{Glass, PlacedTarget};
use crate::job::CastJob;
use crate::motion::Motion;
use crate::resolve::{Hit, Hits};
use crate::sensor::BeamPattern;
use edgepuck_mesh::material::{Material, Materials};
use glam::DAffine3;
use serde::{Deserialize, Serialize};
use std::ops::AddAssign;

/// A hit, by its place in the lists of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct HitId {
    pub object: u32,
    pub hit: u32,
}

/// The hits of one object.
#[derive(Clone, Copy, Debug)]
pub struct ObjectHits<'a> {
    /// The object's number in its scene.
    pub object: u32,
    /// The pose of an object that does not move.
    pub world_from_object: DAffine3,
    /// Its panes.
    pub glass: Option<&'a Glass>,
    /// As [`PlacedTarget::retroreflection`](super::PlacedTarget::retroreflection).
    pub retroreflection: f64,
    /// The materials of its triangles, if they differ.
    pub materials: Option<&'a Materials>,
    /// The rays that were cast at it.
    pub job: &'a CastJob,
    /// The hits of these rays.
    pub hits: &'a Hits,
}

impl<'a> ObjectHits<'a> {
    /// The `hits` of `job` on `placed`, which is object number `object` of its scene.
    #[must_use]
    pub fn new(
        object: u32,
        placed: &'a PlacedTarget<'a>,
        job: &'a CastJob,
        hits: &'a Hits,
    ) -> Self {
        let PlacedTarget { world_from_object, ref glass, .. } = *placed;
        let glass = glass.as_ref();
        let PlacedTarget { retroreflection, materials, .. } = *placed;
        Self { object, world_from_object, glass, retroreflection, materials, job, hits }
    }

    pub(super) fn world_from_object_at(&self, pattern: &BeamPattern, ray: u32) -> DAffine3 {
        let at = |motion: &Motion| motion.world_from_object_at(pattern.time_s[ray as usize]);
        self.job.motion.as_ref().map_or(self.world_from_object, at)
    }

    /// Whether its scale differs from axis to axis.
    pub(super) fn is_uneven(&self) -> bool {
        let [x, y, z] =
            [0, 1, 2].map(|axis| self.world_from_object.matrix3.col(axis).length_squared());
        // Rotations change lengths by a few ulps.
        let is_as_x = |other: f64| (other - x).abs() <= 1e-12 * x;
        !(is_as_x(y) && is_as_x(z))
    }

    /// Whether its normals may change from ray to ray.
    pub(super) fn moves(&self) -> bool {
        self.job.motion.is_some()
    }

    pub(super) fn material(&self, hit: &Hit) -> Material {
        let (reflectivity, retroreflection) = (self.job.reflectivity.into(), self.retroreflection);
        let one = Material { reflectivity, retroreflection };
        self.materials.map_or(one, |materials| materials.of_triangle(hit.triangle))
    }
}

/// Counts of a scan's returns by their fate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Tally {
    /// Points in the scan.
    pub points: u64,
    /// Beams whose nearest surface lies outside the sensor's range.
    pub out_of_range: u64,
    /// Returns lost to dropout or in glass.
    pub dropped: u64,
    /// Returns too weak to be detected.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub undetected: u64,
    /// Returns whose measured range is not positive.
    pub negative: u64,
    /// Points of rain, snow, fog or dust.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub scattered: u64,
}

fn is_zero(n: &u64) -> bool {
    *n == 0
}

impl AddAssign for Tally {
    fn add_assign(&mut self, other: Self) {
        self.points += other.points;
        self.out_of_range += other.out_of_range;
        self.dropped += other.dropped;
        self.undetected += other.undetected;
        self.negative += other.negative;
        self.scattered += other.scattered;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_count_is_summed() {
        let tally = |[points, out_of_range, dropped, undetected, negative, scattered]: [u64; 6]| {
            Tally { points, out_of_range, dropped, undetected, negative, scattered }
        };
        let mut sum = tally([1, 2, 3, 4, 5, 6]);
        sum += tally([10, 20, 30, 40, 50, 60]);
        assert_eq!(sum, tally([11, 22, 33, 44, 55, 66]));
    }
}
