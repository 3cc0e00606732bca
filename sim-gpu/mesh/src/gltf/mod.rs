//! glTF 2.0, through the crate gltf: the meshes of a scene's nodes, where their transforms put them.
//!
//! The crate reads and checks the JSON. The format is in metres with y up; its numbers are f32.

mod buffers;
#[cfg(test)]
mod tests;

use std::path::Path;

use formats::plausible::Warning;
use glam::{DAffine3, DVec3, Quat, Vec3};
use gltf::accessor::Dimensions;
use gltf::mesh::Mode;
use gltf::scene::Transform;
use gltf::{Document, Gltf, Node, Primitive};

use super::assembly::{AssembledMesh, Assembly, BaseColour, Part};
use super::error::{Malformed, ParseError};
use super::triangle_mesh::{Parsed, TriangleMesh};
use buffers::{Buffers, MOST_ELEMENTS, is_index};

/// The beginnings of the names of extensions that a file may require: they are read, or change no
/// triangle's place.
const ALLOWED: [&str; 8] = [
    "KHR_mesh_quantization",
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_",
    "EXT_lights_",
    "KHR_xmp",
];
/// The colours of vertices.
const COLOUR: gltf::Semantic = gltf::Semantic::Colors(0);
/// Without it, the file has one of many instances, even where it is not required.
const INSTANCING: &str = "EXT_mesh_gpu_instancing";

/// All nodes as one mesh. Buffers in other files are in `folder`.
pub(super) fn parse(bytes: &[u8], folder: Option<&Path>) -> Result<Parsed, ParseError> {
    let assembly = assemble(bytes, folder, DAffine3::IDENTITY)?;
    let too_many =
        || wrong(format!("expected at most {MOST_ELEMENTS} vertices of all nodes, found more"));
    assembly.flattened(MOST_ELEMENTS).ok_or_else(too_many)
}

/// The nodes; `world_from_file` stands above the roots.
pub(super) fn assemble(
    bytes: &[u8],
    folder: Option<&Path>,
    world_from_file: DAffine3,
) -> Result<Assembly, ParseError> {
    read(bytes, folder, world_from_file).map_err(wrong)
}

fn wrong(cause: String) -> ParseError {
    Malformed::Syntax(cause).into()
}

fn read(
    bytes: &[u8],
    folder: Option<&Path>,
    world_from_file: DAffine3,
) -> Result<Assembly, String> {
    let file = opened(bytes)?;
    let scene = file.default_scene().or_else(|| file.scenes().next());
    let scene = scene.ok_or("expected a scene, found none")?;
    let mut reader = Reader {
        buffers: Buffers::of(&file, folder)?,
        assembly: Assembly::default(),
        world_from_file,
        numbers: vec![None; file.meshes().len()],
        warnings: Warnings::default(),
    };
    if !file.as_json().animations.is_empty() {
        reader.warnings.add(Warning::Animations);
    }
    reader.assembly.colours = file.materials().map(|material| colour(&material)).collect();
    let mut is_seen = vec![false; file.nodes().len()];
    let mut open: Vec<_> = scene.nodes().map(|node| (node, world_from_file)).collect();
    open.reverse();
    while let Some((node, parent)) = open.pop() {
        if std::mem::replace(&mut is_seen[node.index()], true) {
            return Err(format!("nodes[{}]: expected one parent, found two", node.index()));
        }
        let own =
            place(&node, parent).map_err(|cause| format!("nodes[{}]: {cause}", node.index()))?;
        reader.add(&node, own)?;
        let first = open.len();
        open.extend(node.children().map(|child| (child, own)));
        open[first..].reverse();
    }
    if reader.assembly.parts.is_empty() && file.meshes().len() > 0 {
        let found = match reader.warnings.0.contains(&Warning::PointsAndLines) {
            true => "points or lines",
            false => "meshes that are empty or in no node of the scene",
        };
        return Err(format!("expected at least one triangle, found only {found}"));
    }
    reader.assembly.warnings = reader.warnings.0;
    Ok(reader.assembly)
}

/// The file, if all that the crate takes for granted is so.
fn opened(bytes: &[u8]) -> Result<Gltf, String> {
    check_length(bytes)?;
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes)
        .map_err(|error| format!("expected glTF 2.0: {error}"))?;
    let mut json = document.into_json();
    let is_allowed = |name: &str| ALLOWED.iter().any(|start| name.starts_with(start));
    let required = json.extensions_required.iter().filter(|name| !is_allowed(name));
    let used = json.extensions_used.iter().filter(|name| **name == INSTANCING);
    if let Some(extension) = required.chain(used).next() {
        return Err(format!("expected a file without {extension}: export it without"));
    }
    // The crate knows fewer of them.
    json.extensions_required.clear();
    let least = json.asset.min_version.take();
    if let Some(found) = least.filter(|it| !["1.0", "1.1", "2.0"].contains(&&**it)) {
        let expected = "asset.minVersion: expected at most 2.0";
        return Err(format!("{expected}, found {found}: export it as glTF 2.0"));
    }
    // Positions need no bounds to be read, but the crate asks for them.
    for accessor in &mut json.accessors {
        accessor.min.get_or_insert([0.0; 3].into());
        accessor.max.get_or_insert([0.0; 3].into());
    }
    // The crate's own checks name the place in the JSON; they take this one for granted.
    let n = json.accessors.len();
    for (i, mesh) in json.meshes.iter().enumerate() {
        let attributes = mesh.primitives.iter().flat_map(|primitive| primitive.attributes.values());
        if let Some(index) = attributes.map(|index| index.value()).find(|index| *index >= n) {
            return Err(format!("meshes[{i}]: expected one of {n} accessors, found {index}"));
        }
    }
    let document = Document::from_json(json).map_err(|error| error.to_string())?;
    Ok(Gltf { document, blob })
}

/// The crate subtracts the header from the length that the header of a binary file tells.
fn check_length(bytes: &[u8]) -> Result<(), String> {
    const HEADER: u32 = 12;
    if !bytes.starts_with(b"glTF") {
        return Ok(());
    }
    let length = bytes.get(8..).and_then(<[u8]>::first_chunk).copied();
    let (n, length) = (bytes.len(), length.map_or(HEADER, u32::from_le_bytes));
    match length {
        ..HEADER => {
            Err(format!("expected a length of {HEADER} or more in the header, found {length}"))
        }
        _ if n < length as usize => Err(format!("the file ends after {n} of {length} bytes")),
        _ => Ok(()),
    }
}

/// Each warning once.
#[derive(Default)]
struct Warnings(Vec<Warning>);

impl Warnings {
    fn add(&mut self, warning: Warning) {
        if !self.0.contains(&warning) {
            self.0.push(warning);
        }
    }
}

struct Reader<'a> {
    buffers: Buffers<'a>,
    assembly: Assembly,
    world_from_file: DAffine3,
    /// The numbers in the assembly of the file's meshes that were read.
    numbers: Vec<Option<usize>>,
    warnings: Warnings,
}

/// The map from `node` to the world; that of the node above is `parent`.
fn place(node: &Node<'_>, parent: DAffine3) -> Result<DAffine3, String> {
    match node.transform() {
        Transform::Matrix { matrix } => {
            let [x, y, z, at] = matrix.map(|[x, y, z, _]| Vec3::new(x, y, z).as_dvec3());
            Ok(parent * DAffine3::from_cols(x, y, z, at))
        }
        Transform::Decomposed { translation, rotation, scale } => {
            let rotation = Quat::from_array(rotation).as_dquat();
            let length = rotation.length();
            if !(length > 0.0 && length.is_finite()) {
                return Err(format!("expected a rotation of length 1, found length {length}"));
            }
            let at = Vec3::from_array(translation).as_dvec3();
            let own = DAffine3::from_rotation_translation(rotation.normalize(), at);
            Ok(parent * own * DAffine3::from_scale(Vec3::from_array(scale).as_dvec3()))
        }
    }
}

impl Reader<'_> {
    /// Adds the mesh of a node.
    fn add(&mut self, node: &Node<'_>, mut world_from_mesh: DAffine3) -> Result<(), String> {
        let Some(mesh) = node.mesh() else { return Ok(()) };
        if node.skin().is_some() {
            self.warnings.add(Warning::Skin);
            // Joints alone place a skin (glTF 2.0, 3.7.3.3).
            world_from_mesh = self.world_from_file;
        }
        if mesh.primitives().any(|primitive| primitive.morph_targets().len() > 0) {
            self.warnings.add(Warning::MorphTargets);
        }
        let number = match self.numbers[mesh.index()] {
            Some(number) => number,
            None => {
                let mut read = AssembledMesh::default();
                for primitive in mesh.primitives() {
                    self.add_primitive(&primitive, &mut read).map_err(|cause| {
                        let (mesh, primitive) = (mesh.index(), primitive.index());
                        format!("meshes[{mesh}].primitives[{primitive}]: {cause}")
                    })?;
                }
                read.mesh.settle_unused();
                let checked = read.mesh.check_finite();
                checked.map_err(|cause| format!("meshes[{}]: {cause}", mesh.index()))?;
                self.assembly.meshes.push(read);
                self.assembly.meshes.len() - 1
            }
        };
        self.numbers[mesh.index()] = Some(number);
        if self.assembly.meshes[number].mesh.triangles.is_empty() {
            return Ok(());
        }
        let place = format!("nodes[{}]", node.index());
        if !world_from_mesh.is_finite() {
            return Err(format!("{place}: expected a finite transform, found another"));
        }
        self.assembly.parts.push(Part {
            mesh: number,
            name: node.name().map_or(place, str::to_owned),
            label: mesh.name().map(str::to_owned),
            world_from_mesh,
        });
        Ok(())
    }

    fn add_primitive(
        &mut self,
        primitive: &Primitive<'_>,
        to: &mut AssembledMesh,
    ) -> Result<(), String> {
        let mode = primitive.mode();
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.warnings.add(Warning::PointsAndLines);
            return Ok(());
        }
        let positions = primitive.get(&gltf::Semantic::Positions);
        let positions = positions.ok_or("expected the attribute POSITION, found none")?;
        let TriangleMesh { vertices, triangles } = &mut to.mesh;
        let first = vertices.len();
        self.buffers.each(&positions, Dimensions::Vec3, |at| {
            vertices.push(DVec3::new(at[0], at[1], at[2]));
        })?;
        let n = vertices.len() - first;
        let indices = self.indices(primitive, n)?;
        let colours = self.vertex_colours(primitive, n)?;
        let mut face = |corners: [u32; 3]| {
            triangles.push(corners.map(|corner| first as u32 + corner));
            let [a, b, c] = corners.map(|corner| luminance(colours[corner as usize]));
            let of_face = if a == b && b == c { a } else { (a + b + c) / 3.0 };
            match to.colours.last_mut() {
                Some((last, n)) if *last == of_face => *n += 1,
                _ => to.colours.push((of_face, 1)),
            }
        };
        match mode {
            // Every other triangle of a strip runs the other way round (glTF 2.0, 3.7.2.1).
            Mode::TriangleStrip => indices.windows(3).enumerate().for_each(|(i, w)| {
                face(if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] });
            }),
            Mode::TriangleFan => {
                indices.windows(2).skip(1).for_each(|w| face([indices[0], w[0], w[1]]));
            }
            _ => indices.as_chunks::<3>().0.iter().for_each(|corners| face(*corners)),
        }
        Ok(())
    }

    /// The indices of the corners of a primitive with `n` vertices.
    fn indices(&self, primitive: &Primitive<'_>, n: usize) -> Result<Vec<u32>, String> {
        let Some(accessor) = primitive.indices() else { return Ok((0..n as u32).collect()) };
        if !is_index(accessor.data_type()) || accessor.normalized() {
            return Err("expected indices of whole numbers without sign, found others".to_owned());
        }
        let mut indices = Vec::new();
        self.buffers
            .each(&accessor, Dimensions::Scalar, |number| indices.push(number[0] as u32))?;
        match indices.iter().find(|index| **index as usize >= n) {
            Some(outside) => Err(format!("expected indices of {n} vertices, found {outside}")),
            None => Ok(indices),
        }
    }

    /// The base colours of `n` vertices.
    fn vertex_colours(&self, primitive: &Primitive<'_>, n: usize) -> Result<Vec<[f64; 3]>, String> {
        let base = base_colour(&primitive.material()).0;
        let Some(accessor) = primitive.get(&COLOUR) else { return Ok(vec![base; n]) };
        let mut colours = Vec::new();
        self.buffers.each(&accessor, accessor.dimensions(), |rgb| {
            colours.push([0, 1, 2].map(|i| base[i] * rgb[i].clamp(0.0, 1.0)));
        })?;
        let is_sound = colours.len() == n
            && matches!(accessor.dimensions(), Dimensions::Vec3 | Dimensions::Vec4)
            && colours.as_flattened().iter().all(|part| part.is_finite());
        match is_sound {
            true => Ok(colours),
            false => Err(format!("expected {n} colours of 3 or 4 finite numbers, found others")),
        }
    }
}

fn colour(material: &gltf::Material<'_>) -> BaseColour {
    let (factor, has_image) = base_colour(material);
    let place = || format!("materials[{}]", material.index().unwrap_or_default());
    let name = material.name().map_or_else(place, str::to_owned);
    BaseColour { name, luminance: luminance(factor), has_image }
}

/// The linear factor of a material's colour, and whether an image is multiplied by it.
fn base_colour(material: &gltf::Material<'_>) -> ([f64; 3], bool) {
    let metal = material.pbr_metallic_roughness();
    let (factor, has_image) = match material.pbr_specular_glossiness() {
        Some(gloss) => (gloss.diffuse_factor(), gloss.diffuse_texture().is_some()),
        None => (metal.base_color_factor(), metal.base_color_texture().is_some()),
    };
    ([0, 1, 2].map(|i| f64::from(factor[i])), has_image)
}

/// The luminance of a linear colour by the weights of ITU-R BT.709.
fn luminance([red, green, blue]: [f64; 3]) -> f64 {
    0.2126 * red + 0.7152 * green + 0.0722 * blue
}
