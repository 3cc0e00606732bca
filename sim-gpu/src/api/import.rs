//! From the parts of a file to instances.

use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

use formats::plausible::Warning;
use glam::{DAffine3, DVec3};

use super::{Error, Instance, InstanceId, Mesh, Scene};
use crate::config::{InvalidValue, within};
use crate::pose::Pose;
use edgepuck_mesh::frame::{Up, z_up};
use edgepuck_mesh::import::{Format, Import};
use edgepuck_mesh::material::Materials;
use edgepuck_mesh::{AssembledMesh, Assembly, BaseColour};

/// Where a file's instances stand, and what they are called.
#[doc(hidden)]
#[derive(Clone, Debug, Default)]
pub struct FilePlace {
    /// The axis of the file that points up, if it is not the format's.
    pub up: Option<Up>,
    /// From the file, z up, to the world; it may scale.
    pub world_from_upright: DAffine3,
    /// What the names of instances begin with.
    pub prefix: String,
}

impl Scene {
    /// Adds what stands in a glTF file (`.glb`, `.gltf`) or a robot (`.urdf`) where the file has it: each
    /// node, or geometry of a link, is an instance with its name; its label is the name of the mesh, or
    /// of the link. Instances of one mesh share it. Animations are not applied.
    ///
    /// Poses are those of the file, turned z up. A node that mirrors or shears its mesh has a mesh of
    /// its own, turned as the file has it: its pose is its place.
    ///
    /// # Errors
    /// The file cannot be read: with the node, accessor, link or joint; `import` does not fit it.
    pub fn add_file(
        &mut self,
        path: impl AsRef<Path>,
        import: &Import,
    ) -> Result<Vec<InstanceId>, Error> {
        self.add_file_at(path.as_ref(), import, &FilePlace::default())
    }

    /// As [`Scene::add_file`], at a place.
    #[doc(hidden)]
    pub fn add_file_at(
        &mut self,
        path: &Path,
        import: &Import,
        place: &FilePlace,
    ) -> Result<Vec<InstanceId>, Error> {
        let format = Format::from_path(path).ok_or_else(|| {
            let found = path.display();
            InvalidValue::new("file", format!("expected .glb, .gltf or .urdf, found {found}"))
        })?;
        if let Some((name, of)) = format.foreign_setting(import) {
            return Err(InvalidValue::new(name, format!("expected it only for {of}")).into());
        }
        let upright_from_file = upright_from_file(place.up.unwrap_or(format.default_up()));
        let Assembly { meshes, parts, colours, mut warnings } =
            format.load(path, import, place.world_from_upright * upright_from_file)?;
        let looks = match import.base_colours {
            true => looks(&meshes, &colours, &mut warnings)?,
            false => vec![(1.0, None); meshes.len()],
        };
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
                    let mesh = mesh.with_warnings(path, std::mem::take(&mut warnings));
                    shared[part.mesh] = Some(mesh.clone());
                    (mesh, pose, scale)
                }
                (None, _) => {
                    let turned = DAffine3::from_mat3(part.world_from_mesh.matrix3);
                    let mesh = upright(&turned)?;
                    let mesh = mesh.with_warnings(path, std::mem::take(&mut warnings));
                    (mesh, Pose::at(of_upright.translation.to_array()), DVec3::ONE)
                }
            };
            let id = self.add(mesh, pose);
            let (reflectivity, materials) = looks[part.mesh].clone();
            self[id] = Instance {
                scale,
                name: Some(names.free(place.prefix.clone() + &part.name)),
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

/// A reflectivity, or the materials of faces.
type Look = (f64, Option<Arc<Materials>>);

/// The reflectivities of `meshes` by their base colours, or of their faces if those differ; faces without
/// a material have 1.
fn looks(
    meshes: &[AssembledMesh],
    colours: &[BaseColour],
    warnings: &mut Vec<Warning>,
) -> Result<Vec<Look>, InvalidValue> {
    for BaseColour { name, luminance, has_image } in colours {
        within(&format!("material {name:?}: luminance"), *luminance, 0.0..=1.0)?;
        warnings.extend(has_image.then(|| Warning::ImageOfMaterial(name.clone())));
    }
    let look = |mesh: &AssembledMesh| match &mesh.colours[..] {
        [] => (1.0, None),
        [(first, _), others @ ..] if others.iter().all(|it| it.0 == *first) => (*first, None),
        runs => (1.0, Some(Arc::new(Materials::of_runs(runs)))),
    };
    Ok(meshes.iter().map(look).collect())
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

#[cfg(test)]
mod tests {
    use super::*;
    use base64::Engine;
    use base64::engine::general_purpose::STANDARD;
    use std::fs;

    /// Nodes over one triangle with two corners at x and y = 1, in two materials.
    fn gltf(nodes: &str) -> String {
        let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let bytes: Vec<u8> = corners.iter().flat_map(|x| x.to_le_bytes()).collect();
        // The colours of the second are the positions of its corners.
        let primitive = |material, colour| {
            format!(r#"{{"attributes": {{"POSITION": 0{colour}}}, "material": {material}}}"#)
        };
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0, 1, 2]}}], "nodes": [{nodes}],
            "meshes": [{{"name": "tile", "primitives": [{}, {}]}}, {{"primitives": [{}]}}],
            "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [1, 0, 0.5, 1]}}}}, {{"extensions": {{
                "KHR_materials_pbrSpecularGlossiness": {{"diffuseFactor": [0.5, 0.5, 0.5, 1]}}}}}}],
            "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 0]}}],
            "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
            "buffers": [{{"byteLength": 36, "uri": "data:;base64,{}"}}]}}"#,
            primitive(0, ""),
            primitive(1, r#", "COLOR_0": 0"#),
            primitive(0, ""),
            STANDARD.encode(bytes)
        )
    }

    const NODES: &str = r#"{"name": "a", "mesh": 0, "translation": [1, 2, 3], "scale": [1, 2, 3]},
        {"name": "a", "mesh": 0}, {"mesh": 1, "scale": [-1, 1, 1], "translation": [0, 5, 0]}"#;

    #[test]
    fn nodes_become_instances_with_z_up() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("tiles.gltf");
        fs::write(&file, gltf(NODES)).unwrap();
        let scene = Scene::read(&file).unwrap();
        let [a, b, c] = scene.instances() else { panic!("expected three instances") };
        let names = [a, b, c].map(|instance| instance.name.as_deref().unwrap());
        assert_eq!(names, ["a", "a (2)", "nodes[2]"]);
        assert_eq!([&a.label, &c.label], [&Some("tile".to_owned()), &None]);
        // (x, y, z) becomes (x, -z, y), of places and of factors.
        assert_eq!(a.pose, Pose::at([1.0, -3.0, 2.0]));
        assert_eq!(a.scale, DVec3::new(1.0, 3.0, 2.0));
        assert_eq!(a.mesh.vertices()[2], DVec3::Z);
        assert!(std::ptr::eq(a.mesh.vertices(), b.mesh.vertices()));
        assert_eq!(c.mesh.vertices()[1], DVec3::new(-1.0, 0.0, 0.0));
        assert_eq!(c.pose, Pose::at([0.0, 0.0, 5.0]));
        assert_eq!((a.reflectivity, a.materials.is_none()), (1.0, true));

        let mut scene = Scene::new();
        let import = Import { base_colours: true, ..Import::default() };
        let ids = scene.add_file(&file, &import).unwrap();
        let materials = scene[ids[0]].materials.as_ref().unwrap();
        // 0.2126 + 0.0722 / 2, by the weights of BT.709; half of (0.2126 + 0.7152) / 3.
        let found = [0, 1].map(|triangle| materials.of_triangle(triangle).reflectivity);
        assert_eq!(found.map(|x| (1e9 * x).round()), [248_700_000.0, 154_633_333.0]);
        assert!((scene[ids[2]].reflectivity - 0.2487).abs() < 1e-9);
    }

    #[test]
    fn poses_of_another_unit_or_order_are_warnings() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text| fs::write(folder.path().join(name), text).unwrap();
        write("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
        // Half a metre in millimetres within 0.1 s, of an object upside down; no rotation as w x y z.
        write("a.tum", "0 0 0 0 1 0 0 0\n0.1 500 0 0 1 0 0 0\n");
        write("b.tum", "0 0 0 1 1 0 0 0\n0.1 0 0 1 1 0 0 0\n");
        let text = "[[object]]\nmesh = \"a.off\"\ntrajectory = \"a.tum\"\n\
                    [[sensor]]\nprofile = \"vlp16\"\ntrajectory = \"b.tum\"\n";
        write("scene.toml", text);
        let scene = Scene::read(folder.path().join("scene.toml")).unwrap();
        let found: Vec<String> = scene.warnings().iter().map(ToString::to_string).collect();
        let [speed, head] = &found[..] else { panic!("{found:?}") };
        assert!(speed.starts_with("object \"a\" moves at 5000 m/s at 0 s: "), "{speed}");
        assert!(head.starts_with("sensor \"vlp16\" stands on its head: "), "{head}");
    }

    #[test]
    fn a_scene_s_file_places_files_and_gives_them_a_label() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("tiles.gltf"), gltf(NODES)).unwrap();
        let robot = "<robot><link name=\"l\"/><joint name=\"j\" type=\"prismatic\"><parent link=\"l\"/><child link=\"m\"/></joint><link name=\"m\"><visual><geometry><box size=\"1 1 1\"/></geometry></visual></link></robot>";
        fs::write(folder.path().join("robot.urdf"), robot).unwrap();
        let file = folder.path().join("scene.toml");
        let text = "[[object]]\nscene = \"tiles.gltf\"\nname = \"floor\"\nlabel = \"ground\"\nposition_m = [10, 0, 0]\n\
                    yaw_deg = 90\nreflectivity = 0.25\n[[object]]\nscene = \"robot.urdf\"\njoints = { j = 2 }\n\
                    [[sensor]]\nprofile = \"vlp16\"\nposition_m = [0, 0, 1]\nyaw_deg = 0\n";
        fs::write(&file, text).unwrap();
        let scene = Scene::read(&file).unwrap();
        let [a, _, _, hand] = scene.instances() else { panic!("expected four instances") };
        assert_eq!(a.name.as_deref(), Some("floor/a"));
        assert_eq!((a.label.as_deref(), a.reflectivity), (Some("ground"), 0.25));
        assert!(a.pose.position_m.distance(DVec3::new(13.0, 1.0, 2.0)) < 1e-12);
        assert_eq!((hand.name.as_deref(), hand.label.as_deref()), (Some("robot/m"), Some("m")));
        assert_eq!(hand.pose.position_m, DVec3::new(2.0, 0.0, 0.0));
    }
}
