use std::ffi::c_char;
use std::mem::MaybeUninit;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};

use sim_gpu::errors::InvalidValue;
use sim_gpu::{Effects, InstanceId, NO_OBJECT, Scene};
use sim_gpu::{scene_files::check_object, settings};

use super::mesh::EdgepuckMesh;
use super::pose::EdgepuckPose;
use crate::pointers;
use crate::status::{EdgepuckStatus, Failure, guard_status};

/// Instances of meshes in the world. To change an instance rebuilds nothing.
pub struct EdgepuckScene {
    pub(crate) scene: Scene,
    /// The label of each instance.
    pub(crate) labels: Vec<u32>,
    id: u32,
}

/// The handle of an instance of a scene.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct EdgepuckInstance {
    /// The scene: each of a process has another number.
    pub scene: u32,
    /// Its number in the scene, from 0, which is the object of its points and ranges.
    pub number: u32,
}

impl EdgepuckScene {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let id = NEXT.fetch_add(1, Ordering::Relaxed);
        Self { scene: Scene::new(), labels: Vec::new(), id }
    }

    /// The Rust library's handle.
    pub(crate) fn find(&self, instance: EdgepuckInstance) -> Result<InstanceId, Failure> {
        let EdgepuckInstance { scene, number } = instance;
        let found = self.scene.id(number);
        found.filter(|_| scene == self.id).ok_or_else(|| {
            let (n, own) = (self.labels.len(), self.id);
            let message = format!(
                "expected one of {n} instances of scene {own}, found number {number} of scene {scene}"
            );
            Failure::new(EdgepuckStatus::BadInstance, message)
        })
    }
}

/// Makes an empty scene, and writes it to out. Pass it to edgepuck_scene_free in the end.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_scene_new(
    out: Option<&mut MaybeUninit<Option<Box<EdgepuckScene>>>>,
) -> EdgepuckStatus {
    pointers::make(out, || Ok(EdgepuckScene::new()))
}

/// Adds an instance of a mesh at a pose, and writes its handle to out if it succeeds.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_scene_add(
    scene: Option<&mut EdgepuckScene>,
    mesh: Option<&EdgepuckMesh>,
    pose: Option<&EdgepuckPose>,
    out: Option<&mut MaybeUninit<EdgepuckInstance>>,
) -> EdgepuckStatus {
    guard_status(|| {
        let (out, scene) = (pointers::need(out, "out")?, pointers::need(scene, "scene")?);
        let (mesh, pose) = (pointers::need(mesh, "mesh")?, pointers::need(pose, "pose")?);
        let id = scene.scene.add(&mesh.mesh, pose.read("pose")?);
        scene.labels.push(NO_OBJECT);
        out.write(EdgepuckInstance { scene: scene.id, number: id.number() });
        Ok(())
    })
}

/// Moves an instance.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_scene_move(
    scene: Option<&mut EdgepuckScene>,
    instance: EdgepuckInstance,
    pose: Option<&EdgepuckPose>,
) -> EdgepuckStatus {
    guard_status(|| {
        let scene = pointers::need(scene, "scene")?;
        let id = scene.find(instance)?;
        scene.scene[id].pose = pointers::need(pose, "pose")?.read("pose")?;
        Ok(())
    })
}

/// Gives an instance factors along the axes of its mesh, all above 0; the part of the light that comes
/// back at vertical incidence, 0 to 1; and the number of its class, which its points have as label. All
/// are 1 at first, except the label: UINT32_MAX, for none.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_scene_set(
    scene: Option<&mut EdgepuckScene>,
    instance: EdgepuckInstance,
    scale_x: f64,
    scale_y: f64,
    scale_z: f64,
    reflectivity: f64,
    label: u32,
) -> EdgepuckStatus {
    guard_status(|| {
        let (scene, scale) = (pointers::need(scene, "scene")?, [scale_x, scale_y, scale_z]);
        let id = scene.find(instance)?;
        let check = check_object(str::to_owned, scale, reflectivity, 0.0);
        check.map_err(Failure::of(EdgepuckStatus::BadValue))?;
        (scene.scene[id].scale, scene.scene[id].reflectivity) = (scale.into(), reflectivity);
        scene.labels[id.number() as usize] = label;
        Ok(())
    })
}

/// Applies effects to all scans and casts, in place of those before: noise, dropout, wide beams, rain and
/// others. toml has the keys of the table "effects" of a scene's TOML file, such as
/// "noise = { sigma_m = 0.01 }\nreturns = \"dual\""; an empty text has none.
///
/// # Safety
///
/// toml is null or a NUL-terminated string.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn edgepuck_scene_set_effects(
    scene: Option<&mut EdgepuckScene>,
    toml: *const c_char,
) -> EdgepuckStatus {
    guard_status(|| {
        // SAFETY: null or NUL-terminated, as required above.
        let (scene, toml) =
            (pointers::need(scene, "scene")?, unsafe { pointers::text(toml, "toml") }?);
        let effects = settings::parse(&toml, Path::new("effects"), Ok::<Effects, InvalidValue>);
        scene.scene.effects = effects.map_err(Failure::of(EdgepuckStatus::BadEffects))?;
        Ok(())
    })
}

/// Frees a scene; null has no effect.
#[unsafe(no_mangle)]
pub extern "C" fn edgepuck_scene_free(scene: Option<Box<EdgepuckScene>>) {
    pointers::free(scene);
}
