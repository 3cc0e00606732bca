//! Real sweeps with labelled boxes.

use std::path::{Path, PathBuf};

use edgepuck_segment::{Label, Segmentation};
use formats::labelled_sweep::{LabelledBox, read_labelled_sweep};

pub fn paths(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<_> = folder.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

/// Points lower above a box's bottom than this may be ground.
const FEET_M: f64 = 0.25;
/// Points this far outside of a box may be the object's: boxes are drawn tightly and at one time,
/// and a car that drives 6 m/s moves by this in the half of a revolution.
const MARGIN_M: f64 = 0.3;
const FARTHEST_M: f64 = 40.0;
const FEWEST_POINTS: usize = 30;

/// A labelled sweep, in the sensor's frame.
pub struct Frame {
    pub name: String,
    pub points: Vec<[f32; 3]>,
    pub lasers: Option<Vec<u16>>,
    boxes: Vec<LabelledBox>,
}

impl Frame {
    pub fn read(path: &Path) -> Self {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        // The mean of the two sensors over the rear axle (the data set's calibration).
        let sensor = if name.starts_with("argoverse") { [1.35, 0.0, 1.6] } else { [0.0; 3] };
        let from_sensor = |at: [f64; 3]| [0, 1, 2].map(|axis| at[axis] - sensor[axis]);
        let mut sweep = read_labelled_sweep(path).unwrap();
        sweep
            .boxes
            .iter_mut()
            .for_each(|object| object.place.centre_m = from_sensor(object.place.centre_m));
        let points = sweep.points.iter().map(|&at| from_sensor(at).map(|x| x as f32)).collect();
        Self { name, points, lasers: sweep.lasers, boxes: sweep.boxes }
    }

    /// The cars and persons that count, each with the indices of its points.
    pub fn objects(&self) -> impl Iterator<Item = (&LabelledBox, Vec<usize>)> {
        const CLASSES: [&str; 4] = ["Car", "Pedestrian", "REGULAR_VEHICLE", "PEDESTRIAN"];
        let wanted = self.boxes.iter().filter(|object| CLASSES.contains(&&*object.class));
        let near = wanted.filter(|object| range_m(object) <= FARTHEST_M);
        let with_points = near.map(|object| (object, self.inside(object)));
        with_points.filter(|(_, inside)| inside.len() >= FEWEST_POINTS)
    }

    fn inside(&self, object: &LabelledBox) -> Vec<usize> {
        let feet_m = object.place.centre_m[2] - object.place.size_m[2] / 2.0 + FEET_M;
        let is_inside = |i: &usize| {
            let point = self.points[*i].map(f64::from);
            object.place.contains(point, 0.0) && point[2] >= feet_m
        };
        (0..self.points.len()).filter(is_inside).collect()
    }

    /// Of an object's points, the largest share that one cluster holds, and of that cluster, the
    /// share of points that are not the object's.
    pub fn shares(
        &self,
        object: &LabelledBox,
        inside: &[usize],
        found: &Segmentation,
    ) -> (f64, f64) {
        let mut counts = vec![0; found.clusters().len()];
        for &point in inside {
            if let Label::Cluster(number) = found.labels()[point] {
                counts[number as usize] += 1;
            }
        }
        let largest = counts.iter().enumerate().max_by_key(|(_, count)| **count);
        let Some((number, &count)) = largest.filter(|(_, count)| **count > 0) else {
            return (0.0, 0.0);
        };
        let cluster = found.clusters().nth(number).unwrap().points;
        let is_other = |&&point: &&u32| {
            !object.place.contains(self.points[point as usize].map(f64::from), MARGIN_M)
        };
        let others = cluster.iter().filter(is_other).count();
        (count as f64 / inside.len() as f64, others as f64 / cluster.len() as f64)
    }
}

pub fn range_m(object: &LabelledBox) -> f64 {
    object.place.centre_m[0].hypot(object.place.centre_m[1])
}
