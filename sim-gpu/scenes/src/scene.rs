use std::f64::consts::TAU;

use edgepuck_shapes::Sampler;
use formats::streams::Stream;
use glam::{DQuat, DVec2, DVec3};
use sim_gpu::{Pose, Trajectory};

use crate::footprint::Footprint;
use crate::ground::{Ground, OWN_RADIUS_M};
use crate::place::Placer;
use crate::placed_object::PlacedObject;
use crate::stage::Stage;

/// A scene, drawn from a recipe.
#[derive(Clone, Debug)]
pub struct DrawnScene {
    /// The number of the scene under the stage's seed.
    pub number: u32,
    /// The objects.
    pub objects: Vec<PlacedObject>,
    /// The index of the scene's sensor in [`Recipe::sensor`](crate::Recipe::sensor).
    pub sensor: usize,
    /// The pose of the sensor. The origin is on the ground below it; the road runs along x.
    pub pose: Pose,
    /// The velocity of the sensor during the scan, metres a second; 0 if it stands still.
    pub velocity_m_s: DVec3,
    /// The fraction of the beams that return from glass.
    pub glass_returned: f64,
    /// The height below which the robot's segmentation takes points for ground, metres; `None`
    /// keeps the value of its settings.
    pub ground_clearance_m: Option<f64>,
    pub(crate) ground: Ground,
}

impl DrawnScene {
    /// Draws scene number `number` of `stage`.
    #[must_use]
    pub fn draw(stage: &Stage, number: u32) -> Self {
        let recipe = stage.recipe();
        let seed = stage.seed();
        let s = &mut Sampler::new(Stream::ScenePlaces { scene: number }.key(seed));
        let off_road_m = recipe.mount.off_road_m.at(s.uniform(0.0, 1.0));
        let road_y_m = if s.chance(0.5) { off_road_m } else { -off_road_m };
        let ground = Ground::draw(
            &recipe.ground,
            road_y_m,
            s,
            Stream::SceneGround { scene: number }.key(seed),
        );
        let sensor = s.count(0, recipe.sensor.len() - 1);
        let mut pose = draw_mount(stage, s);
        pose.rotation *= DQuat::from_rotation_z(s.uniform(0.0, TAU));
        let glass_returned = recipe.glass_returned.at(s.uniform(0.0, 1.0));
        let share = s.uniform(0.0, 1.0);
        let ground_clearance_m = recipe.ground_clearance_m.map(|span| span.at(share));
        // A key of its own, so that a moving sensor sees the same scene as one at rest.
        let speed_m_s =
            recipe.mount.speed_m_s.at(Stream::SceneSpeed { scene: number }.key(seed).unit(0));
        let velocity_m_s = ground.along(speed_m_s);
        let own = Footprint::level(DVec2::ZERO, DVec2::splat(OWN_RADIUS_M));
        let mut placer = Placer::new(stage, &ground, s, f64::INFINITY, vec![own]);
        (0..recipe.object.len()).for_each(|entry| placer.place(entry));
        let objects = placer.objects;
        Self {
            number,
            objects,
            sensor,
            pose,
            velocity_m_s,
            glass_returned,
            ground_clearance_m,
            ground,
        }
    }

    /// The sensor's poses from the start of the scan to `until_s`; `None` if it stands still.
    pub(crate) fn motion(&self, until_s: f64) -> Option<Trajectory> {
        if self.velocity_m_s == DVec3::ZERO {
            return None;
        }
        let after_s = |time_s| {
            let position_m = self.pose.position_m + self.velocity_m_s * time_s;
            (time_s, Pose { position_m, ..self.pose })
        };
        let poses = vec![after_s(0.0), after_s(until_s.max(1.0))];
        Some(Trajectory::new(poses).expect("invariant: a recipe's speeds are finite"))
    }
}

/// Draws the pose of the sensor: above the origin, a little tilted.
pub(crate) fn draw_mount(stage: &Stage, s: &mut Sampler) -> Pose {
    let mount = &stage.recipe().mount;
    let height_m = mount.height_m.at(s.uniform(0.0, 1.0));
    let tilt_rad = mount.tilt_deg.at(s.uniform(0.0, 1.0)).to_radians();
    let towards_rad = s.uniform(0.0, TAU);
    let tilt_axis = DVec3::new(libm::cos(towards_rad), libm::sin(towards_rad), 0.0);
    let tilt = DQuat::from_axis_angle(tilt_axis, tilt_rad);
    Pose { position_m: DVec3::new(0.0, 0.0, height_m), rotation: tilt }
}
