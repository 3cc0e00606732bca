//! The class and the object of each point of a sweep.

use anyhow::ensure;
use edgepuck_scenes::{DrawnScene, LabelledScene, Objects, Stage};

/// SemanticKITTI's class (semantic-kitti.yaml of semantic-kitti-api) of kinds of objects, and of classes of
/// the user's meshes by these names.
const CLASSES: [(&[&str], u16); 16] = [
    (&["air"], 1),
    (&["ground"], 49),
    (&["car"], 10),
    (&["bicycle"], 11),
    (&["bus"], 13),
    (&["motorcycle"], 15),
    (&["truck"], 18),
    (&["person", "child"], 30),
    (&["cyclist"], 31),
    (&["motorcyclist"], 32),
    (&["house-front", "building"], 50),
    (&["wall", "fence", "barrier"], 51),
    (&["bush", "hedge", "tree"], 70),
    (&["trunk"], 71),
    (&["pole", "lamp-post", "traffic-light"], 80),
    (&["traffic-sign", "sign"], 81),
];
/// Other objects.
const OTHER: u16 = 99;
/// SemanticKITTI's classes of cars, bicyclists, persons, motorcyclists, buses and trucks, and of those
/// that move.
const MOVING: [(u16, u16); 6] = [(10, 252), (31, 253), (30, 254), (32, 255), (13, 257), (18, 258)];

/// The class and the object of each point as SemanticKITTI labels them: the class in the low 16 bits, the
/// object in the high 16; the ground and the air are no objects.
pub fn semantic_labels(stage: &Stage, done: &LabelledScene) -> anyhow::Result<Vec<u32>> {
    let n_objects = done.scene.objects.len();
    let cause = "semantickitti: expected at most 65535 objects, found";
    ensure!(n_objects < 1 << 16, "{cause} {n_objects}");
    let label = |(number, kind, _): (u32, &str, &str)| {
        number << 16 | u32::from(semantic_class(kind, false))
    };
    Ok(of_points(done, surfaces(stage, &done.scene).map(label)))
}

/// The names of the classes, and the number of that of each point.
pub fn point_classes(stage: &Stage, done: &LabelledScene) -> (Vec<String>, Vec<u32>) {
    let own = stage.classes().iter().map(String::as_str);
    let names: Vec<&str> = ["air", "ground"].into_iter().chain(own).collect();
    let number = |(.., class): (u32, &str, &str)| {
        let place = names.iter().position(|known| *known == class);
        place.expect("invariant: a stage has the classes of all its objects") as u32
    };
    let numbers = of_points(done, surfaces(stage, &done.scene).map(number));
    (names.into_iter().map(str::to_owned).collect(), numbers)
}

/// SemanticKITTI's class of objects of this `kind`, which may move.
pub fn semantic_class(kind: &str, moves: bool) -> u16 {
    let class = CLASSES.iter().find(|(names, _)| names.contains(&kind));
    let class = class.map_or(OTHER, |(_, class)| *class);
    let moving = MOVING.iter().find(|(still, _)| moves && *still == class);
    moving.map_or(class, |(_, moving)| *moving)
}

/// The kind by which [`CLASSES`] has the objects of an entry of a recipe.
pub fn kind(entry: &Objects) -> &str {
    entry.built_in().map_or(&*entry.class, |_| &entry.kind)
}

/// The number of the object, the kind and the class of the ground, of the objects of `scene`, and of the air,
/// last.
fn surfaces<'a>(
    stage: &'a Stage,
    scene: &'a DrawnScene,
) -> impl Iterator<Item = (u32, &'a str, &'a str)> {
    let objects = (1..).zip(&scene.objects).map(|(number, object)| {
        let entry = &stage.recipe().object[object.entry];
        (number, kind(entry), &*entry.class)
    });
    let [ground, air] = ["ground", "air"].map(|name| (0, name, name));
    std::iter::once(ground).chain(objects).chain([air])
}

/// The number that each point has by its surface.
fn of_points(done: &LabelledScene, of_surfaces: impl Iterator<Item = u32>) -> Vec<u32> {
    let of_surfaces: Vec<u32> = of_surfaces.collect();
    let air = of_surfaces.len() - 1;
    done.sweep.surfaces().iter().map(|&i| of_surfaces[air.min(i as usize)]).collect()
}
