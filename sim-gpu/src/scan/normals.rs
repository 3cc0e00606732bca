//! The normals of what was hit, in world axes.

use super::assemble::ObjectHits;
use crate::cpu::oracle;
use crate::resolve::Hit;
use crate::sensor::BeamPattern;
use glam::{DAffine3, DMat3, DVec3};

/// The normals of objects that do not turn, of which rays of one beam often ask for the same.
pub(super) struct Normals {
    /// From each object to the world, `[n_objects]`.
    of_object: Vec<DMat3>,
    /// The object and the triangle that were asked for last, and what was answered.
    last: Option<(usize, u32, DVec3)>,
}

impl Normals {
    pub fn new(objects: &[ObjectHits]) -> Self {
        let of_object = objects.iter().map(|found| of_normals(&found.world_from_object));
        Self { of_object: of_object.collect(), last: None }
    }

    /// The unit normal where object number `object`, which is `found`, was hit, in world axes.
    pub fn at(
        &mut self,
        object: usize,
        found: &ObjectHits,
        pattern: &BeamPattern,
        hit: &Hit,
    ) -> DVec3 {
        if found.turns() {
            return unit_normal(found, pattern, hit);
        }
        match self.last {
            Some((of, at, normal)) if (of, at) == (object, hit.triangle) => normal,
            _ => {
                let in_object = oracle::normal(&found.job.target, hit.triangle);
                let normal = (self.of_object[object] * in_object).normalize_or_zero();
                self.last = Some((object, hit.triangle, normal));
                normal
            }
        }
    }
}

/// A unit normal of the surface in world axes; zero for a triangle without area.
pub(super) fn unit_normal(found: &ObjectHits, pattern: &BeamPattern, hit: &Hit) -> DVec3 {
    let world_from_object = found.world_from_object_at(pattern, hit.beam);
    (of_normals(&world_from_object) * oracle::normal(&found.job.target, hit.triangle))
        .normalize_or_zero()
}

/// What turns normals as `world_from_object` turns points, but for their length.
fn of_normals(world_from_object: &DAffine3) -> DMat3 {
    world_from_object.matrix3.inverse().transpose()
}
