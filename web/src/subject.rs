//! What is scanned.

use std::path::Path;

use edgepuck_assets::SCENE_RECIPES;
use edgepuck_scenes::{DrawnScene, Recipe, Stage};
use edgepuck_shapes::ShapeClass;
use edgepuck_shapes::objects::{ObjectKind, object};
use sim_gpu::{Mesh, Pose, Scene};

use crate::settings::Settings;
use crate::{Words, words};

/// A mesh, or a street with the pose of its sensor.
pub enum Subject {
    Object(Scene),
    Street(Scene, Pose),
}

/// The names of what is built in: shapes, objects at real size, and scenes.
pub fn names() -> impl Iterator<Item = &'static str> {
    let shapes = ShapeClass::ALL.into_iter().map(ShapeClass::name);
    let shared = |name: &str| ShapeClass::ALL.iter().any(|shape| shape.name() == name);
    let objects = ObjectKind::ALL.into_iter().map(ObjectKind::name);
    let scenes = SCENE_RECIPES.into_iter().map(|(name, _)| name);
    shapes.chain(objects.filter(move |name| !shared(name))).chain(scenes)
}

impl Subject {
    /// What is built in under this name.
    pub fn built_in(name: &str) -> Result<Self, Words> {
        if let Some((_, recipe)) = SCENE_RECIPES.into_iter().find(|(known, _)| *known == name) {
            return street(name, recipe);
        }
        let shape = ShapeClass::ALL.into_iter().find(|shape| shape.name() == name);
        let kind = ObjectKind::ALL.into_iter().find(|kind| kind.name() == name);
        let mesh = match (shape, kind) {
            (Some(shape), _) => edgepuck_shapes::generate(shape, 0, 0),
            (None, Some(kind)) => object(kind, 0, 0).mesh,
            (None, None) => return Err(format!("expected something built in, found \"{name}\"")),
        };
        Ok(Self::of_mesh(&Mesh::try_from(mesh).map_err(words)?))
    }

    /// The mesh in a file of this name and content, and what is probably wrong with it.
    pub fn of_file(name: &str, bytes: &[u8]) -> Result<(Self, Vec<String>), Words> {
        let mesh = Mesh::from_bytes(name, bytes).map_err(words)?;
        let warnings = mesh.warnings().iter().map(ToString::to_string).collect();
        Ok((Self::of_mesh(&mesh), warnings))
    }

    fn of_mesh(mesh: &Mesh) -> Self {
        let mut scene = Scene::new();
        // Whatever its unit: the distance is from its middle, in its radii.
        scene.add(mesh.unit_sphere(), Pose::IDENTITY);
        Self::Object(scene)
    }

    /// The mesh of an object.
    pub fn mesh(&self) -> Option<&Mesh> {
        match self {
            Self::Object(scene) => scene.instances().first().map(|instance| &instance.mesh),
            Self::Street(..) => None,
        }
    }

    /// The scene, and the pose of the sensor by these settings.
    pub fn scene(&self, settings: &Settings) -> (&Scene, Pose) {
        let Settings { distance_m, elevation_deg, azimuth_deg, .. } = *settings;
        match self {
            Self::Street(scene, pose) => (scene, *pose),
            Self::Object(scene) => {
                (scene, Pose::looking_at_origin_deg(distance_m, elevation_deg, azimuth_deg))
            }
        }
    }
}

/// The first scene of a recipe.
fn street(name: &str, recipe: &str) -> Result<Subject, Words> {
    let file = Path::new(name);
    let recipe = Recipe::parse(recipe, file).map_err(words)?;
    let stage = Stage::new(recipe, file, None, 0).map_err(words)?;
    let drawn = DrawnScene::draw(&stage, 0);
    Ok(Subject::Street(stage.build(&drawn), drawn.pose))
}
