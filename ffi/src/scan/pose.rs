use std::fmt::Display;

use sim_gpu::Pose;

use crate::status::{EdgepuckStatus, Failure};

/// A position and an orientation in the world.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EdgepuckPose {
    /// The origin of the frame in the world, metres.
    pub position_m: [f64; 3],
    /// The rotation from the frame to the world, a quaternion x, y, z, w. The square of its length
    /// is 1 to within 0.001, as of quaternions in float; it is then scaled to length 1.
    pub quaternion_xyzw: [f64; 4],
}

impl EdgepuckPose {
    /// The pose for the Rust library. Errors call it `name`.
    pub(crate) fn read(&self, name: impl Display) -> Result<Pose, Failure> {
        let pose = Pose::rigid(self.position_m, self.quaternion_xyzw);
        pose.map_err(|cause| Failure::new(EdgepuckStatus::BadPose, format!("{name}.{cause}")))
    }

    /// The poses of an array, which errors call `name`.
    pub(crate) fn read_all(poses: &[Self], name: &str) -> Result<Vec<Pose>, Failure> {
        let read = |(i, pose): (usize, &Self)| pose.read(format_args!("{name}[{i}]"));
        poses.iter().enumerate().map(read).collect()
    }
}
