//! From the parts of a file to instances.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DAffine3, DVec3};

use super::{Error, Instance, InstanceId, Mesh, Scene};
use crate::config::{InvalidValue, within};
use crate::import::{Format, Import};
use crate::material::Materials;
use crate::mesh::frame::{Up, z_up};
use crate::mesh::{AssembledMesh, Assembly, BaseColour};
use crate::pose::Pose;

impl Scene {
    /// Adds what stands in a glTF file (`.glb`, `.gltf`) or a robot (`.urdf`) where the file has it: each
    /// node, or geometry of a link, is an instance with its name; its label is the name of the mesh, or
    /// of the link. Instances of one mesh share it. Animated nodes have trajectories.
    ///
    /// Poses and animations are those of the file, turned z up: trajectories are within 0.1 mm and
    /// 0.0001 radians of them, and exact where only one node above a mesh moves, in lines or steps. A node
    /// that mirrors or shears its mesh has a mesh of its own.
    ///
    /// # Errors
    /// The file cannot be read: with the node, accessor, link or joint; `import` does not fit it.
    pub fn add_file(
        &mut self,
        path: impl AsRef<Path>,
        import: &Import,
    ) -> Result<Vec<InstanceId>, Error> {
        self.add_file_at(path.as_ref(), import, None, DAffine3::IDENTITY)
    }

    /// As [`Scene::add_file`], of a file whose upward axis may be another, at a place that may scale it.
    #[doc(hidden)]
    pub fn add_file_at(
        &mut self,
        path: &Path,
        import: &Import,
        up: Option<Up>,
        world_from_upright: DAffine3,
    ) -> Result<Vec<InstanceId>, Error> {
        let format = Format::from_path(path).ok_or_else(|| {
            let found = path.display();
            InvalidValue::new("file", format!("expected .glb, .gltf or .urdf, found {found}"))
        })?;
        format.check(import)?;
        let up = up.unwrap_or(format.default_up());
        let upright_from_file = upright_from_file(up);
        let Assembly { meshes, parts, colours, mut warnings } =
            format.load(path, import, world_from_upright * upright_from_file)?;
        let mut images = colours.iter().filter(|colour| import.base_colours && colour.has_image);
        warnings.extend(images.next().map(|colour| {
            format!("material {:?}: its image is left out of base colours", colour.name)
        }));
        let of_material = |colour: &BaseColour| {
            let key = format!("material {:?}: luminance", colour.name);
            within(&key, colour.luminance, 0.0..=1.0).map(|()| colour.luminance)
        };
        let colours = if import.base_colours { colours } else { vec![] };
        let reflectivities = colours.iter().map(of_material).collect::<Result<Vec<_>, _>>()?;
        let looks: Vec<_> = meshes.iter().map(|mesh| look(mesh, &reflectivities)).collect();
        let mut shared = vec![None::<Mesh>; meshes.len()];
        let mut names = Names::of(self);
        let mut ids = Vec::new();
        for part in parts {
            let upright = |by: &DAffine3| Mesh::try_from(meshes[part.mesh].mesh.moved(by));
            let of_upright = part.world_from_mesh * upright_from_file.inverse();
            let (mesh, pose, scale) = match (Pose::of_scaled(&of_upright), &shared[part.mesh]) {
                (Some((pose, scale)), Some(mesh)) => (mesh.clone(), pose, scale),
                (Some((pose, scale)), None) => {
                    let mesh = upright(&upright_from_file)?;
                    let mesh = mesh.with_warnings(path, &std::mem::take(&mut warnings));
                    shared[part.mesh] = Some(mesh.clone());
                    (mesh, pose, scale)
                }
                (None, _) => {
                    let mesh = upright(&part.world_from_mesh)?;
                    let mesh = mesh.with_warnings(path, &std::mem::take(&mut warnings));
                    (mesh, Pose::IDENTITY, DVec3::ONE)
                }
            };
            let id = self.add(mesh, pose);
            let (reflectivity, materials) = looks[part.mesh].clone();
            self[id] = Instance {
                scale,
                motion: part.motion,
                name: Some(names.free(part.name)),
                label: part.label,
                reflectivity,
                materials,
                ..self[id].clone()
            };
            ids.push(id);
        }
        Ok(ids)
    }
}

/// From the axes of a file to those of the world.
fn upright_from_file(up: Up) -> DAffine3 {
    let [x, y, z] = DVec3::AXES.map(|axis| z_up(axis, up));
    DAffine3::from_cols(x, y, z, DVec3::ZERO)
}

/// The reflectivity of `mesh`, or those of its faces if they differ; faces without a material have 1.
fn look(mesh: &AssembledMesh, reflectivities: &[f64]) -> (f64, Option<Arc<Materials>>) {
    let of =
        |number: Option<usize>| number.and_then(|i| reflectivities.get(i)).copied().unwrap_or(1.0);
    let runs: Vec<_> = mesh.colours.iter().map(|(number, n)| (of(*number), *n)).collect();
    match &runs[..] {
        [] => (1.0, None),
        [(first, _), others @ ..] if others.iter().all(|(other, _)| other == first) => {
            (*first, None)
        }
        runs => (1.0, Some(Arc::new(Materials::of_runs(runs)))),
    }
}

/// The names of a scene's instances, which key their random numbers.
struct Names(HashMap<String, usize>);

impl Names {
    fn of(scene: &Scene) -> Self {
        let names = scene.instances().iter().filter_map(|instance| instance.name.clone());
        Self(names.map(|name| (name, 1)).collect())
    }

    /// `name`, with a number if there is another one.
    fn free(&mut self, name: String) -> String {
        let mut free = name.clone();
        while self.0.contains_key(&free) {
            let n = self.0.entry(name.clone()).or_insert(1);
            *n += 1;
            free = format!("{name} ({n})");
        }
        self.0.insert(free.clone(), 1);
        free
    }
}
