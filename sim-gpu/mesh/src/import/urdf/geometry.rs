//! The shapes and meshes of links.

use std::collections::HashMap;
use std::env;
use std::path::{Path, PathBuf};

use glam::{DAffine3, DVec3};
use roxmltree::Node;

use super::element::{attribute, fault, lengths, numbers, origin, radius, required};
use crate::import::shapes;
use crate::{AssembledMesh, Assembly, ParseError, Part, load};

/// The parts of links.
#[derive(Default)]
pub struct Builder<'a> {
    path: Option<&'a Path>,
    pub assembly: Assembly,
    /// The numbers of the meshes of files, and of shapes by their description.
    numbers: HashMap<String, usize>,
}

impl<'a> Builder<'a> {
    /// Of the robot at `path`, if it is in a file.
    pub fn of(path: Option<&'a Path>) -> Self {
        Self { path, ..Self::default() }
    }

    pub fn add_link(
        &mut self,
        link: Node<'_, '_>,
        name: &str,
        collision: bool,
        world_from_link: DAffine3,
    ) -> Result<(), ParseError> {
        let kind = if collision { "collision" } else { "visual" };
        let shapes: Vec<_> = link.children().filter(|node| node.has_tag_name(kind)).collect();
        for (i, shape) in shapes.iter().enumerate() {
            let shape = *shape;
            let geometry = required(shape, "geometry")?;
            let found = geometry.children().find(Node::is_element);
            let found = found.ok_or_else(|| {
                fault(geometry, "expected a shape in geometry, found none".to_owned())
            })?;
            let (mesh, scale) = self.geometry(found)?;
            let world_from_mesh = world_from_link * origin(shape)? * DAffine3::from_scale(scale);
            if !world_from_mesh.is_finite() {
                return Err(fault(shape, "expected a finite place, found another".to_owned()));
            }
            let own = shape.attribute("name").map_or_else(|| (i + 1).to_string(), str::to_owned);
            self.assembly.parts.push(Part {
                mesh,
                name: if shapes.len() == 1 { name.to_owned() } else { format!("{name}/{own}") },
                label: Some(name.to_owned()),
                world_from_mesh,
            });
        }
        Ok(())
    }

    /// The number of a shape's mesh, and the factors that make the shape of it.
    fn geometry(&mut self, shape: Node<'_, '_>) -> Result<(usize, DVec3), ParseError> {
        let kind = shape.tag_name().name();
        let (key, scale, make): (_, _, Box<dyn Fn() -> _>) = match kind {
            "box" => (String::new(), lengths::<3>(shape, "size")?, Box::new(shapes::cube)),
            "sphere" => {
                let r = radius(shape)?;
                (format!("{kind} {r}"), [1.0; 3], Box::new(move || shapes::capsule(r, 0.0)))
            }
            "cylinder" | "capsule" => {
                let (r, [length]) = (radius(shape)?, lengths(shape, "length")?);
                let make = if kind == "capsule" { shapes::capsule } else { shapes::cylinder };
                (format!("{kind} {r} {length}"), [1.0; 3], Box::new(move || make(r, length)))
            }
            "mesh" => return self.mesh(shape),
            found => {
                let known = "box, cylinder, sphere, capsule or mesh";
                return Err(fault(shape, format!("expected {known}, found {found}")));
            }
        };
        let number = *self.numbers.entry(key).or_insert_with(|| {
            self.assembly.meshes.push(AssembledMesh { mesh: make(), ..AssembledMesh::default() });
            self.assembly.meshes.len() - 1
        });
        Ok((number, DVec3::from_array(scale)))
    }

    /// The number of a file's mesh, in the axes of the file, and its scale.
    fn mesh(&mut self, shape: Node<'_, '_>) -> Result<(usize, DVec3), ParseError> {
        let name = attribute(shape, "filename")?;
        let scale = numbers(shape, "scale")?.unwrap_or([1.0; 3]);
        let wrong = |cause: String| fault(shape, format!("mesh {name:?}: {cause}"));
        if Path::new(name).extension().is_some_and(|it| it.eq_ignore_ascii_case("dae")) {
            let cause = "expected .stl, .obj, .glb or another mesh, found Collada: convert it to one of them";
            return Err(wrong(cause.to_owned()));
        }
        let file = self.path.ok_or_else(|| wrong("expected a shape, found a file".to_owned()))?;
        let file = located(name, file).map_err(wrong)?;
        let key = file.display().to_string();
        if let Some(number) = self.numbers.get(&key) {
            return Ok((*number, scale.into()));
        }
        let loaded = load(&file).map_err(|error| wrong(error.to_string()))?;
        let warnings = loaded.warnings.into_iter().map(|warning| warning.of(name));
        self.assembly.warnings.extend(warnings);
        self.assembly.meshes.push(AssembledMesh { mesh: loaded.mesh, ..AssembledMesh::default() });
        self.numbers.insert(key, self.assembly.meshes.len() - 1);
        Ok((self.assembly.meshes.len() - 1, scale.into()))
    }
}

/// The file of a mesh of the robot at `robot`. A package is a folder of its name around the robot's file, or
/// where ROS looks for packages.
fn located(name: &str, robot: &Path) -> Result<PathBuf, String> {
    let folder = robot.parent().unwrap_or(Path::new(""));
    let Some((package, rest)) =
        name.strip_prefix("package://").map(|it| it.split_once('/').unwrap_or((it, "")))
    else {
        return match name.split_once("://") {
            Some(("file", path)) => Ok(path.into()),
            Some((scheme, _)) => {
                Err(format!("expected a path, package:// or file://, found {scheme}://"))
            }
            None => Ok(folder.join(name)),
        };
    };
    let absolute = std::path::absolute(robot).map_err(|error| error.to_string())?;
    let listed = |variable: &str| {
        let folders = env::var_os(variable).unwrap_or_default();
        env::split_paths(&folders).collect::<Vec<_>>()
    };
    let around = absolute.ancestors().skip(1).map(Path::to_path_buf);
    let ros_2 = listed("AMENT_PREFIX_PATH").into_iter().map(|prefix| prefix.join("share"));
    let around = around.chain(listed("ROS_PACKAGE_PATH")).chain(ros_2);
    let mut folders = around.flat_map(|folder| {
        let own = (folder.file_name() == Some(package.as_ref())).then(|| folder.clone());
        own.into_iter().chain([folder.join(package)])
    });
    let found = folders.find(|folder| folder.is_dir());
    let missing = || {
        let folder = absolute.parent().unwrap_or(folder).display();
        format!("expected a folder {package} around {folder} or in ROS_PACKAGE_PATH, found none")
    };
    Ok(found.ok_or_else(missing)?.join(rest))
}
