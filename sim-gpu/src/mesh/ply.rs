//! PLY, ASCII and binary of either byte order, through the crate ply-rs-bw.

use glam::DVec3;
use ply_rs_bw::parser::{ParseError as PlyError, Parser, Reader};
use ply_rs_bw::ply::{
    ElementDef, Encoding, Header, Property, PropertyAccess, PropertyAccessResult, PropertyType,
    ScalarType,
};

use super::error::{Malformed, ParseError, Part, excerpt};
use super::triangle_mesh::{Mesh, Parsed};

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

#[cfg(test)]
mod tests {
    use super::*;

    const BODY: &str = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    fn header(encoding: &str, coordinate: &str, n_vertices: u64, n_faces: u64) -> String {
        format!(
            "ply\nformat {encoding} 1.0\ncomment a triangle\nelement vertex {n_vertices}\n\
             property {coordinate} x\nproperty {coordinate} y\nproperty {coordinate} z\n\
             element face {n_faces}\nproperty list uchar int vertex_indices\nend_header\n"
        )
    }

    #[track_caller]
    fn is_the_triangle(bytes: &[u8]) {
        let mesh = parse(bytes).unwrap().mesh;
        assert_eq!(mesh.vertices, [DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert_eq!(mesh.triangles, [[0, 1, 2]]);
    }

    #[track_caller]
    fn fails(bytes: &[u8], message: &str) {
        let error = parse(bytes).expect_err(message).to_string();
        assert!(error.starts_with(message), "{error}");
    }

    #[test]
    fn text_and_both_byte_orders_are_read_in_either_precision() {
        is_the_triangle((header("ascii", "float", 3, 1) + BODY).as_bytes());
        is_the_triangle((header("ascii", "double", 3, 1) + BODY).as_bytes());
        let positions = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        for precision in ["float", "double"] {
            let mut little = header("binary_little_endian", precision, 3, 1).into_bytes();
            let mut big = header("binary_big_endian", precision, 3, 1).into_bytes();
            for position in positions {
                if precision == "double" {
                    little.extend(f64::to_le_bytes(position));
                    big.extend(f64::to_be_bytes(position));
                } else {
                    little.extend(f32::to_le_bytes(position as f32));
                    big.extend(f32::to_be_bytes(position as f32));
                }
            }
            little.push(3);
            big.push(3);
            for index in [0i32, 1, 2] {
                little.extend(index.to_le_bytes());
                big.extend(index.to_be_bytes());
            }
            is_the_triangle(&little);
            is_the_triangle(&big);
            fails(&little[..little.len() - 1], "Unexpected end of file");
        }
    }

    #[test]
    fn other_properties_elements_and_names_are_skipped() {
        let text = "ply\r\nformat ascii 1.0\r\nelement material 1\r\nproperty list uchar float k\r\n\
                    element vertex 3\r\nproperty uchar red\r\nproperty double x\r\n\
                    property double y\r\nproperty double z\r\nelement face 1\r\n\
                    property int flags\r\nproperty list uchar uint vertex_index\r\nend_header\r\n\
                    2 .5e0 1\r\n9 0 0 0\r\n9 1 0 0\r\n9 0 1 0\r\n-1 3 0 1 2\r\n";
        is_the_triangle(text.replace(".5e0", "0.5e0").as_bytes());
    }

    #[test]
    fn polygons_become_fans_and_smaller_faces_are_counted() {
        let text =
            header("ascii", "float", 4, 3) + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n2 0 1\n0\n";
        let parsed = parse(text.as_bytes()).unwrap();
        assert_eq!(parsed.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(parsed.dropped_faces, 2);
    }

    #[test]
    fn a_promise_of_billions_is_checked_against_the_file() {
        let message = "truncated: the header promises 4000000000 vertices, the file holds";
        for encoding in ["ascii", "binary_little_endian"] {
            fails((header(encoding, "float", 4_000_000_000, 1) + BODY).as_bytes(), message);
        }
        let message = "truncated: the header promises 18446744073709551615 faces, the file holds";
        fails((header("binary_big_endian", "float", 1, u64::MAX) + BODY).as_bytes(), message);
        let empty = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\n\
                     property float y\nproperty float z\nelement face 1\n\
                     property list int int vertex_index\nelement nothing 9000000000\nend_header\n";
        let message = "truncated: the header promises 9000000000 faces";
        fails(format!("{empty}{BODY}").as_bytes(), message);
    }

    #[test]
    fn errors_name_their_cause_and_in_text_their_line() {
        let ascii = |body: &str| (header("ascii", "float", 3, 1) + body).into_bytes();
        fails(b"plx\n", "line 1: not a PLY file: it begins with \"plx \"");
        fails(b"ply\nformat ascii 1.0\nend_header\n", "the header has no element vertex");
        fails(&ascii("0 0 0\n1 0 zero\n"), "line 12: ");
        fails(&ascii("0 0 0\n"), "line 12: Unexpected end of file");
        fails(&ascii("0 0 0\n1 0 0\n0 1 0\n3 0 1 3\n"), "index 3 is out of range");
        fails(&ascii("0 0 0\n1 0 0\n0 1 0\n3 0 1 -1\n"), "index -1 is out of range");
        let no_z = String::from_utf8(ascii(BODY)).unwrap().replace("float z", "float w");
        fails(no_z.as_bytes(), "vertices have no coordinate z");
        let no_list = String::from_utf8(ascii(BODY)).unwrap().replace("vertex_indices", "strip");
        fails(no_list.as_bytes(), "faces have no list vertex_indices or vertex_index");
    }
}
