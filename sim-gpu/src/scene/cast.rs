//! Scans a scene: every sensor against every object.

use super::{Scene, SceneObject, SceneSensor};
use crate::bvh::Builder;
use crate::caster::OpenCaster;
use crate::job::Culling;
use crate::material::{Material, MaterialError, Materials};
use crate::mesh::frame::{Normalize, to_world};
use crate::mesh::validate::triangle_stats;
use crate::mesh::{LoadedMesh, MeshError, TriangleMesh, load};
use crate::scan::{PlacedTarget, ScanError, ScanRequest, Scanned, Tally, scan_objects};
use crate::simplify::{NotBuilt, Simplified, Viewpoint, resolved_m, simplified_surface};
use crate::target::{Surface, Target};
use formats::Scan;
use formats::rng::StreamKey;
use glam::DAffine3;

/// Why a scene cannot be scanned.
#[derive(Debug, thiserror::Error)]
pub enum SceneError {
    /// A mesh cannot be read.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The materials of a mesh cannot be had.
    #[error(transparent)]
    Material(#[from] MaterialError),
    /// An effect does not fit a sensor, or the adapter failed.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// A mesh cannot be simplified.
    #[error(transparent)]
    NotBuilt(#[from] NotBuilt),
}

/// What one sensor saw.
#[derive(Clone, Debug)]
pub struct SceneScan {
    /// The sensor's name.
    pub sensor: String,
    /// The points.
    pub scan: Scan,
    /// What became of the returns.
    pub tally: Tally,
    /// Whether the CPU cast it because a mesh was too large for the adapter.
    pub too_large_for_adapter: bool,
    /// By object, what simplification made of it where it was asked for.
    pub simplified: Vec<Option<Simplified>>,
}

/// An object ready to be cast at.
struct Placed {
    target: Target,
    world_from_object: DAffine3,
    simplified: Option<Simplified>,
    materials: Option<Materials>,
}

/// One scan per sensor of `scene`. `caster` must have been opened for the
/// scene's effects.
///
/// # Errors
/// If a mesh cannot be read, an effect does not fit a sensor, or the adapter
/// fails.
pub fn cast(
    scene: &Scene,
    caster: &OpenCaster,
    culling: Culling,
) -> Result<Vec<SceneScan>, SceneError> {
    let objects =
        scene.objects.iter().map(|object| place(scene, object)).collect::<Result<Vec<_>, _>>()?;
    let sensors = scene.sensors.iter().zip(0..);
    sensors.map(|(sensor, i)| cast_sensor(scene, sensor, i, &objects, caster, culling)).collect()
}

fn place(scene: &Scene, object: &SceneObject) -> Result<Placed, SceneError> {
    let LoadedMesh { mesh, format, .. } = load(&object.mesh)?;
    let normalize = object.normalize.unwrap_or(Normalize::None);
    let world = to_world(&mesh, object.up.unwrap_or(format.default_up()), normalize);
    let kept = triangle_stats(&world.mesh).kept;
    let mut world_from_object = object.world_from_object();
    if normalize == Normalize::None {
        // The mesh keeps its own origin: undo the recentring.
        world_from_object *= DAffine3::from_translation(world.centre);
    }
    let otherwise =
        Material { reflectivity: object.reflectivity, retroreflection: object.retroreflection };
    let materials = (!object.materials.is_plain())
        .then(|| Materials::load(&object.mesh, &object.materials, otherwise))
        .transpose()?;
    let Some(simplify) = scene.simplify_of(object) else {
        let target = Target::new(Surface::new(world.mesh, kept), Builder::Sah);
        return Ok(Placed { target, world_from_object, simplified: None, materials });
    };
    let bound_m = simplify.bound_m(|| resolved_by(scene, object, &world.mesh, &world_from_object));
    // No length of the mesh is longer in the world than by its largest factor.
    let surface = simplified_surface(world.mesh, kept, bound_m / object.scale.max_element())?;
    let simplified = Some(Simplified { bound_m, triangles: surface.len() as u64 });
    let target = Target::new(surface, Builder::Sah);
    Ok(Placed { target, world_from_object, simplified, materials })
}

/// What the scene's sensors can tell apart on `mesh`, in metres.
fn resolved_by(
    scene: &Scene,
    object: &SceneObject,
    mesh: &TriangleMesh,
    world_from_object: &DAffine3,
) -> f64 {
    let object_from_world = world_from_object.inverse();
    let viewpoints = scene.sensors.iter().map(|sensor| Viewpoint {
        sensor: &sensor.sensor,
        positions: vec![object_from_world.transform_point3(sensor.pose.position_m)],
    });
    let viewpoints: Vec<Viewpoint> = viewpoints.collect();
    // No distance in the world is shorter than by the mesh's least factor.
    let least = object.scale.min_element();
    resolved_m(mesh, least.recip(), &viewpoints) * least
}

fn cast_sensor(
    scene: &Scene,
    sensor: &SceneSensor,
    number: u32,
    objects: &[Placed],
    caster: &OpenCaster,
    culling: Culling,
) -> Result<SceneScan, SceneError> {
    let pattern = scene.effects.widen(sensor.sensor.pattern(), &sensor.sensor);
    let pattern = pattern.map_err(ScanError::Request)?;
    // Scans of other times have other noise, other drops and other losses.
    let at = if sensor.start_s == 0.0 { String::new() } else { format!("@{}", sensor.start_s) };
    let stream = |name: &str| StreamKey::new(scene.seed, &format!("{name}{at}"), number);
    let placed: Vec<PlacedTarget> = objects
        .iter()
        .zip(&scene.objects)
        .map(|(placed, object)| {
            let mut target = PlacedTarget::new(&placed.target);
            target.world_from_object = placed.world_from_object;
            target.motion = object.motion.clone();
            target.reflectivity = object.reflectivity as f32;
            target.retroreflection = object.retroreflection;
            target.materials = placed.materials.as_ref();
            target.stream = Some(stream(&object.name));
            target
        })
        .collect();
    let mut request = ScanRequest::new(&sensor.sensor, &pattern, sensor.pose);
    (request.motion, request.start_s) = (sensor.motion.clone(), sensor.start_s);
    request.deskew = sensor.deskew;
    request.attributes = scene.attributes.clone();
    request.stream = stream(&sensor.name);
    request.culling = culling;
    let Scanned { scan, tally, cast_on_cpu, .. } = scan_objects(caster, &placed, &request)?;
    let simplified = objects.iter().map(|placed| placed.simplified).collect();
    let sensor = sensor.name.clone();
    Ok(SceneScan { sensor, scan, tally, too_large_for_adapter: cast_on_cpu, simplified })
}
