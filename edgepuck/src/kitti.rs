//! Labels of KITTI's object benchmark, as the readme of its development kit defines them.

use anyhow::Context;
use formats::FormatError;
use formats::geometry::OrientedBox;
use formats::periodic::shorter_way;
use formats::plausible::read_text;
use glam::{DMat3, DMat4, DVec3};
use sim_gpu::glam;
use std::f64::consts::TAU;
use std::path::Path;

use crate::street::StreetClass;

/// The most that products of a rotation's rows may be off: KITTI rounds to 7 digits, others to 3.
const NOT_A_ROTATION: f64 = 0.01;
/// The farthest that a camera may be from the LiDAR on one vehicle, metres.
const FARTHEST_CAMERA_M: f64 = 20.0;
/// The largest sine of a camera's elevation, 64 degrees.
const STEEPEST: f64 = 0.9;

/// The calibration of a camera in the sensor: a focal length and a middle of KITTI's order.
pub const CALIBRATION: &str = include_str!("calibration.txt");

/// The left colour camera of a frame.
pub struct Camera {
    /// From the LiDAR's frame to the rectified camera's.
    rect_from_lidar: DMat4,
    /// From the rectified camera's frame to pixels times depth.
    image_from_rect: DMat4,
}

impl Camera {
    /// Reads a calibration file of the benchmark.
    pub fn read(file: &Path) -> anyhow::Result<Self> {
        let text = read_text(file, u64::MAX).with_context(|| file.display().to_string())?;
        let flaw = |(key, cause): (&str, String)| FormatError::malformed(file, key, cause);
        Ok(Self::parse(&text).map_err(flaw)?)
    }

    /// Reads the text of a calibration file.
    pub fn parse(text: &str) -> Result<Self, Flaw> {
        let rect_from_lidar = rotation(text, "R0_rect", 3)? * rotation(text, "Tr_velo_to_cam", 4)?;
        let camera = Self { rect_from_lidar, image_from_rect: matrix(text, "P2", 4)? };
        camera.check()?;
        Ok(camera)
    }

    /// Whether the camera looks ahead, along its z axis, and projects.
    fn check(&self) -> Result<(), Flaw> {
        if self.rect_from_lidar.z_axis.z.abs() > STEEPEST {
            let cause = "expected a camera that looks ahead, found one that looks along the LiDAR's \
                         z: x of the camera points to the right, y down, z ahead";
            return Err(("Tr_velo_to_cam", cause.to_owned()));
        }
        let apart_m = self.rect_from_lidar.w_axis.truncate().length();
        if apart_m > FARTHEST_CAMERA_M {
            let cause = format!(
                "expected a camera within {FARTHEST_CAMERA_M} m of the LiDAR, found {apart_m:.1} m: is the \
                 fourth column in metres?"
            );
            return Err(("Tr_velo_to_cam", cause));
        }
        let [x, y, z] = [0, 1, 2].map(|row| self.image_from_rect.row(row).truncate());
        if x.x <= 0.0 || y.y <= 0.0 || z != DVec3::Z {
            let cause =
                "expected a projection: focal lengths above 0, a last row of 0 0 1 and an offset";
            return Err(("P2", cause.to_owned()));
        }
        Ok(())
    }

    /// The left, top, right and bottom of the box with these corners in the picture, pixels; `None`
    /// if a corner is not before the camera.
    pub fn bounds(&self, corners: [DVec3; 8]) -> Option<[f64; 4]> {
        let (mut low, mut high) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for corner in corners {
            let at = self.rect_from_lidar.transform_point3(corner);
            let at = self.image_from_rect.transform_point3(at);
            (low, high) = (low.min(at / at.z), high.max(at / at.z));
            (at.z > 0.0).then_some(())?;
        }
        Some([low.x, low.y, high.x, high.y])
    }
}

/// The key of a line of a calibration, and what is wrong with it.
type Flaw = (&'static str, String);

/// The matrix of three rows in the line `key`.
fn matrix(text: &str, key: &'static str, columns: usize) -> Result<DMat4, Flaw> {
    let line = text.lines().find_map(|line| line.trim_start().strip_prefix(key)?.strip_prefix(':'));
    let Some(line) = line else {
        let cause = "expected this line of the calibration of KITTI's object benchmark \
                     (training/calib), found none; odometry and raw data have other files";
        return Err((key, cause.to_owned()));
    };
    let words = line.split_whitespace();
    let is_finite = |x: &f64| x.is_finite();
    let numbers: Vec<f64> = words.map_while(|word| word.parse().ok().filter(is_finite)).collect();
    if numbers.len() != 3 * columns {
        let (expected, found) = (3 * columns, numbers.len());
        return Err((key, format!("expected a line of {expected} finite numbers, found {found}")));
    }
    let rows = [0, 1, 2].map(|row| &numbers[row * columns..][..columns]);
    let column = |i: usize| DVec3::from(rows.map(|row| row[i]));
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    let shift = if columns == 4 { column(3) } else { DVec3::ZERO };
    Ok(DMat4::from_translation(shift) * DMat4::from_mat3(rotation))
}

/// The matrix in the line `key`, which must be that of a rotation, but for a fourth column.
fn rotation(text: &str, key: &'static str, columns: usize) -> Result<DMat4, Flaw> {
    let found = matrix(text, key, columns)?;
    let axes = DMat3::from_mat4(found);
    let off = (axes * axes.transpose() - DMat3::IDENTITY).to_cols_array();
    let off = off.into_iter().fold(0.0, |most: f64, x| most.max(x.abs()));
    if off > NOT_A_ROTATION || axes.determinant() < 0.0 {
        let cause = "expected a rotation: rows of length 1 at right angles, right-handed";
        return Err((key, cause.to_owned()));
    }
    Ok(found)
}

/// The line of an object but for its score: type, truncation, occlusion, alpha, left, top, right, bottom,
/// height, width, length, x, y, z and rotation, in the frame of `camera` or else the sensor's.
/// `truncated` is 0 to 1, `occluded` 0 to 3, and `bounds` are in the picture, pixels.
pub fn line(
    class: &str,
    [truncated, occluded]: [f64; 2],
    bounds: Option<[f64; 4]>,
    place: OrientedBox<f32>,
    camera: Option<&Camera>,
) -> String {
    let kind = StreetClass::named(class).map_or(class, |known| known.kitti);
    let kind = kind.replace(char::is_whitespace, "_");
    let OrientedBox { centre_m, size_m: [length, width, height], yaw_rad } = place.widened();
    let base = DVec3::from(centre_m) - 0.5 * height * DVec3::Z;
    let (mut alpha, mut at, mut rotation) = (-10.0, base, yaw_rad);
    if let Some(camera) = camera {
        let along = DVec3::new(libm::cos(yaw_rad), libm::sin(yaw_rad), 0.0);
        let along = camera.rect_from_lidar.transform_vector3(along);
        at = camera.rect_from_lidar.transform_point3(base);
        // About the camera's y axis, which points downwards.
        rotation = libm::atan2(-along.z, along.x);
        alpha = shorter_way(rotation - libm::atan2(at.x, at.z), TAU);
    }
    let [left, top, right, bottom] = bounds.unwrap_or([-1.0; 4]);
    let [x, y, z] = at.to_array();
    format!(
        "{kind} {truncated} {occluded} {alpha:.2} {left:.2} {top:.2} {right:.2} {bottom:.2} \
         {height:.2} {width:.2} {length:.2} {x:.2} {y:.2} {z:.2} {rotation:.2}"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A camera at the LiDAR that looks along x, with a focal length of 700 pixels.
    const CALIBRATION: &str = "P2: 700 0 600 0 0 700 180 0 0 0 1 0\n\
        R0_rect: 1 0 0 0 1 0 0 0 1\nTr_velo_to_cam: 0 -1 0 0 0 0 -1 0 1 0 0 0\n";

    fn label(class: &str, centre_m: [f32; 3], camera: Option<&Camera>) -> String {
        let place = OrientedBox { centre_m, size_m: [4.0, 2.0, 1.0], yaw_rad: 0.0 };
        let bounds = camera.and_then(|camera| camera.bounds(place.widened().corners()));
        line(class, [-1.0, -1.0], bounds, place, camera)
    }

    #[test]
    fn boxes_are_projected_and_turned_as_the_readme_of_the_kit_defines() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("calib.txt");
        std::fs::write(&file, CALIBRATION).unwrap();
        let camera = Camera::read(&file).unwrap();
        let ahead = ("car", [10.0, 0.0, 0.0]);
        assert_eq!(
            label(ahead.0, ahead.1, None),
            "Car -1 -1 -10.00 -1.00 -1.00 -1.00 -1.00 1.00 2.00 4.00 10.00 0.00 -0.50 0.00"
        );
        // The near face is 8 m away: 700 / 8 pixels a metre. A car that drives away has a rotation
        // of -pi / 2.
        assert_eq!(
            label(ahead.0, ahead.1, Some(&camera)),
            "Car -1 -1 -1.57 512.50 136.25 687.50 223.75 1.00 2.00 4.00 0.00 0.50 10.00 -1.57"
        );
        // Behind the camera there is no picture, and -pi / 2 - pi is pi / 2.
        assert_eq!(
            label("garden chair", [-10.0, 0.0, 0.0], Some(&camera)),
            "garden_chair -1 -1 1.57 -1.00 -1.00 -1.00 -1.00 1.00 2.00 4.00 0.00 0.50 -10.00 -1.57"
        );
    }
}
