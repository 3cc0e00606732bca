//! Real sweeps with labelled boxes.

use std::path::{Path, PathBuf};

use edgepuck_segment::{Label, Segmentation};

use crate::npz::Array;

/// All archives in `folder`.
pub fn paths(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<_> = folder.read_dir().unwrap().map(|entry| entry.unwrap().path()).collect();
    paths.sort();
    paths
}

/// Points lower above a box's bottom than this may be ground.
const FEET_M: f32 = 0.25;
/// Points this far outside of a box may be the object's: boxes are drawn tightly and at one
/// time, and a car that drives 6 m/s moves by this in the half of a revolution.
const MARGIN_M: f32 = 0.3;
const FARTHEST_M: f32 = 40.0;
const FEWEST_POINTS: usize = 30;

/// A labelled sweep, in the sensor's frame.
pub struct Frame {
    pub name: String,
    pub points: Vec<[f32; 3]>,
    pub lasers: Option<Vec<u16>>,
    objects: Vec<Object>,
}

/// A labelled box.
pub struct Object {
    pub class: String,
    /// Centre, length, width, height, yaw.
    pub of: [f32; 7],
}

impl Object {
    /// Whether the box, `margin_m` wider on all sides and without its lowest
    /// `feet_m`, holds a point.
    fn holds(&self, point: [f32; 3], margin_m: f32, feet_m: f32) -> bool {
        let [x, y, z, length, width, height, yaw] = self.of;
        let (sin, cos) = yaw.sin_cos();
        let (dx, dy, dz) = (point[0] - x, point[1] - y, point[2] - z);
        let (along, across) = (cos * dx + sin * dy, cos * dy - sin * dx);
        along.abs() <= length / 2.0 + margin_m
            && across.abs() <= width / 2.0 + margin_m
            && (feet_m - height / 2.0..=height / 2.0 + margin_m).contains(&dz)
    }
}

impl Frame {
    /// Reads an archive of the developers' data.
    pub fn read(path: &Path) -> Self {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        // The mean of the two sensors over the rear axle (the data set's calibration).
        let sensor = if name.starts_with("argoverse") { [1.35, 0.0, 1.6] } else { [0.0; 3] };
        let from_sensor = |at: [f32; 3]| [0, 1, 2].map(|axis| at[axis] - sensor[axis]);
        let array = |key| Array::read(path, key);
        let metres = array("xyz_mm").unwrap().elements(|b| i32::from_le_bytes(b) as f32 / 1000.0);
        let boxes = array("boxes").unwrap().elements(f32::from_le_bytes);
        let classes = array("classes").unwrap().text();
        let boxes = boxes.as_chunks::<7>().0.iter().zip(classes);
        let objects = boxes.map(|(&[x, y, z, length, width, height, yaw], class)| {
            let [x, y, z] = from_sensor([x, y, z]);
            Object { class, of: [x, y, z, length, width, height, yaw] }
        });
        Self {
            name,
            points: metres.as_chunks::<3>().0.iter().map(|&at| from_sensor(at)).collect(),
            lasers: array("laser").map(|lasers| lasers.elements(|[laser]: [u8; 1]| laser.into())),
            objects: objects.collect(),
        }
    }

    /// The cars and persons that count.
    pub fn objects(&self) -> impl Iterator<Item = (&Object, Vec<usize>)> {
        const CLASSES: [&str; 4] = ["Car", "Pedestrian", "REGULAR_VEHICLE", "PEDESTRIAN"];
        let wanted = self.objects.iter().filter(|object| CLASSES.contains(&&*object.class));
        let near = wanted.filter(|object| object.of[0].hypot(object.of[1]) <= FARTHEST_M);
        let with_points = near.map(|object| (object, self.inside(object)));
        with_points.filter(|(_, inside)| inside.len() >= FEWEST_POINTS)
    }

    fn inside(&self, object: &Object) -> Vec<usize> {
        let holds = |i: &usize| object.holds(self.points[*i], 0.0, FEET_M);
        (0..self.points.len()).filter(holds).collect()
    }

    /// Of an object's points, the largest share that one cluster holds, and of that
    /// cluster, the share of points that are not the object's.
    pub fn shares(&self, object: &Object, inside: &[usize], found: &Segmentation) -> (f64, f64) {
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
        let is_other = |&&point: &&u32| !object.holds(self.points[point as usize], MARGIN_M, -1.0);
        let others = cluster.iter().filter(is_other).count();
        (count as f64 / inside.len() as f64, others as f64 / cluster.len() as f64)
    }
}
