//! PLY, ASCII and binary of either byte order, through the crate ply-rs-bw.

use glam::DVec3;
use ply_rs_bw::parser::{ParseError as PlyError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use super::Mesh;
use super::error::{Malformed, ParseError, Part, excerpt};
use super::load::Parsed;

/// The names that the corners of a face go by.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];

/// Reads a PLY file from its bytes.
///
/// Of the element `vertex` it takes x, y and z, of `face` the list of vertex
/// indices; all else is skipped. Polygons become fans around their first
/// corner; faces of fewer than three corners are dropped and counted.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    let mut reader = Reader::new(bytes);
    if !bytes.starts_with(b"ply") {
        let found = excerpt(&bytes[..bytes.len().min(16)]);
        return Err(Malformed::WrongStart { format: "a PLY file", found }.at(1));
    }
    let parser = Parser::<Element>::new();
    let header = parser.read_header(&mut reader).map_err(|error| syntax(&error, true))?;
    check(&header, reader.get_ref().len() as u64)?;

    let is_ascii = header.encoding == Encoding::Ascii;
    let mut parsed = Parsed::default();
    let mut faces = Vec::new();
    for definition in header.elements.values() {
        let elements = parser
            .read_payload_for_element(&mut reader, definition, &header)
            .map_err(|error| syntax(&error, is_ascii))?;
        match definition.name.as_str() {
            "vertex" => {
                let positions = elements.iter().map(|vertex| DVec3::from_array(vertex.position));
                parsed.mesh.vertices = positions.collect();
            }
            "face" => faces = elements,
            _ => {}
        }
    }
    for face in &faces {
        add_face(&mut parsed, &face.corners)?;
    }
    Ok(parsed)
}

fn add_face(parsed: &mut Parsed, corners: &[i64]) -> Result<(), ParseError> {
    let Mesh { vertices, triangles } = &mut parsed.mesh;
    let corner = |index: i64| {
        let found = u32::try_from(index).ok().filter(|&corner| (corner as usize) < vertices.len());
        found.ok_or_else(|| Malformed::IndexOutOfRange {
            found: index.to_string(),
            n_vertices: vertices.len() as u64,
        })
    };
    let &[first, second, _, ..] = corners else {
        parsed.dropped_faces += 1;
        return Ok(());
    };
    let (first, mut last) = (corner(first)?, corner(second)?);
    for &other in &corners[2..] {
        let other = corner(other)?;
        triangles.push([first, last, other]);
        last = other;
    }
    Ok(())
}

/// Refuses a header that lacks what a mesh needs, or promises more elements
/// than `n_bytes` can hold.
fn check(header: &Header, n_bytes: u64) -> Result<(), Malformed> {
    let element = |name: &'static str| {
        let missing = || Malformed::Syntax(format!("the header has no element {name}"));
        header.elements.get(name).ok_or_else(missing)
    };
    let (vertex, face) = (element("vertex")?, element("face")?);
    for axis in ["x", "y", "z"] {
        let property = vertex.properties.get(axis);
        if !property.is_some_and(|property| matches!(property.data_type, PropertyType::Scalar(_))) {
            return Err(Malformed::Syntax(format!("vertices have no coordinate {axis}")));
        }
    }
    let is_corners = |name: &&str| {
        let property = face.properties.get(*name);
        property.is_some_and(|property| matches!(property.data_type, PropertyType::List(..)))
    };
    if !CORNERS.iter().any(is_corners) {
        return Err(Malformed::Syntax(format!("faces have no list {}", CORNERS.join(" or "))));
    }
    for definition in header.elements.values() {
        let promised = definition.count as u64;
        // The last line may lack its end.
        let held = match header.encoding {
            Encoding::Ascii => n_bytes.saturating_add(1),
            _ => n_bytes / shortest(definition).max(1),
        };
        if promised > held {
            let part = if definition.name == "vertex" { Part::Vertices } else { Part::Faces };
            return Err(Malformed::Truncated { part, held, promised });
        }
    }
    Ok(())
}

/// The fewest bytes that one binary element takes: all of its lists empty.
fn shortest(definition: &ElementDef) -> u64 {
    let of_property = |property: &PropertyType| match property {
        PropertyType::Scalar(scalar) | PropertyType::List(scalar, _) => match scalar {
            ScalarType::Char | ScalarType::UChar => 1,
            ScalarType::Short | ScalarType::UShort => 2,
            ScalarType::Int | ScalarType::UInt | ScalarType::Float => 4,
            ScalarType::Double => 8,
        },
    };
    definition.properties.values().map(|property| of_property(&property.data_type)).sum()
}

/// The crate's error on one line of text. Only in ASCII does the number it
/// names count lines of the file.
fn syntax(error: &PlyError, is_ascii: bool) -> ParseError {
    let text = error.to_string();
    let text = text.split_once(": ").filter(|_| error.line().is_some()).map_or(&*text, |p| p.1);
    let words: Vec<_> = text.split_whitespace().collect();
    let cause = Malformed::Syntax(words.join(" ").chars().take(300).collect());
    ParseError { line: error.line().filter(|_| is_ascii), cause }
}

/// What is wanted of an element of any kind.
struct Element {
    position: [f64; 3],
    corners: Vec<i64>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { position: [f64::NAN; 3], corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = ["x", "y", "z"].into_iter().position(|axis| axis == name);
        if let Some(axis) = axis {
            self.position[axis] = match property {
                Property::Float(value) => value.into(),
                Property::Double(value) => value,
                Property::Char(value) => value.into(),
                Property::UChar(value) => value.into(),
                Property::Short(value) => value.into(),
                Property::UShort(value) => value.into(),
                Property::Int(value) => value.into(),
                Property::UInt(value) => value.into(),
                _ => return PropertyAccessResult::UnsupportedType,
            };
        } else if CORNERS.contains(&name) {
            self.corners = match property {
                Property::ListChar(list) => list.into_iter().map(i64::from).collect(),
                Property::ListUChar(list) => list.into_iter().map(i64::from).collect(),
                Property::ListShort(list) => list.into_iter().map(i64::from).collect(),
                Property::ListUShort(list) => list.into_iter().map(i64::from).collect(),
                Property::ListInt(list) => list.into_iter().map(i64::from).collect(),
                Property::ListUInt(list) => list.into_iter().map(i64::from).collect(),
                _ => return PropertyAccessResult::UnsupportedType,
            };
        }
        PropertyAccessResult::Set
    }
}
