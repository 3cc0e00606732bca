//! The boxes of a scene's objects, as detectors learn them.

use formats::geometry::OrientedBox;
use glam::{DQuat, DVec3};
use sim_gpu::Scene;

use crate::error::SceneError;
use crate::scene::DrawnScene;
use crate::stage::Stage;
use crate::sweep::Sweep;

/// The box of an object, in the level frame of the sensor: the origin is the sensor, z is up, and x is
/// where the sensor's x points on the map.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjectBox {
    /// The index of the object in [`DrawnScene::objects`].
    pub object: usize,
    /// The box, whose direction is the heading, in -pi..pi.
    pub place: OrientedBox,
    /// The number of points on the object.
    pub n_points: u32,
    /// The share of the points that the sensor would have of the object alone, 0 to 1: the rest is
    /// hidden behind others.
    pub visible: f64,
}

impl DrawnScene {
    /// The rotation from the sensor's frame to its level frame.
    #[must_use]
    pub fn level_from_sensor(&self) -> DQuat {
        self.level_from_world() * self.pose.rotation
    }

    fn level_from_world(&self) -> DQuat {
        let ahead = self.pose.rotation * DVec3::X;
        DQuat::from_rotation_z(-libm::atan2(ahead.y, ahead.x))
    }
}

impl Stage {
    /// The boxes of the objects of `scene` that have points in `sweep`, its sweep. Each of these objects
    /// is scanned once more, alone.
    ///
    /// # Errors
    /// The caster fails.
    pub fn boxes(&self, scene: &DrawnScene, sweep: &Sweep) -> Result<Vec<ObjectBox>, SceneError> {
        let level_from_world = scene.level_from_world();
        let counts = sweep.points_by_surface(scene);
        let seen = (0..scene.objects.len()).filter(|&object| counts[object + 1] > 0);
        let of_object = |object: usize| {
            let placed = &scene.objects[object];
            let size_m = self.size_m(scene, object);
            let moved_m = scene.velocity_m_s * sweep.mean_time_s(object as u32 + 1);
            let base_m = placed.position - scene.pose.position_m - moved_m;
            let heading = level_from_world * DQuat::from_rotation_z(placed.yaw_rad) * DVec3::X;
            let n_points = counts[object + 1];
            let alone = self.points_alone(scene, object)?;
            let centre_m = level_from_world * (base_m + 0.5 * size_m.z * DVec3::Z);
            let place = OrientedBox {
                centre_m: centre_m.to_array(),
                size_m: size_m.to_array(),
                yaw_rad: libm::atan2(heading.y, heading.x),
            };
            Ok(ObjectBox {
                object,
                place,
                n_points,
                visible: f64::from(n_points) / f64::from(alone.max(n_points)),
            })
        };
        seen.map(of_object).collect()
    }

    /// The number of points on `object` if nothing else is in `scene`.
    fn points_alone(&self, scene: &DrawnScene, object: usize) -> Result<u32, SceneError> {
        let mut world = Scene::new();
        (world.seed, world.effects) = (self.seed(), self.effects(scene).clone());
        self.add_object(&mut world, &scene.objects[object], scene.glass_returned);
        let stream = self.stream(scene, object as u32 + 1);
        let placed = world.placed(|_, _| Some(stream));
        let alone = self.scan_placed(&world, &placed, scene)?;
        // Others are in the air.
        Ok(alone.surfaces().iter().filter(|&&surface| surface == 0).count() as u32)
    }
}
