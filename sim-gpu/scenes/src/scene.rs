//! One scene: its ground, its objects, and the sensor in it.

use std::f64::consts::TAU;

use edgepuck_shapes::Sampler;
use formats::rng::StreamKey;
use glam::{DAffine3, DQuat, DVec3};
use sim_gpu::pose::{Pose, Trajectory};

use crate::ground::Ground;
use crate::place::Placing;
use crate::stage::Stage;

/// A scene, drawn from a recipe.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its number under the stage's seed.
    pub number: u32,
    /// The objects.
    pub objects: Vec<PlacedObject>,
    /// Which of the recipe's sensors is there.
    pub sensor: usize,
    /// Where the sensor is; the origin is on the ground below it, and the road
    /// runs along x.
    pub pose: Pose,
    /// How it goes while it scans, metres a second; 0 if it stands still.
    pub velocity_m_s: DVec3,
    /// The part of the beams that return from glass.
    pub glass_returned: f64,
    /// How low the robot's segmentation takes points for ground, metres; `None`
    /// leaves that to its settings.
    pub ground_clearance_m: Option<f64>,
    pub(crate) ground: Ground,
}

/// An object of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedObject {
    /// Which of the recipe's `[[object]]` it is of.
    pub entry: usize,
    /// Which object of that kind it is.
    pub variant: u32,
    /// Factors along its own axes.
    pub scale: DVec3,
    /// How it is turned about the vertical, radians, counterclockwise from x.
    pub yaw_rad: f64,
    /// Where the middle of its footprint stands, metres.
    pub position: DVec3,
}

impl PlacedObject {
    /// From the object's frame to the scene's.
    #[must_use]
    pub fn world_from_object(&self) -> DAffine3 {
        let rotation = DQuat::from_rotation_z(self.yaw_rad);
        DAffine3::from_scale_rotation_translation(self.scale, rotation, self.position)
    }
}

impl Scene {
    /// Scene number `number` of `stage`.
    #[must_use]
    pub fn draw(stage: &Stage, number: u32) -> Self {
        let recipe = stage.recipe();
        let stream = |part: &str| StreamKey::new(stage.seed(), &format!("scene/{part}"), number);
        let s = &mut Sampler::new(stream("place"));
        let off_road_m = recipe.mount.off_road_m.at(s.uniform(0.0, 1.0));
        let road_y_m = if s.chance(0.5) { off_road_m } else { -off_road_m };
        let ground = Ground::draw(&recipe.ground, road_y_m, s, stream("ground"));
        let sensor = s.count(0, recipe.sensor.len() - 1);
        let mut pose = mount(stage, s);
        pose.world_from_sensor *= DQuat::from_rotation_z(s.uniform(0.0, TAU));
        let glass_returned = recipe.glass_returned.at(s.uniform(0.0, 1.0));
        let share = s.uniform(0.0, 1.0);
        let ground_clearance_m = recipe.ground_clearance_m.map(|span| span.at(share));
        // By a key of its own, so that the scene is the one that a sensor at rest sees.
        let speed_m_s = recipe.mount.speed_m_s.at(stream("speed").unit(0));
        let velocity_m_s = ground.along(speed_m_s);
        let mut placing = Placing::new(&ground, s);
        for (entry, objects) in recipe.object.iter().enumerate() {
            let size = |variant| stage.prop(entry, variant).size_m;
            placing.place(entry, objects, stage.variants(entry), size);
        }
        let objects = placing.objects;
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

    /// The sensor's poses from when it begins to scan to `until_s`; `None` if it stands still.
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

/// Where the sensor is: above the origin, a little tilted.
pub(crate) fn mount(stage: &Stage, s: &mut Sampler) -> Pose {
    let mount = &stage.recipe().mount;
    let height_m = mount.height_m.at(s.uniform(0.0, 1.0));
    let tilt_rad = mount.tilt_deg.at(s.uniform(0.0, 1.0)).to_radians();
    let towards_rad = s.uniform(0.0, TAU);
    let tilt_axis = DVec3::new(towards_rad.cos(), towards_rad.sin(), 0.0);
    let tilt = DQuat::from_axis_angle(tilt_axis, tilt_rad);
    Pose { position_m: DVec3::new(0.0, 0.0, height_m), world_from_sensor: tilt }
}
