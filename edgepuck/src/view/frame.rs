//! What a page shows, in the form that the viewer's JavaScript takes (`createViewer` in
//! assets/view/src/viewer.js).

use anyhow::{Context, ensure};
use base64::display::Base64Display;
use base64::engine::general_purpose::STANDARD;
use bytemuck::cast_slice;
use formats::geometry::{OrientedBox, Pose, Trajectory};
use formats::plausible::{bounds, mesh_size, unit_of_scanned};
use formats::trajectory::check_cover;
use formats::unit::Unit;
use formats::{Scan, counted};
use serde::ser::SerializeMap;
use serde::{Serialize, Serializer};
use sim_gpu::glam::DVec3;
use std::collections::HashSet;
use std::path::{Path, PathBuf};

use crate::Usage;

/// A file, or a drive or a folder of sweeps.
#[derive(Serialize)]
pub struct Pane {
    name: String,
    pub frames: Vec<Frame>,
    /// Its place among the files.
    #[serde(skip)]
    pub number: usize,
    /// Where the sensor's poses would be, if it moves: `gen-scenes --drive` writes them beside a capture.
    #[serde(skip)]
    poses: PathBuf,
}

/// What is seen at once.
#[derive(Default, Serialize)]
pub struct Frame {
    pub name: String,
    /// The number of the turn, which boxes name; that of the frame if it is not known.
    #[serde(skip)]
    pub turn: Option<u64>,
    /// The origin of the meshes of a frame without points, metres.
    #[serde(skip)]
    pub origin: [f64; 3],
    /// The pose in the world from which points and boxes are seen, if it moves and is known.
    pub pose: Option<[f64; 16]>,
    pub points: Option<Points>,
    pub meshes: Vec<Mesh>,
    pub boxes: Vec<Placed>,
    pub sensors: Vec<Sensor>,
}

/// Points with their attributes.
pub struct Points {
    pub scan: Scan,
    /// What a scan has no attribute for.
    pub labels: Vec<Labels>,
}

/// A number of each point.
#[derive(Clone)]
pub struct Labels {
    pub name: &'static str,
    pub values: Vec<u32>,
    /// The names of classes, if the numbers are their indices.
    pub names: Option<Vec<String>>,
}

/// Triangles, metres from the origin of the frame's points.
#[derive(Clone, Serialize)]
pub struct Mesh {
    pub name: String,
    pub class: Option<String>,
    #[serde(serialize_with = "block_f32")]
    pub position: Vec<[f32; 3]>,
    #[serde(serialize_with = "block_u32")]
    pub index: Vec<[u32; 3]>,
}

/// A sensor, and some of its beams up to where they end.
#[derive(Serialize)]
pub struct Sensor {
    pub name: String,
    pub pose: [f64; 16],
    #[serde(serialize_with = "block_f32")]
    pub rays: Vec<[f32; 3]>,
}

/// A box around an object.
#[derive(Clone, Default, Serialize)]
pub struct Placed {
    pub class: Option<String>,
    #[serde(flatten, with = "Keys")]
    pub place: OrientedBox,
    pub score: Option<f64>,
    pub track: Option<u64>,
    pub truth: bool,
    #[serde(skip)]
    pub turn: Option<u64>,
    /// The name of the file of its points.
    #[serde(skip)]
    pub sweep: Option<String>,
    /// Whether its frame is the world's, and not the sensor's.
    #[serde(skip)]
    pub in_world: bool,
    /// The pose of the sensor then, if it was in the world's frame.
    #[serde(skip)]
    pub seen_from: Option<Pose>,
    /// When it was there: Unix time in seconds.
    #[serde(skip)]
    pub time_s: Option<f64>,
}

/// The keys of a box.
#[derive(Serialize)]
#[serde(remote = "OrientedBox")]
struct Keys {
    #[serde(rename = "centre")]
    centre_m: [f64; 3],
    #[serde(rename = "size")]
    size_m: [f64; 3],
    #[serde(rename = "yaw")]
    yaw_rad: f64,
}

impl Pane {
    pub fn new(number: usize, file: &Path, frames: Vec<Frame>) -> Self {
        let name = file.file_name().unwrap_or(file.as_os_str());
        let poses = file.with_extension("tum");
        Self { name: name.to_string_lossy().into_owned(), frames, number, poses }
    }

    /// Whether it has meshes, as of a file of meshes or a scene.
    pub fn has_meshes(&self) -> bool {
        self.frames.len() == 1 && !self.frames[0].meshes.is_empty()
    }

    /// Lays the meshes of `under` under the points of each frame that is a scan of them, in the unit in which
    /// it is one. Returns whether there is such a frame.
    pub fn lay_over(&mut self, under: &Self) -> bool {
        let Some(Frame { meshes, origin, .. }) = under.frames.first() else { return false };
        let (mut found, mut share) = (None, 0.0);
        let from =
            |at: &[f32; 3], origin: [f64; 3]| [0, 1, 2].map(|i| f64::from(at[i]) + origin[i]);
        let vertices = meshes.iter().flat_map(|mesh| &mesh.position);
        let mesh_bounds = bounds(vertices.map(|at| from(at, *origin)));
        for frame in &mut self.frames {
            let Some(Points { scan, .. }) = &frame.points else { continue };
            let shift = scan.origin;
            let points = scan.positions.iter().map(|at| from(at, shift));
            let Some(unit) = unit_of_scanned(mesh_bounds, points) else { continue };
            let moved = |at: &[f32; 3]| {
                let place = from(at, *origin).map(|x| unit.metres() * x);
                [0, 1, 2].map(|axis| (place[axis] - shift[axis]) as f32)
            };
            let moved = |mesh: &Mesh| Mesh {
                position: mesh.position.iter().map(moved).collect(),
                ..mesh.clone()
            };
            frame.meshes.extend(meshes.iter().map(moved));
            found = Some(unit);
            share = share_on(&frame.meshes, &scan.positions).max(share);
        }
        let (mesh, scan) = (&under.name, &self.name);
        if let Some(unit) = found.filter(|unit| *unit != Unit::Metre) {
            program::say!("{mesh} is drawn in {}: so it fits {scan}, its scan", unit.plural());
        }
        // There may be a ground.
        if share < 0.5 && self.frames.iter().any(|frame| frame.n_points() > 0) {
            program::say!(
                "warning: {scan} is probably not a scan of {mesh}, in any unit: of its points near the mesh, \
                 {:.0} % are on the surface",
                100.0 * share
            );
        }
        found.is_some()
    }

    /// Prints a warning if a mesh, taken to be in metres, has a size that is not likely.
    pub fn warn_of_size(&self) {
        let meshes = self.frames.iter().filter(|frame| frame.points.is_none());
        let vertices = meshes.flat_map(|frame| &frame.meshes).flat_map(|mesh| &mesh.position);
        let [low, high] = bounds(vertices.map(|at| at.map(f64::from)));
        let size_m = [0, 1, 2].map(|axis| high[axis] - low[axis]);
        let remedy = "over its scan, it is drawn in the unit in which it fits";
        if let Some(warning) = mesh_size(size_m, Unit::Metre, remedy) {
            program::say!("warning: {}: {warning}", self.name);
        }
    }

    pub fn is_empty(&self) -> bool {
        self.frames
            .iter()
            .all(|frame| frame.n_points() + frame.meshes.len() + frame.boxes.len() == 0)
    }

    /// Keeps the first frame that has boxes and points, or else points; of turns, of which the first and the
    /// last may be parts, those with a half of the most points.
    pub fn keep_one(&mut self) {
        let most = self.frames.iter().map(Frame::n_points).max().unwrap_or(0);
        let is_full = |frame: &Frame| {
            let is_part = frame.name.starts_with("turn ") && 2 * frame.n_points() < most;
            frame.n_points() > 0 && !is_part
        };
        let with_boxes = |frame: &Frame| is_full(frame) && !frame.boxes.is_empty();
        let found = self.frames.iter().position(with_boxes);
        let first = found.or_else(|| self.frames.iter().position(is_full)).unwrap_or(0);
        self.frames = std::mem::take(&mut self.frames).into_iter().skip(first).take(1).collect();
    }

    /// The numbers of points, meshes, boxes and frames.
    pub fn summary(&self) -> String {
        let sum = |of: fn(&Frame) -> usize| self.frames.iter().map(of).sum::<usize>();
        let all = [
            (sum(Frame::n_points), "point"),
            (sum(|frame| frame.meshes.len()), "mesh"),
            (sum(|frame| frame.boxes.len()), "box"),
        ];
        let all = all.into_iter().filter(|(n, _)| *n > 0);
        let counts: Vec<_> = all.map(|(n, noun)| counted(n, noun)).collect();
        match self.frames.len() {
            1 => counts.join(", "),
            n => format!("{} in {n} frames", counts.join(", ")),
        }
    }

    /// Adds the boxes in `file` to the frames of their turns, or to all frames if they name none.
    pub fn add(&mut self, boxes: Vec<Placed>, file: &Path) -> anyhow::Result<()> {
        if self.frames.is_empty() {
            let mut turns: Vec<_> = boxes.iter().map(|placed| placed.turn).collect();
            turns.sort_unstable();
            turns.dedup();
            let frame = |turn: Option<u64>| {
                let name = turn.map_or(String::new(), |turn| format!("turn {turn}"));
                Frame { name, turn, ..Frame::default() }
            };
            self.frames = turns.into_iter().map(frame).collect();
        }
        let has_points = self.frames.iter().any(|frame| frame.n_points() > 0);
        let boxes = match has_points && boxes.iter().any(|placed| placed.in_world) {
            true => self.seen_from_sensor(boxes, file)?,
            false => boxes,
        };
        let of_sweep = boxes.iter().find_map(|placed| placed.sweep.clone()).unwrap_or_default();
        let is_named = |frame: &Frame| Path::new(&frame.name).ends_with(&of_sweep);
        let one_is_named = !of_sweep.is_empty() && self.frames.iter().any(is_named);
        let (file, name) = (file.display(), &self.name);
        if !one_is_named && !of_sweep.is_empty() && of_sweep != self.name && has_points {
            program::say!("warning: {file}: expected boxes of {name}, found boxes of {of_sweep}");
        }
        let is_stray = |placed: &Placed| {
            let mut turns = (0..).zip(&self.frames).map(|(n, frame)| frame.turn.unwrap_or(n));
            placed.turn.is_some_and(|turn| turns.all(|other| other != turn))
        };
        if !boxes.is_empty() && boxes.iter().all(is_stray) {
            program::say!("warning: {file}: expected boxes of {name}, found those of other turns");
        }
        for (number, frame) in (0..).zip(&mut self.frames) {
            if one_is_named && !is_named(frame) {
                continue;
            }
            let is_of = |placed: &&Placed| {
                placed.turn.is_none_or(|turn| turn == frame.turn.unwrap_or(number))
            };
            let shift = frame.sensor_m();
            let boxes = boxes.iter().filter(is_of).cloned().map(|mut placed| {
                (0..3).for_each(|axis| placed.place.centre_m[axis] += shift[axis]);
                placed
            });
            let boxes: Vec<_> = boxes.collect();
            let seen_from = boxes.iter().find_map(|placed| placed.seen_from);
            frame.pose = frame.pose.or(seen_from.map(|pose| pose.matrix()));
            frame.boxes.extend(boxes);
        }
        Ok(())
    }

    /// The boxes in `file` from the sensor, by its poses.
    fn seen_from_sensor(&self, boxes: Vec<Placed>, file: &Path) -> anyhow::Result<Vec<Placed>> {
        let (file, poses) = (file.display(), self.poses.display());
        ensure!(
            self.poses.is_file(),
            Usage(format!(
                "{file}: expected boxes in the sensor's frame, as its points are, found boxes in the \
                 world's, and no poses of the sensor in {poses}: copy them there, or show the boxes \
                 alone, or those of `live` without --poses"
            ))
        );
        let motion = Trajectory::load(&self.poses)?;
        let seen = boxes.into_iter().map(|placed| {
            if !placed.in_world {
                return Ok(placed);
            }
            let lack = || format!("{file}: expected `time_s` or `last_s` of each box, found none");
            let time_s = placed.time_s.with_context(lack)?;
            let (name, [first, last]) = (&self.name, motion.known_s());
            ensure!(
                check_cover([first, last], [time_s; 2]).is_ok(),
                "{file}: expected boxes of {name}, whose poses in {poses} are from {first:.3} s to {last:.3} s, \
                 found one at {time_s:.3} s: are the boxes or the poses of another drive?"
            );
            let pose = motion.at(time_s);
            Ok(Placed { place: placed.place.seen_from(&pose), seen_from: Some(pose), ..placed })
        });
        seen.collect()
    }

    /// Keeps so few frames, evenly, and so few points of each, evenly, that there are about `most`
    /// points.
    pub fn thin(&mut self, most: usize) {
        let n_points: usize = self.frames.iter().map(Frame::n_points).sum();
        let every = n_points.div_ceil(most.max(1));
        if every > 1 && self.frames.len() > 1 {
            let n = self.frames.len();
            let mut number = 0..;
            self.frames.retain(|_| number.next().is_some_and(|i: usize| i.is_multiple_of(every)));
            program::say!("{}: {} of {n} frames are shown", self.name, self.frames.len());
        }
        for frame in &mut self.frames {
            let Some(Points { scan, labels }) = &mut frame.points else { continue };
            let every = scan.len().div_ceil(most.max(1));
            if every > 1 {
                program::say!("{}: one of {every} points is shown", self.name);
                let kept: Vec<usize> = (0..scan.len()).step_by(every).collect();
                *scan = scan.select(&kept);
                for Labels { values, .. } in labels {
                    *values = kept.iter().map(|&i| values[i]).collect();
                }
            }
        }
    }
}

impl Frame {
    /// Points, with the place of the sensor if they are a sensor's.
    pub fn of_scan(name: String, scan: Scan, labels: Vec<Labels>) -> Self {
        let measured = [&scan.range_m, &scan.intensity].into_iter().any(Option::is_some)
            || scan.ring.is_some()
            || scan.pose.is_some();
        let origin = scan.origin;
        let pose = from_origin(scan.pose.unwrap_or(IDENTITY), origin);
        let sensor = Sensor { name: "sensor".to_owned(), pose, rays: Vec::new() };
        let sensors = measured.then_some(sensor).into_iter().collect();
        Self { name, points: Some(Points { scan, labels }), sensors, ..Self::default() }
    }

    pub fn n_points(&self) -> usize {
        self.points.as_ref().map_or(0, |points| points.scan.len())
    }

    /// The position of the sensor of the points from their origin, metres.
    fn sensor_m(&self) -> [f64; 3] {
        let Some(Points { scan, .. }) = &self.points else { return [0.0; 3] };
        let at = scan.sensor_position_m();
        [0, 1, 2].map(|axis| at[axis] - scan.origin[axis])
    }
}

/// The share of the `points` in the bounding box of `meshes` that are within a twentieth of its size of their
/// surfaces.
fn share_on(meshes: &[Mesh], points: &[[f32; 3]]) -> f64 {
    let wide = |at: &[f32; 3]| DVec3::from(at.map(f64::from));
    let vertices = meshes.iter().flat_map(|mesh| &mesh.position);
    let [low, high] = bounds(vertices.map(|at| at.map(f64::from))).map(DVec3::from);
    let step_m = 0.05 * (high - low).max_element();
    let cell = |at: DVec3| (at / step_m).floor().as_ivec3();
    let mut surface = HashSet::new();
    for (mesh, corners) in meshes.iter().flat_map(|it| it.index.iter().map(move |at| (it, at))) {
        let [a, b, c] = corners.map(|i| wide(&mesh.position[i as usize]));
        let n = (2.0 * (b - a).length().max((c - a).length()) / step_m).ceil().max(1.0) as u32;
        for (i, j) in (0..=n).flat_map(|i| (0..=n - i).map(move |j| (i, j))) {
            let [along, across] = [i, j].map(|k| f64::from(k) / f64::from(n));
            surface.insert(cell(a + along * (b - a) + across * (c - a)));
        }
    }
    let is_near = |at: &DVec3| at.cmpge(low - step_m).all() && at.cmple(high + step_m).all();
    let near: Vec<DVec3> = points.iter().map(wide).filter(is_near).collect();
    // Of the eight cells that are nearest.
    let aside = |k: u8| step_m * (DVec3::from([k & 1, k >> 1 & 1, k >> 2].map(f64::from)) - 0.5);
    let is_on = |at: &&DVec3| (0..8).any(|k| surface.contains(&cell(**at + aside(k))));
    near.iter().filter(is_on).count() as f64 / near.len().max(1) as f64
}

/// A sensor at the origin, which looks along x.
pub const IDENTITY: [f64; 16] = [1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1.];

/// The pose as seen from `origin`.
pub fn from_origin(mut pose: [f64; 16], origin: [f64; 3]) -> [f64; 16] {
    (0..3).for_each(|axis| pose[4 * axis + 3] -= origin[axis]);
    pose
}

fn block_f32<S: Serializer>(values: &[[f32; 3]], serializer: S) -> Result<S::Ok, S::Error> {
    block("f32", cast_slice(values), serializer)
}

fn block_u32<S: Serializer>(values: &[[u32; 3]], serializer: S) -> Result<S::Ok, S::Error> {
    block("u32", cast_slice(values), serializer)
}

/// Numbers as the viewer takes them: little-endian, in base64, by their type.
fn block<S: Serializer>(kind: &str, bytes: &[u8], serializer: S) -> Result<S::Ok, S::Error> {
    let mut map = serializer.serialize_map(Some(1))?;
    map.serialize_entry(kind, &format_args!("{}", Base64Display::new(bytes, &STANDARD)))?;
    map.end()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_of_a_sweep_stand_where_its_sensor_saw_them() {
        let pose = Pose::at([103.0, 4.0, 1.0]).matrix();
        let scan = Scan {
            origin: [100.0, 0.0, 0.0],
            pose: Some(pose),
            positions: vec![[3.0, 4.0, 0.0]],
            ..Scan::default()
        };
        let frame = Frame::of_scan("turn 7".to_owned(), scan, Vec::new());
        let mut pane = Pane::new(0, Path::new("a.npz"), vec![Frame { turn: Some(7), ..frame }]);
        let at = |centre_m, turn| Placed {
            place: OrientedBox { centre_m, ..OrientedBox::default() },
            turn,
            ..Placed::default()
        };
        let found = vec![at([1.0, 2.0, 0.5], Some(7)), at([9.0; 3], Some(6)), at([0.0; 3], None)];
        pane.add(found, Path::new("b.json")).unwrap();
        let centres: Vec<_> = pane.frames[0].boxes.iter().map(|it| it.place.centre_m).collect();
        assert_eq!(centres, [[4.0, 6.0, 1.5], [3.0, 4.0, 1.0]]);
    }
}
