//! The normals of surfaces that were hit, in world axes.

use super::object_hits::{HitId, ObjectHits};
use crate::cpu::oracle;
use crate::resolve::Hit;
use crate::sensor::BeamPattern;
use glam::{DAffine3, DMat3, DVec3};

/// Computes normals, and keeps the last: neighbouring rays often hit the same triangle.
pub(super) struct Normals {
    /// Maps normals from each object to the world, `[n_objects]`.
    world_from_object: Vec<DMat3>,
    /// The object, the triangle and the normal of the last call.
    last: Option<(u32, u32, DVec3)>,
}

impl Normals {
    pub fn new(objects: &[ObjectHits]) -> Self {
        let maps = objects.iter().map(|object| normal_map(&object.world_from_object));
        Self { world_from_object: maps.collect(), last: None }
    }

    /// The unit normal where `object` was hit, in world axes; zero for a triangle without area.
    pub fn at(&mut self, id: HitId, object: &ObjectHits, pattern: &BeamPattern) -> DVec3 {
        let hit = &object.hits.hits[id.hit as usize];
        if object.moves() {
            return unit_normal(object, pattern, hit);
        }
        match self.last {
            Some((of, triangle, normal)) if (of, triangle) == (id.object, hit.triangle) => normal,
            _ => {
                let in_object = oracle::normal(&object.job.target, hit.triangle);
                let map = self.world_from_object[id.object as usize];
                let normal = (map * in_object).normalize_or_zero();
                self.last = Some((id.object, hit.triangle, normal));
                normal
            }
        }
    }
}

pub(super) fn unit_normal(object: &ObjectHits, pattern: &BeamPattern, hit: &Hit) -> DVec3 {
    let world_from_object = object.world_from_object_at(pattern, hit.beam);
    (normal_map(&world_from_object) * oracle::normal(&object.job.target, hit.triangle))
        .normalize_or_zero()
}

/// Maps directions of normals as `world_from_object` maps points: its inverse transposed.
fn normal_map(world_from_object: &DAffine3) -> DMat3 {
    world_from_object.matrix3.inverse().transpose()
}
