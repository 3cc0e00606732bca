//! glTF 2.0, through the crate gltf: the triangles of a scene's nodes, where their transforms put them.
//!
//! The crate reads and checks the JSON. Positions and indices are read here, because its readers of
//! accessors do not check their bounds. The format is in metres with y up.

use std::borrow::Cow;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DMat4, DVec3, Mat4};
use gltf::accessor::{DataType, Dimensions};
use gltf::mesh::Mode;
use gltf::{Accessor, Document, Gltf, Node, Primitive};

use super::error::{Malformed, ParseError};
use super::file::read;
use super::triangle_mesh::Parsed;

/// Extensions that change where triangles are, and are not read.
const COMPRESSIONS: [&str; 3] =
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "EXT_mesh_gpu_instancing"];

/// The mesh of a file, whose buffers in other files are in `folder`.
pub(super) fn parse(bytes: &[u8], folder: Option<&Path>) -> Result<Parsed, ParseError> {
    let wrong = |cause: String| ParseError::from(Malformed::Syntax(cause));
    check_length(bytes).map_err(wrong)?;
    let Gltf { document, blob } = Gltf::from_slice_without_validation(bytes)
        .map_err(|error| wrong(format!("expected glTF 2.0: {error}")))?;
    let mut json = document.into_json();
    let compression = json.extensions_required.iter().find(|name| COMPRESSIONS.contains(&&***name));
    if let Some(extension) = compression {
        return Err(wrong(format!("expected a file without {extension}: export it without")));
    }
    // Others are of materials and textures.
    json.extensions_required.clear();
    // The crate's own checks name the place in the JSON; they take this one for granted.
    let n = json.accessors.len();
    for (i, mesh) in json.meshes.iter().enumerate() {
        let attributes = mesh.primitives.iter().flat_map(|primitive| primitive.attributes.values());
        if let Some(index) = attributes.map(|index| index.value()).find(|index| *index >= n) {
            return Err(wrong(format!(
                "meshes[{i}]: expected one of {n} accessors, found {index}"
            )));
        }
    }
    let document = Document::from_json(json).map_err(|error| wrong(error.to_string()))?;
    let file = Gltf { document, blob };
    let blob = file.blob.as_deref().unwrap_or_default();
    let buffers = file.buffers().map(|buffer| content(&buffer, blob, folder));
    let mut reader = Reader {
        buffers: buffers.collect::<Result<_, _>>().map_err(wrong)?,
        parsed: Parsed::default(),
        is_seen: vec![false; file.nodes().len()],
    };
    let scene = file.default_scene().or_else(|| file.scenes().next());
    let roots = scene.ok_or_else(|| wrong("expected a scene, found none".to_owned()))?;
    for node in roots.nodes() {
        reader.add(&node, DMat4::IDENTITY).map_err(wrong)?;
    }
    Ok(reader.parsed)
}

/// The crate subtracts the header from the length that the header of a binary file tells.
fn check_length(bytes: &[u8]) -> Result<(), String> {
    const HEADER: u32 = 12;
    let [b'g', b'l', b'T', b'F', _, _, _, _, length @ ..] = bytes else { return Ok(()) };
    match length.first_chunk().map(|length| u32::from_le_bytes(*length)) {
        Some(length) if length < HEADER => {
            Err(format!("expected a length of {HEADER} or more in the header, found {length}"))
        }
        _ => Ok(()),
    }
}

/// The bytes of a buffer: of the file itself, in base64, or of another file.
fn content<'a>(
    buffer: &gltf::Buffer<'_>,
    blob: &'a [u8],
    folder: Option<&Path>,
) -> Result<Cow<'a, [u8]>, String> {
    let place = format!("buffers[{}]", buffer.index());
    let found = match buffer.source() {
        gltf::buffer::Source::Bin => Cow::Borrowed(blob),
        gltf::buffer::Source::Uri(uri) => match (uri.strip_prefix("data:"), folder) {
            (Some(data), _) => {
                let text = data.split_once(";base64,").map(|(_, text)| text);
                let decoded = text.and_then(|text| STANDARD.decode(text).ok());
                let wrong = || format!("{place}: expected base64, found something else");
                Cow::Owned(decoded.ok_or_else(wrong)?)
            }
            (None, Some(folder)) => {
                let bytes = read(&folder.join(unescaped(uri)));
                Cow::Owned(bytes.map_err(|error| format!("{place}: {error}"))?)
            }
            (None, None) => {
                return Err(format!("{place}: expected its bytes, found the file {uri}"));
            }
        },
    };
    match found.len() < buffer.length() {
        true => Err(format!("{place}: expected {} bytes, found {}", buffer.length(), found.len())),
        false => Ok(found),
    }
}

/// `uri` with the bytes that `%XX` stands for (RFC 3986, 2.1).
fn unescaped(uri: &str) -> String {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let [first, others @ ..] = rest {
        let byte = (*first == b'%').then(|| others.get(..2)).flatten();
        let byte = byte.and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        bytes.push(byte.unwrap_or(*first));
        rest = if byte.is_some() { &others[2..] } else { others };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// More vertices take more than 6 GB: a few nodes may place one mesh any number of times.
const MOST_VERTICES: usize = 1 << 28;

struct Reader<'a> {
    buffers: Vec<Cow<'a, [u8]>>,
    parsed: Parsed,
    /// The nodes that a scene or a parent has named: each is part of one tree.
    is_seen: Vec<bool>,
}

impl Reader<'_> {
    /// Adds a node and those below it; `parent` is the transform of the node above.
    fn add(&mut self, root: &Node<'_>, parent: DMat4) -> Result<(), String> {
        let mut open = vec![(root.clone(), parent)];
        while let Some((node, parent)) = open.pop() {
            let place = format!("nodes[{}]", node.index());
            if std::mem::replace(&mut self.is_seen[node.index()], true) {
                return Err(format!("{place}: expected one parent, found two"));
            }
            let own = Mat4::from_cols_array_2d(&node.transform().matrix());
            let world = parent * own.as_dmat4();
            if node.skin().is_some() {
                let warning = "a skin is not applied: its mesh stands as it was bound";
                self.warn(warning.to_owned());
            }
            for primitive in node.mesh().into_iter().flat_map(|mesh| mesh.primitives()) {
                self.add_primitive(&primitive, world).map_err(|cause| {
                    let mesh = node.mesh().map_or(0, |mesh| mesh.index());
                    format!("meshes[{mesh}].primitives[{}]: {cause}", primitive.index())
                })?;
            }
            open.extend(node.children().map(|child| (child, world)));
        }
        Ok(())
    }

    fn warn(&mut self, warning: String) {
        if !self.parsed.warnings.contains(&warning) {
            self.parsed.warnings.push(warning);
        }
    }

    fn add_primitive(&mut self, primitive: &Primitive<'_>, world: DMat4) -> Result<(), String> {
        let mode = primitive.mode();
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.warn("points and lines are left out, since no beam hits them".to_owned());
            return Ok(());
        }
        let positions = primitive.get(&gltf::Semantic::Positions);
        let positions = positions.ok_or("expected the attribute POSITION, found none")?;
        let first = self.parsed.mesh.vertices.len() as u32;
        let mut vertices = Vec::new();
        self.each(&positions, Dimensions::Vec3, |at| {
            vertices.push(world.transform_point3(DVec3::new(at[0], at[1], at[2])));
        })?;
        let n = vertices.len();
        self.parsed.mesh.vertices.append(&mut vertices);
        let all = self.parsed.mesh.vertices.len();
        if all > MOST_VERTICES {
            return Err(format!(
                "expected at most {MOST_VERTICES} vertices of all nodes, found more"
            ));
        }
        let mut indices = Vec::new();
        match primitive.indices() {
            Some(accessor) if !is_index(accessor.data_type()) || accessor.normalized() => {
                return Err(
                    "expected indices of whole numbers without sign, found others".to_owned()
                );
            }
            Some(accessor) => {
                self.each(&accessor, Dimensions::Scalar, |number| indices.push(number[0] as u32))?;
            }
            None => indices.extend(0..n as u32),
        }
        if let Some(outside) = indices.iter().find(|index| **index as usize >= n) {
            return Err(format!("expected indices of {n} vertices, found {outside}"));
        }
        // Of a mirror image, the outside stays outside.
        let is_mirrored = world.determinant() < 0.0;
        let mut face = |[a, b, c]: [u32; 3]| {
            let corners = if is_mirrored { [a, c, b] } else { [a, b, c] };
            self.parsed.add_face(&corners.map(|corner| first + corner));
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

    /// Passes the numbers of each element of an accessor to `each`.
    fn each(
        &self,
        accessor: &Accessor<'_>,
        dimensions: Dimensions,
        mut each: impl FnMut(&[f64; 3]),
    ) -> Result<(), String> {
        let place = format!("accessors[{}]", accessor.index());
        if accessor.dimensions() != dimensions {
            return Err(format!(
                "{place}: expected {dimensions:?}, found {:?}",
                accessor.dimensions()
            ));
        }
        let (Some(view), None) = (accessor.view(), accessor.sparse()) else {
            return Err(format!("{place}: expected a buffer view, found sparse or no numbers"));
        };
        let kind = accessor.data_type();
        let (size, width) = (kind.size(), dimensions.multiplicity());
        let stride = view.stride().unwrap_or(size * width);
        let bytes = &self.buffers[view.buffer().index()];
        let end = view.offset().checked_add(view.length());
        let bytes = end.and_then(|end| bytes.get(view.offset()..end));
        let bytes =
            bytes.ok_or_else(|| format!("{place}: its buffer view ends after the buffer"))?;
        let n = accessor.count();
        // The last element needs no whole stride.
        let last = n.saturating_sub(1).checked_mul(stride);
        let end = last
            .and_then(|last| last.checked_add(size * width))
            .and_then(|end| end.checked_add(accessor.offset()));
        if n > 0 && end.is_none_or(|end| end > bytes.len()) {
            return Err(format!(
                "{place}: expected {n} elements, found an end of the buffer view before"
            ));
        }
        for i in 0..n {
            let element = &bytes[accessor.offset() + i * stride..];
            let mut numbers = [0.0; 3];
            for (at, number) in numbers[..width].iter_mut().enumerate() {
                *number = decode(kind, &element[at * size..], accessor.normalized());
            }
            each(&numbers);
        }
        Ok(())
    }
}

fn is_index(kind: DataType) -> bool {
    matches!(kind, DataType::U8 | DataType::U16 | DataType::U32)
}

/// A number, little-endian; a `normalized` one of whole numbers is a share of the largest
/// (glTF 2.0, 3.6.2.2).
fn decode(kind: DataType, bytes: &[u8], normalized: bool) -> f64 {
    let (number, most) = match kind {
        DataType::I8 => (f64::from(bytes[0] as i8), 127.0),
        DataType::U8 => (f64::from(bytes[0]), 255.0),
        DataType::I16 => (f64::from(i16::from_le_bytes([bytes[0], bytes[1]])), 32767.0),
        DataType::U16 => (f64::from(u16::from_le_bytes([bytes[0], bytes[1]])), 65535.0),
        DataType::U32 => {
            let [a, b, c, d, ..] = *bytes else { return 0.0 };
            (f64::from(u32::from_le_bytes([a, b, c, d])), f64::from(u32::MAX))
        }
        DataType::F32 => {
            let [a, b, c, d, ..] = *bytes else { return 0.0 };
            return f64::from(f32::from_le_bytes([a, b, c, d]));
        }
    };
    if normalized { (number / most).max(-1.0) } else { number }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A GLB file of these parts.
    fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
        let padded = |bytes: &[u8], by: u8| {
            let mut bytes = bytes.to_vec();
            bytes.resize(bytes.len().next_multiple_of(4), by);
            bytes
        };
        let (json, buffer) = (padded(json.as_bytes(), b' '), padded(buffer, 0));
        let size = (12 + 8 + json.len() + 8 + buffer.len()) as u32;
        let mut bytes = [b"glTF".as_slice(), &2u32.to_le_bytes(), &size.to_le_bytes()].concat();
        for (kind, chunk) in [(b"JSON", json), (b"BIN\0", buffer)] {
            bytes.extend((chunk.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(chunk);
        }
        bytes
    }

    /// The corners (0, 0, 0), (1, 0, 0), (0, 1, 0) and (1, 1, 0), then the indices 0, 1, 2, 3.
    fn buffer() -> Vec<u8> {
        let corners = [[0.0f32; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]];
        let mut bytes: Vec<u8> = corners.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        bytes.extend([0u16, 1, 2, 3].iter().flat_map(|index| index.to_le_bytes()));
        bytes
    }

    fn json(nodes: &str, mode: u32, n_indices: usize) -> String {
        format!(
            r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{nodes}],
            "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "mode": {mode}}}]}}],
            "accessors": [
              {{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                "min": [0, 0, 0], "max": [1, 1, 0]}},
              {{"bufferView": 1, "componentType": 5123, "count": {n_indices}, "type": "SCALAR"}}],
            "bufferViews": [{{"buffer": 0, "byteOffset": 0, "byteLength": 48}},
                            {{"buffer": 0, "byteOffset": 48, "byteLength": 8}}],
            "buffers": [{{"byteLength": 56}}]}}"#
        )
    }

    const NODE: &str = r#"{"mesh": 0}"#;

    #[test]
    fn nodes_stand_where_those_above_put_them() {
        // Moved by (10, 0, 0), then turned by a quarter about z and scaled by 2.
        let nodes = r#"{"translation": [10, 0, 0], "children": [1]},
            {"rotation": [0, 0, 0.7071067811865476, 0.7071067811865476], "scale": [2, 2, 2], "mesh": 0}"#;
        let parsed = parse(&glb(&json(nodes, 4, 3), &buffer()), None).unwrap();
        let expected = [[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [8.0, 0.0, 0.0], [8.0, 2.0, 0.0]];
        for (found, expected) in parsed.mesh.vertices.iter().zip(expected) {
            assert!((*found - DVec3::from_array(expected)).length() < 1e-6, "{found}");
        }
        assert_eq!(parsed.mesh.triangles, [[0, 1, 2]]);
    }

    #[test]
    fn an_instance_is_the_same_mesh_again_and_strips_and_fans_are_triangles() {
        let twice = r#"{"children": [1, 2]}, {"mesh": 0}, {"mesh": 0, "translation": [0, 0, 5]}"#;
        let parsed = parse(&glb(&json(twice, 4, 3), &buffer()), None).unwrap();
        assert_eq!((parsed.mesh.vertices.len(), parsed.mesh.triangles.len()), (8, 2));
        for (mode, expected) in [(5, [[0, 1, 2], [1, 3, 2]]), (6, [[0, 1, 2], [0, 2, 3]])] {
            let parsed = parse(&glb(&json(NODE, mode, 4), &buffer()), None).unwrap();
            assert_eq!(parsed.mesh.triangles, expected);
        }
        let mirrored = r#"{"mesh": 0, "scale": [-1, 1, 1]}"#;
        let parsed = parse(&glb(&json(mirrored, 4, 3), &buffer()), None).unwrap();
        assert_eq!(parsed.mesh.triangles, [[0, 2, 1]]);
        let lines = parse(&glb(&json(NODE, 1, 4), &buffer()), None).unwrap();
        assert!(
            lines.mesh.triangles.is_empty() && lines.warnings[0].starts_with("points and lines")
        );
    }

    #[test]
    fn buffers_may_be_in_base64_or_beside_the_file() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a b\u{f6}.bin"), buffer()).unwrap();
        let inline = format!("data:application/octet-stream;base64,{}", STANDARD.encode(buffer()));
        for uri in ["a%20b%C3%B6.bin", &inline] {
            let text = json(NODE, 4, 3)
                .replace(r#""byteLength": 56"#, &format!(r#""byteLength": 56, "uri": "{uri}""#));
            let parsed = parse(text.as_bytes(), Some(folder.path())).unwrap();
            assert_eq!(parsed.mesh.triangles, [[0, 1, 2]]);
        }
    }

    /// Each byte by others, digits and signs among them: an error or a mesh, and no panic.
    #[test]
    fn damage_anywhere_is_an_error_or_a_mesh() {
        let whole = glb(&json(NODE, 4, 3), &buffer());
        for at in 0..whole.len() {
            for byte in *b"\0\x019-7e\"{[\xff" {
                let mut bytes = whole.clone();
                bytes[at] = byte;
                let _ = parse(&bytes, None);
            }
        }
        for end in 0..whole.len() {
            assert!(parse(&whole[..end], None).is_err());
        }
    }

    #[test]
    fn what_is_wrong_is_named_with_its_place() {
        let good = json(NODE, 4, 3);
        let swap = |from: &str, to: &str| {
            let changed = good.replace(from, to);
            assert_ne!(changed, good);
            glb(&changed, &buffer())
        };
        for (bytes, expected) in [
            (b"{}".to_vec(), "expected glTF 2.0: "),
            (b"glTF\x02\0\0\0\x0b\0\0\0".to_vec(), "expected a length of 12 or more in the header"),
            (swap(r#""scenes": [{"nodes": [0]}]"#, r#""scenes": []"#), "scene"),
            (swap(r#""mesh": 0"#, r#""mesh": 7"#), "nodes[0].mesh"),
            (
                swap(
                    r#""bufferView": 0, "#,
                    r#""bufferView": 0, "byteOffset": 18446744073709551604, "#,
                ),
                "accessors[0]: expected 4 elements",
            ),
            (swap("5123", "5126"), "expected indices of whole numbers without sign"),
            (
                swap(r#""count": 3"#, r#""count": 99"#),
                "meshes[0].primitives[0]: accessors[1]: expected 99 elements",
            ),
            (
                swap(
                    r#""byteOffset": 48, "byteLength": 8"#,
                    r#""byteOffset": 48, "byteLength": 80"#,
                ),
                "accessors[1]: its buffer view ends after the buffer",
            ),
            (
                swap(r#"[{"byteLength": 56}]"#, r#"[{"byteLength": 560}]"#),
                "buffers[0]: expected 560 bytes",
            ),
            (
                swap(
                    r#""asset""#,
                    r#""extensionsRequired": ["KHR_draco_mesh_compression"], "asset""#,
                ),
                "expected a file without KHR_draco_mesh_compression",
            ),
            (
                glb(&json(r#"{"mesh": 0, "children": [0]}"#, 4, 3), &buffer()),
                "nodes[0]: expected one parent",
            ),
            (
                glb(&good, &[[0; 48].as_slice(), &[9; 8]].concat()),
                "expected indices of 4 vertices, found 2313",
            ),
        ] {
            let error = parse(&bytes, None).unwrap_err().to_string();
            assert!(error.contains(expected), "{expected}: {error}");
        }
    }
}
