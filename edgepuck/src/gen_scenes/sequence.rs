//! Sequences of sweeps as SemanticKITTI and KITTI's odometry benchmark have them.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use formats::hash::Hashing;
use formats::scan::Column;
use formats::{FormatError, atomic, rows};
use glam::{DMat3, DVec3};
use sim_gpu::{Pose, glam};

use crate::kitti::CALIBRATION;

/// The rotation from the sensor's frame to that of the camera, as `Tr` has it: x to the right, y down.
const CAMERA_FROM_SENSOR: DMat3 = DMat3::from_cols(DVec3::Z, DVec3::NEG_X, DVec3::NEG_Y);

/// A folder such as `sequences/00`.
pub struct Sequence(pub PathBuf);

impl Sequence {
    /// Writes sweep `number`, with SemanticKITTI's label of each point.
    pub fn add(
        &self,
        number: usize,
        positions: &[[f32; 3]],
        intensity: &[f32],
        labels: &[u32],
    ) -> Result<(), FormatError> {
        let points = point_columns(positions, intensity);
        let labels = [(vec!["label"], Column::U32(labels))];
        let write = |file: String, columns: &rows::Columns<'_>| {
            rows::write(&self.0.join(file), Hashing::None, "", columns).map(drop)
        };
        write(format!("velodyne/{number:06}.bin"), &points)?;
        write(format!("labels/{number:06}.label"), &labels)
    }

    /// Whether `file` is one that an earlier run wrote: by its place, in a folder with this calibration,
    /// which no recorded sequence has.
    pub fn has_written(&self, file: &Path) -> bool {
        let is_ours =
            fs::read_to_string(self.0.join("calib.txt")).is_ok_and(|found| found == calibration());
        let place = file.strip_prefix(&self.0).unwrap_or(file);
        let is_sweep = |folder: &str, extension: &str| {
            let stem = place.file_stem().unwrap_or_default().to_string_lossy();
            place.parent() == Some(Path::new(folder))
                && place.extension().is_some_and(|found| found == extension)
                && stem.parse::<u32>().is_ok()
        };
        let texts = ["calib.txt", "poses.txt", "times.txt"];
        is_ours
            && (texts.iter().any(|text| place == Path::new(text))
                || is_sweep("velodyne", "bin")
                || is_sweep("labels", "label"))
    }

    /// Writes the calibration, and the poses of the sensor, `period_s` apart.
    pub fn finish(
        &self,
        poses: impl Iterator<Item = Pose>,
        period_s: f64,
    ) -> Result<(), FormatError> {
        let (mut lines, mut times, mut first) = (String::new(), String::new(), None);
        for (i, pose) in poses.enumerate() {
            let words = camera_pose(first.get_or_insert(pose), &pose).map(|x| x.to_string());
            writeln!(lines, "{}", words.join(" ")).expect("invariant: a string takes all");
            let time_s = i as f64 * period_s;
            writeln!(times, "{time_s:.6e}").expect("invariant: a string takes all");
        }
        [("calib.txt", calibration()), ("poses.txt", lines), ("times.txt", times)]
            .into_iter()
            .try_for_each(|(file, text)| atomic::write_bytes(&self.0.join(file), text))
    }
}

/// The columns of the points of a sweep.
pub fn point_columns<'a>(
    positions: &'a [[f32; 3]],
    intensity: &'a [f32],
) -> [(Vec<&'static str>, Column<'a>); 2] {
    [(rows::AXES.to_vec(), Column::Vector(positions)), (vec!["intensity"], Column::F32(intensity))]
}

fn calibration() -> String {
    let cameras: String = CALIBRATION.lines().take(4).map(|line| format!("{line}\n")).collect();
    let transform = CALIBRATION.lines().find_map(|line| line.strip_prefix("Tr_velo_to_cam"));
    let transform = transform.expect("invariant: the calibration has it");
    format!("{cameras}Tr{transform}\n")
}

/// The rows of the camera's pose in the camera's frame at the `first` pose of the sensor, to a
/// nanometre.
fn camera_pose(first: &Pose, pose: &Pose) -> [f64; 12] {
    let back = first.rotation.inverse();
    let moved_m = CAMERA_FROM_SENSOR * (back * (pose.position_m - first.position_m));
    let turned = DMat3::from_quat(back * pose.rotation);
    let turned = CAMERA_FROM_SENSOR * turned * CAMERA_FROM_SENSOR.transpose();
    let rows = [0, 1, 2].map(|row| turned.row(row).extend(moved_m[row]).to_array());
    // A sum with 0 is never -0.
    std::array::from_fn(|i| (rows[i / 4][i % 4] * 1e9).round() / 1e9 + 0.0)
}
