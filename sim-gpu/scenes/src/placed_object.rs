use glam::{DAffine3, DQuat, DVec3};

/// An object of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedObject {
    /// The index of its entry in [`Recipe::object`](crate::Recipe::object).
    pub entry: usize,
    /// The number of the object among those of its entry.
    pub variant: u32,
    /// Scale factors along the object's axes.
    pub scale: DVec3,
    /// Rotation about the vertical, radians, counter-clockwise from x.
    pub yaw_rad: f64,
    /// The middle of its footprint on the ground, metres.
    pub position: DVec3,
}

impl PlacedObject {
    /// The transform from the object's frame to the scene's.
    #[must_use]
    pub fn world_from_object(&self) -> DAffine3 {
        let rotation = DQuat::from_rotation_z(self.yaw_rad);
        DAffine3::from_scale_rotation_translation(self.scale, rotation, self.position)
    }
}
