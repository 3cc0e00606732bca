//! PLY, ASCII and binary of either byte order, through the reader of clouds and scans.

use std::borrow::Cow;
use std::path::Path;

use formats::FormatError;
use formats::ply::{Element, read_elements};
use glam::DVec3;

use super::error::{Malformed, ParseError};
use super::triangle_mesh::Parsed;

/// The names of the list of a face's corners.
const CORNERS: [&str; 2] = ["vertex_indices", "vertex_index"];
/// The elements of a mesh, and the indices of those that hold faces.
const KINDS: [&str; 3] = ["vertex", "face", "tristrips"];
const VERTEX: usize = 0;
const FACE: usize = 1;

/// Reads x, y and z of the element `vertex` and the lists of vertex indices of `face` and
/// `tristrips`, and skips everything else. In a strip, each vertex makes a triangle with the two
/// before it, and -1 begins another strip.
///
/// A coordinate of type `float` is rounded to f32 in text too, so that both
/// encodings of a mesh give the same positions.
pub(super) fn parse(bytes: &[u8]) -> Result<Parsed, ParseError> {
    if !bytes.starts_with(b"ply") {
        return Err(Malformed::expected("a PLY file", &bytes[..bytes.len().min(16)]).at(1));
    }
    let (mut is_single, mut has_faces) = ([false; 3], false);
    let choose = |kind, element: &Element| {
        if kind != VERTEX {
            has_faces = true;
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
    let mut corners = Vec::new();
    // The first that is no index, and the largest so far: vertices may come last.
    let (mut bad_index, mut largest) = (None, (-1.0, [0; 2]));
    let mut corner = |index: f64, place: [usize; 2]| {
        let corner = index as u32;
        if f64::from(corner) != index {
            bad_index.get_or_insert((index, place));
        } else if index > largest.0 {
            largest = (index, place);
        }
        corner
    };
    let mut n_rows = [0; KINDS.len()];
    let name = Path::new("");
    let bytes = with_line_feeds(bytes);
    read_elements(&mut &*bytes, name, &KINDS, choose, |kind, row| {
        n_rows[kind] += 1;
        let mut corner = |index: &f64| corner(*index, [kind, n_rows[kind]]);
        match kind {
            VERTEX => parsed.mesh.vertices.push(DVec3::from_slice(row)),
            FACE => {
                corners.clear();
                corners.extend(row.iter().map(corner));
                parsed.add_face(&corners);
            }
            _ => {
                for strip in row.split(|index| *index == -1.0) {
                    for (number, indices) in strip.windows(3).enumerate() {
                        let mut triangle = [0, 1, 2].map(|place| corner(&indices[place]));
                        // Every other triangle of a strip is turned over.
                        triangle.swap(0, number % 2);
                        parsed.add_face(&triangle);
                    }
                }
            }
        }
    })
    .map_err(syntax)?;
    if !has_faces {
        let cause = "expected an element called face or tristrips, found a cloud of points";
        return Err(Malformed::Syntax(cause.to_owned()).into());
    }
    // The reader parses text as f64, whatever the type.
    for vertex in &mut parsed.mesh.vertices {
        for axis in (0..3).filter(|&axis| is_single[axis]) {
            vertex[axis] = f64::from(vertex[axis] as f32);
        }
    }
    let n_vertices = parsed.mesh.vertices.len() as u64;
    match bad_index.or((largest.0 >= n_vertices as f64).then_some(largest)) {
        Some((index, [kind, number])) => {
            let cause = Malformed::IndexOutOfRange { found: index.to_string(), n_vertices };
            let (kind, n) = (KINDS[kind], n_rows[kind]);
            Err(Malformed::Syntax(format!("{kind} {number} of {n}: {cause}")).into())
        }
        None => Ok(parsed),
    }
}

/// The file with `\n` in place of the line ends `\r`, which the format's first description has.
fn with_line_feeds(bytes: &[u8]) -> Cow<'_, [u8]> {
    let end = memchr::memmem::find(bytes, b"end_header").unwrap_or(bytes.len());
    let header = &bytes[..end];
    if header.contains(&b'\n') {
        return bytes.into();
    }
    let mut bytes = bytes.to_vec();
    let is_text = memchr::memmem::find(header, b"format ascii").is_some();
    let end = if is_text { bytes.len() } else { bytes.len().min(end + "end_header\r".len()) };
    bytes[..end].iter_mut().filter(|byte| **byte == b'\r').for_each(|byte| *byte = b'\n');
    bytes.into()
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
    use test_support::said::faults;

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
            let old = header("binary_little_endian", precision, 3, 1);
            let body = &little[old.len()..];
            is_the_triangle(parse, [old.replace('\n', "\r").as_bytes(), body].concat());
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
    fn strips_become_triangles_that_turn_alike() {
        // By the definition of OpenGL's triangle strips.
        let text = header("ascii", "float", 4, 0).replace(
            "end_header\n",
            "element tristrips 2\n\
                   property list int int vertex_indices\nend_header\n",
        ) + "0 0 0\n1 0 0\n0 1 0\n1 1 0\n9 0 1 2 3 -1 0 2 1 -1\n3 3 2 0\n";
        let expected = [[0, 1, 2], [2, 1, 3], [0, 2, 1], [3, 2, 0]];
        assert_eq!(parse(text.as_bytes()).unwrap().mesh.triangles, expected);
        let alone = text.replace("element face 0\nproperty list uchar int vertex_indices\n", "");
        assert_eq!(parse(alone.as_bytes()).unwrap().mesh.triangles, expected);
        let bad = text.replace("3 3 2 0", "3 3 2 -2");
        fails(parse, [(bad, "tristrips 2 of 2: index -2 is out of range: there are 4 vertices")]);
        let cloud = "expected an element called face or tristrips, found a cloud of points";
        fails(parse, [(alone.replace("tristrips", "strips"), cloud)]);
    }

    #[test]
    fn text_is_as_precise_as_the_type_of_its_numbers() {
        for (number, expected) in [("float", f64::from(0.1f32)), ("double", 0.1)] {
            let text = header("ascii", number, 3, 1) + &BODY.replace("1 0 0", "0.1 0 0");
            assert_eq!(parse(text.as_bytes()).unwrap().mesh.vertices[1].x, expected, "{number}");
        }
    }

    #[test]
    fn a_vertex_that_is_not_finite_is_a_fault_only_if_a_face_uses_it() {
        let text = header("ascii", "float", 4, 1) + "nan 0 inf\n2 0 0\n3 0 0\n2 1 0\n3 1 2 3\n";
        let mesh = parse_any(text.as_bytes(), MeshFormat::Ply).unwrap().mesh;
        // It has no part in the bounding box.
        assert_eq!(mesh.vertices[0], DVec3::new(2.0, 0.0, 0.0));
        assert_eq!(mesh.triangles, [[1, 2, 3]]);
        let used = text.replace("3 1 2 3", "3 1 2 0");
        let error = parse_any(used.as_bytes(), MeshFormat::Ply).unwrap_err().to_string();
        assert!(error.starts_with("vertex 1 of 4: expected finite coordinates, found "), "{error}");
    }

    #[test]
    fn faults_are_named_with_their_places() {
        fails(parse, faults(include_str!("ply_faults.txt")));
    }
}
