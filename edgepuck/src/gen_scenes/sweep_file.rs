//! Sweeps as files, of which all formats but NPZ have the class and the object of each point.

use std::path::Path;

use anyhow::{Context, ensure};
use edgepuck_scenes::{DrawnScene, LabelledScene, Objects, Stage};
use formats::hash::Hashing;
use formats::rows;
use formats::scan::Column;
use formats::scan_file::{ScanFormat, write_scan};

use super::sequence::{Sequence, point_columns};

formats::named! {
    /// A file format of sweeps.
    pub enum SweepFormat: "format of sweeps" {
        /// NumPy's archive, as of `edgepuck scan`.
        Npz = "npz",
        /// SemanticKITTI's pairs of files.
        SemanticKitti = "semantickitti",
        /// The Point Cloud Library's format.
        Pcd = "pcd",
        /// The ASPRS's format.
        Las = "las",
    }
}

/// SemanticKITTI's label (semantic-kitti.yaml of semantic-kitti-api) and the ASPRS's code (LAS 1.4
/// R15, table 17) of kinds of objects, and of classes of the user's meshes by these names.
const CODES: [(&[&str], u16, u8); 17] = [
    (&["air"], 1, 7),
    (&["ground"], 49, 2),
    (&["car"], 10, 1),
    (&["bicycle"], 11, 1),
    (&["bus"], 13, 1),
    (&["motorcycle"], 15, 1),
    (&["truck"], 18, 1),
    (&["person", "child"], 30, 1),
    (&["cyclist"], 31, 1),
    (&["motorcyclist"], 32, 1),
    (&["house-front", "building"], 50, 6),
    (&["wall", "fence", "barrier"], 51, 1),
    (&["bush", "hedge"], 70, 4),
    (&["tree"], 70, 5),
    (&["trunk"], 71, 5),
    (&["pole", "lamp-post", "traffic-light"], 80, 1),
    (&["traffic-sign", "sign"], 81, 1),
];
/// Other objects, and unclassified points.
const OTHER: (u16, u8) = (99, 1);
/// SemanticKITTI's labels of cars, bicyclists, persons, motorcyclists, buses and trucks, and of those
/// that move.
const MOVING: [(u16, u16); 6] = [(10, 252), (31, 253), (30, 254), (32, 255), (13, 257), (18, 258)];

/// What a point lies on.
#[derive(Clone, Copy)]
struct Surface {
    /// The number of its class in [`classes`].
    class: u16,
    /// The number of its object; 0 for the ground and the air.
    object: u16,
    /// As in [`CODES`].
    codes: (u16, u8),
}

/// The classes by the numbers that points have in PCD and LAS.
pub fn classes(stage: &Stage) -> Vec<&str> {
    ["air", "ground"].into_iter().chain(stage.classes().iter().map(String::as_str)).collect()
}

/// The names of the classes, and the number of that of each point.
pub fn point_classes(stage: &Stage, done: &LabelledScene) -> (Vec<String>, Vec<u32>) {
    let surfaces = surfaces(stage, &done.scene);
    let air = surfaces.len() - 1;
    let of_points =
        done.sweep.surfaces().iter().map(|&i| surfaces[air.min(i as usize)].class.into());
    (classes(stage).into_iter().map(str::to_owned).collect(), of_points.collect())
}

/// Writes the sweep into the folder `sweeps`.
pub fn write(
    stage: &Stage,
    done: &LabelledScene,
    format: SweepFormat,
    sweeps: &Path,
) -> anyhow::Result<()> {
    let (scan, number) = (&done.sweep.scan, done.scene.number);
    let file = |end: &str| sweeps.join(format!("{number:06}.{end}"));
    let n_classes = classes(stage).len();
    let is_narrow = format == SweepFormat::Las;
    ensure!(!is_narrow || n_classes <= 256, "las: expected at most 254 classes, found {n_classes}");
    let of_points = of_points(stage, done).with_context(|| format.to_string())?;
    let column = |of: fn(&Surface) -> u32| of_points.iter().map(of).collect::<Vec<u32>>();
    let intensity = scan.intensity.as_deref().expect("invariant: sweeps have intensities");
    match format {
        SweepFormat::Npz => {
            write_scan(&file("npz"), ScanFormat::Npz, Hashing::None, scan)?;
        }
        SweepFormat::SemanticKitti => {
            let labels = column(semantic_label);
            let sequence = Sequence(sweeps.to_path_buf());
            sequence.add(number as usize, &scan.positions, intensity, &labels)?;
        }
        SweepFormat::Pcd => {
            let [label, instance] = [column(|s| s.class.into()), column(|s| s.object.into())];
            let mut columns = point_columns(&scan.positions, intensity).to_vec();
            columns.push((vec!["ring"], Column::U16(done.sweep.rings())));
            columns.push((vec!["label"], Column::U32(&label)));
            columns.push((vec!["instance"], Column::U32(&instance)));
            let header = rows::pcd_header(None, &columns);
            rows::write(&file("pcd"), Hashing::None, &header, &columns)?;
        }
        #[cfg(feature = "las")]
        SweepFormat::Las => {
            let points: Vec<_> = scan.positions.iter().map(|at| at.map(f64::from)).collect();
            formats::cloud_file::write_las(&file("las"), &points, |i| {
                formats::cloud_file::LasPoint {
                    intensity: (intensity[i] * f32::from(u16::MAX)).round() as u16,
                    class: of_points[i].codes.1,
                    user_data: of_points[i].class as u8,
                    source: of_points[i].object,
                }
            })?;
        }
        #[cfg(not(feature = "las"))]
        SweepFormat::Las => unreachable!("invariant: builds without LAS refuse it"),
    }
    Ok(())
}

/// SemanticKITTI's label of each point: its class, and its object in the high half.
pub fn semantic_labels(stage: &Stage, done: &LabelledScene) -> anyhow::Result<Vec<u32>> {
    let of_points = of_points(stage, done).context("semantickitti")?;
    Ok(of_points.iter().map(semantic_label).collect())
}

fn semantic_label(of: &Surface) -> u32 {
    u32::from(of.object) << 16 | u32::from(of.codes.0)
}

/// SemanticKITTI's class of objects of this `kind`, which may move.
pub fn semantic_class(kind: &str, moves: bool) -> u16 {
    let (class, _) = codes(kind);
    let moving = MOVING.iter().find(|(still, _)| moves && *still == class);
    moving.map_or(class, |(_, moving)| *moving)
}

/// The kind by which `CODES` has the objects of an entry of a recipe.
pub fn kind(entry: &Objects) -> &str {
    entry.built_in().map_or(&*entry.class, |_| &entry.kind)
}

fn codes(kind: &str) -> (u16, u8) {
    let codes = CODES.iter().find(|(names, ..)| names.contains(&kind));
    codes.map_or(OTHER, |&(_, label, code)| (label, code))
}

/// What each point lies on.
fn of_points(stage: &Stage, done: &LabelledScene) -> anyhow::Result<Vec<Surface>> {
    let n_objects = done.scene.objects.len();
    ensure!(n_objects < 1 << 16, "expected at most 65535 objects, found {n_objects}");
    let surfaces = surfaces(stage, &done.scene);
    let air = surfaces.len() - 1;
    Ok(done.sweep.surfaces().iter().map(|&i| surfaces[air.min(i as usize)]).collect())
}

/// The air, last, the ground, first, and the objects of `scene` between them.
fn surfaces(stage: &Stage, scene: &DrawnScene) -> Vec<Surface> {
    let classes = classes(stage);
    let surface = |object: u16, kind: &str, class: &str| {
        let class = classes.iter().position(|known| *known == class);
        let codes = codes(kind);
        let class = class.expect("invariant: a stage has the classes of all its objects") as u16;
        Surface { class, object, codes }
    };
    let objects = (1..).zip(&scene.objects).map(|(number, object)| {
        let entry = &stage.recipe().object[object.entry];
        surface(number, kind(entry), &entry.class)
    });
    let ground = surface(0, "ground", "ground");
    std::iter::once(ground).chain(objects).chain([surface(0, "air", "air")]).collect()
}
