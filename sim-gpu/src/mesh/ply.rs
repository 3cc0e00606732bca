//! PLY, ASCII and binary of either byte order, through the reader of clouds and scans.

use std::path::Path;

use formats::FormatError;
use formats::ply::{Element, read_elements};
use glam::DVec3;

use super::error::{Malformed, ParseError};
use super::triangle_mesh::Parsed;

/// The names of the list of a face's corners.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];
/// The elements of a mesh, and the index of the faces.
const KINDS: [&str; 2] = ["vertex", "face"];
const FACE: usize = 1;

/// Reads x, y and z of the element `vertex` and the list of vertex indices of `face`, and skips
/// everything else.
///
/// A coordinate of type `float` is rounded to f32 in text too, so that both
/// encodings of a mesh give the same positions.
pub(super) fn parse(mut bytes: &[u8]) -> Result<Parsed, ParseError> {
    if !bytes.starts_with(b"ply") {
        return Err(Malformed::expected("a PLY file", &bytes[..bytes.len().min(16)]).at(1));
    }
    let mut is_single = [false; 3];
    let choose = |kind, element: &Element| {
        if kind == FACE {
            return Ok(vec![element.list(&CORNERS)?]);
        }
        let mut places = vec![];
        for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
            places.push(element.scalar(name)?);
            is_single[axis] = element.is_single(places[axis]);
        }
        Ok(places)
    };
    let mut parsed = Parsed::default();
    let (mut corners, mut bad_index) = (Vec::new(), None);
    let name = Path::new("");
    read_elements(&mut bytes, name, &KINDS, choose, |kind, row| {
        if kind == FACE {
            corners.clear();
            for &index in row {
                let corner = index as u32;
                if f64::from(corner) != index {
                    bad_index.get_or_insert(index);
                }
                corners.push(corner);
            }
            parsed.add_face(&corners);
        } else {
            parsed.mesh.vertices.push(DVec3::from_slice(row));
        }
    })
    .map_err(syntax)?;
    // The reader parses text as f64, whatever the type.
    for vertex in &mut parsed.mesh.vertices {
        for axis in (0..3).filter(|&axis| is_single[axis]) {
            vertex[axis] = f64::from(vertex[axis] as f32);
        }
    }
    let n_vertices = parsed.mesh.vertices.len() as u64;
    match bad_index {
        Some(index) => {
            Err(Malformed::IndexOutOfRange { found: index.to_string(), n_vertices }.into())
        }
        None => Ok(parsed),
    }
}

fn syntax(error: FormatError) -> ParseError {
    let FormatError::Malformed { part, cause, .. } = error else {
        return Malformed::Syntax(error.to_string()).into();
    };
    match part.strip_prefix("line ").and_then(|line| line.parse().ok()) {
        Some(line) => Malformed::Syntax(cause).at(line),
        None => Malformed::Syntax(format!("{part}: {cause}")).into(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::format::MeshFormat;
    use super::super::load::parse as parse_any;
    use super::super::testing::{fails, is_the_triangle};
    use super::*;

    const BODY: &str = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    fn header(encoding: &str, coordinate: &str, n_vertices: u64, n_faces: u64) -> String {
        format!(
            "ply\nformat {encoding} 1.0\ncomment a triangle\nelement vertex {n_vertices}\n\
             property {coordinate} x\nproperty {coordinate} y\nproperty {coordinate} z\n\
             element face {n_faces}\nproperty list uchar int vertex_indices\nend_header\n"
        )
    }

    #[test]
    fn text_and_both_byte_orders_are_read_in_either_precision() {
        is_the_triangle(parse, header("ascii", "float", 3, 1) + BODY);
        is_the_triangle(parse, header("ascii", "double", 3, 1) + BODY);
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
            is_the_triangle(parse, &little);
            is_the_triangle(parse, &big);
            fails(
                parse,
                [(&little[..little.len() - 1], "element face: the file ends after 0 of 1")],
            );
        }
    }

    #[test]
    fn other_properties_elements_and_names_are_skipped() {
        let text = "ply\r\nformat ascii 1.0\r\nelement material 1\r\nproperty list uchar float k\r\n\
                    element vertex 3\r\nproperty uchar red\r\nproperty double x\r\n\
                    property double y\r\nproperty double z\r\nelement face 1\r\n\
                    property int flags\r\nproperty list uchar uint vertex_index\r\nend_header\r\n\
                    2 .5e0 1\r\n9 0 0 0\r\n9 1 0 0\r\n9 0 1 0\r\n-1 3 0 1 2\r\n";
        is_the_triangle(parse, text);
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
    fn text_is_as_precise_as_the_type_of_its_numbers() {
        for (number, expected) in [("float", f64::from(0.1f32)), ("double", 0.1)] {
            let text = header("ascii", number, 3, 1) + &BODY.replace("1 0 0", "0.1 0 0");
            assert_eq!(parse(text.as_bytes()).unwrap().mesh.vertices[1].x, expected, "{number}");
        }
    }

    #[test]
    fn a_promise_of_billions_is_an_error() {
        let nothing = "element nothing 9000000000\nelement face";
        let cases = [
            (
                header("ascii", "float", 4_000_000_000, 1),
                "line 15: the file ends after 4 of 4000000000",
            ),
            (
                header("binary_little_endian", "float", 4_000_000_000, 1),
                "element vertex: the file ends after 2 of 4000000000",
            ),
            (
                header("binary_big_endian", "float", 1, u64::MAX),
                "element face: the file ends after 0 of 18446744073709551615",
            ),
            (
                header("ascii", "float", 3, 2).replace("element face", nothing),
                "line 16: the file ends after 1 of 2",
            ),
        ];
        fails(parse, cases.map(|(header, message)| (header + BODY, message)));
    }

    #[test]
    fn errors_name_their_cause_and_in_text_their_line() {
        let start = "line 1: expected a PLY file, found \"plx \"";
        let no_vertex = "ply\nformat ascii 1.0\nend_header\n";
        let (no_z, no_list) = (
            "element vertex: property z is missing",
            "element face: expected a \
            list called vertex_indices or vertex_index",
        );
        let header = header("ascii", "float", 3, 1);
        let cases = [
            ("plx\n".to_owned(), start),
            (no_vertex.to_owned(), "element vertex: missing"),
            (header.replace("float z", "float w"), no_z),
            (header.replace("vertex_indices", "strip"), no_list),
            (format!("{header}0 0 0\n1 0 zero\n"), "line 12: expected a number, found `zero`"),
            (format!("{header}0 0 0\n"), "line 12: the file ends after 1 of 3"),
        ];
        fails(parse, cases);
        let bad_faces = [
            ("3 0 1 -1", "index -1 is out of range: there are 3 vertices"),
            ("3 0 1 0.5", "index 0.5 is out of range: there are 3 vertices"),
        ];
        let with = |face: &str| header.clone() + &BODY.replace("3 0 1 2", face);
        fails(parse, bad_faces.map(|(face, message)| (with(face), message)));
        let parsed = parse_any(with("3 0 1 3").as_bytes(), MeshFormat::Ply);
        assert_eq!(
            parsed.unwrap_err().to_string(),
            "index 3 is out of range: there are 3 vertices"
        );
    }
}
