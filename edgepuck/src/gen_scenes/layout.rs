//! Data sets of sweeps as trainers of detectors and of segmentation networks read them.
//!
//! Points and boxes are in the level frame of the sensor: the origin is the sensor, x is ahead and z
//! is up. KITTI's calibrations are those of a camera in the sensor, which looks along x.

use std::path::PathBuf;

use edgepuck_scenes::{LabelledScene, ObjectBox, SceneError, Stage, is_test, place_in_set};
use formats::geometry::OrientedBox;
use formats::hash::Hashing;
use formats::trajectory::KITTI_PERIOD_S;
use formats::{FormatError, atomic, rows};
use glam::DVec3;
use sim_gpu::{Pose, glam};

use super::labels::semantic_labels;
use super::sequence::{Sequence, point_columns};
use crate::kitti::{CALIBRATION, Camera, line};

formats::named! {
    /// A layout of data sets of sweeps.
    pub enum Layout: "layout" {
        /// That of SemanticKITTI, with the class and the object of each point.
        SemanticKitti = "semantickitti",
        /// That of KITTI's object benchmark, with the boxes before its camera.
        Kitti = "kitti",
        /// That of OpenPCDet's custom data sets, with the boxes all around.
        OpenPcdet = "openpcdet",
    }
}

/// The size of KITTI's pictures, pixels.
const PICTURE: [f64; 2] = [1242.0, 375.0];

/// A data set that is being written.
pub struct Writer {
    layout: Layout,
    folder: PathBuf,
    /// The number of all sweeps, of which a part may be written here.
    n_sweeps: u32,
    camera: Camera,
}

impl Writer {
    pub fn new(layout: Layout, folder: PathBuf, n_sweeps: u32) -> Self {
        let camera = Camera::parse(CALIBRATION).expect("invariant: the calibration is valid");
        Self { layout, folder, n_sweeps, camera }
    }

    /// Writes a sweep.
    pub fn add(&self, stage: &Stage, done: &LabelledScene) -> anyhow::Result<()> {
        let number = done.scene.number;
        let name = name(number);
        let level = done.scene.level_from_sensor();
        let to_level =
            |at: &[f32; 3]| (level * DVec3::from(at.map(f64::from))).as_vec3().to_array();
        let positions: Vec<[f32; 3]> = done.sweep.points().iter().map(to_level).collect();
        let intensity = done.sweep.scan.intensity.as_deref();
        let intensity = intensity.expect("invariant: sweeps have intensities");
        let write = |file: &str, header: &[u8]| {
            let columns = point_columns(&positions, intensity);
            rows::write(&self.folder.join(file), Hashing::None, header, &columns)
        };
        match self.layout {
            Layout::SemanticKitti => {
                // Sequences have sweeps without gaps in their numbers.
                let place = place_in_set(number) as usize;
                let labels = semantic_labels(stage, done)?;
                self.sequence(is_test(number)).add(place, &positions, intensity, &labels)?;
            }
            Layout::Kitti => {
                write(&format!("training/velodyne/{name}.bin"), b"")?;
                let lines = lines(stage, done, |class, of| self.kitti_line(class, of))?;
                self.text(&format!("training/label_2/{name}.txt"), &lines)?;
                self.text(&format!("training/calib/{name}.txt"), CALIBRATION)?;
            }
            Layout::OpenPcdet => {
                let header = rows::npy_header(positions.len(), 4);
                write(&format!("points/{name}.npy"), &header)?;
                let lines = lines(stage, done, |class, of| Some(openpcdet_line(class, of)))?;
                self.text(&format!("labels/{name}.txt"), &lines)?;
            }
        }
        Ok(())
    }

    /// Writes what is about all sweeps, those of other parts included.
    pub fn finish(&self) -> Result<(), FormatError> {
        for of_test in [false, true] {
            let numbers = (0..self.n_sweeps).filter(|number| is_test(*number) == of_test);
            if self.layout == Layout::SemanticKitti {
                // Each sweep is a scene of its own: their poses are equal.
                self.sequence(of_test).finish(numbers.map(|_| Pose::IDENTITY), KITTI_PERIOD_S)?;
                continue;
            }
            let set = if of_test { "val" } else { "train" };
            let list: String = numbers.map(|number| name(number) + "\n").collect();
            self.text(&format!("ImageSets/{set}.txt"), &list)?;
        }
        Ok(())
    }

    /// SemanticKITTI validates on sequence 08.
    fn sequence(&self, is_test: bool) -> Sequence {
        Sequence(self.folder.join(if is_test { "sequences/08" } else { "sequences/00" }))
    }

    fn text(&self, file: &str, text: &str) -> Result<(), FormatError> {
        atomic::write_bytes(&self.folder.join(file), text)
    }

    /// The line of a box, if it is before the camera and partly in its picture.
    fn kitti_line(&self, class: &str, of: &ObjectBox) -> Option<String> {
        let place = of.place.narrowed();
        let [left, top, right, bottom] = self.camera.bounds(place.widened().corners())?;
        let [width, height] = PICTURE;
        let clipped = [left.max(0.0), top.max(0.0), right.min(width), bottom.min(height)];
        let area = |[left, top, right, bottom]: [f64; 4]| (right - left) * (bottom - top);
        if clipped[0] >= clipped[2] || clipped[1] >= clipped[3] {
            return None;
        }
        let truncated = 1.0 - area(clipped) / area([left, top, right, bottom]);
        let truncated = (100.0 * truncated).round() / 100.0;
        let occluded = occlusion(of.visible);
        Some(line(class, [truncated, occluded], Some(clipped), place, Some(&self.camera)) + "\n")
    }
}

/// The name of the files of a sweep.
fn name(number: u32) -> String {
    format!("{number:06}")
}

/// The lines that `line` makes of the classes and the boxes of a sweep's objects.
fn lines(
    stage: &Stage,
    done: &LabelledScene,
    line: impl Fn(&str, &ObjectBox) -> Option<String>,
) -> Result<String, SceneError> {
    let class = |of: &ObjectBox| &*stage.recipe().object[done.scene.objects[of.object].entry].class;
    let boxes = stage.boxes(&done.scene, &done.sweep)?;
    Ok(boxes.iter().filter_map(|of| line(class(of), of)).collect())
}

/// KITTI's state of occlusion: 0 is all visible, 1 partly hidden, 2 largely hidden. KITTI's people
/// judged pictures; here less than a tenth, and less than half of the points are hidden.
fn occlusion(visible: f64) -> f64 {
    [0.5, 0.9].into_iter().filter(|least| visible < *least).count() as f64
}

#[cfg(test)]
#[test]
fn less_than_a_tenth_and_less_than_half_are_hidden() {
    let expected = [(1.0, 0.0), (0.91, 0.0), (0.89, 1.0), (0.51, 1.0), (0.49, 2.0), (0.01, 2.0)];
    assert!(expected.into_iter().all(|(visible, state)| occlusion(visible) == state));
}

/// The middle, the size, the heading and the class of a box.
fn openpcdet_line(class: &str, of: &ObjectBox) -> String {
    let OrientedBox { centre_m: [x, y, z], size_m: [length, width, height], yaw_rad } = of.place;
    let class = class.replace(char::is_whitespace, "_");
    format!("{x:.3} {y:.3} {z:.3} {length:.3} {width:.3} {height:.3} {yaw_rad:.4} {class}\n")
}
