//! The hand-written OFF parser reads what any program writes.

use edgepuck_mesh::{MeshFormat, parse};
use proptest::prelude::*;

/// What ModelNet's and others' files do besides the plain form.
#[derive(Clone, Debug)]
struct Quirks {
    glued: bool,
    edges: bool,
    line_end: &'static str,
    comments: bool,
    blank_lines: bool,
    vertex_columns: &'static str,
    face_columns: &'static str,
}

fn quirks() -> impl Strategy<Value = Quirks> {
    let ends = prop::sample::select(vec!["\n", "\r\n", "\r", " \t\n"]);
    let vertex_columns = prop::sample::select(vec!["", " 0 0 1", " 255 128 0 255"]);
    let face_columns = prop::sample::select(vec!["", " 255 0 0", " 0.5 .25 1e-3 1.", " 7"]);
    let flags = (any::<bool>(), any::<bool>(), any::<bool>(), any::<bool>());
    (flags, ends, vertex_columns, face_columns).prop_map(
        |((glued, edges, comments, blank_lines), line_end, vertex_columns, face_columns)| Quirks {
            glued,
            edges,
            line_end,
            comments,
            blank_lines,
            vertex_columns,
            face_columns,
        },
    )
}

/// Fewer than `most` positions, and polygons of one to six corners, at least one of
/// three.
fn polygons(most: usize) -> impl Strategy<Value = (Vec<[f64; 3]>, Vec<Vec<u32>>)> {
    let finite = prop::num::f64::NORMAL | prop::num::f64::SUBNORMAL | prop::num::f64::ZERO;
    let positions = prop::collection::vec(prop::array::uniform3(finite), 3..most);
    positions.prop_flat_map(move |positions| {
        let corner = 0..positions.len() as u32;
        let face = prop::collection::vec(corner.clone(), 1..=6);
        let faces = prop::collection::vec(face, 0..most);
        let triangle = prop::collection::vec(corner, 3);
        (Just(positions), faces, triangle).prop_map(|(positions, mut faces, triangle)| {
            faces.push(triangle);
            (positions, faces)
        })
    })
}

fn write(positions: &[[f64; 3]], faces: &[Vec<u32>], quirks: &Quirks) -> String {
    let mut text = String::from(if quirks.glued { "OFF" } else { "OFF\n" });
    text += &format!("{} {}", positions.len(), faces.len());
    text += if quirks.edges { " 0\n" } else { "\n" };
    for [x, y, z] in positions {
        text += &format!("{x:?} {y} {z:e}{}\n", quirks.vertex_columns);
    }
    for face in faces {
        let corners: Vec<_> = face.iter().map(u32::to_string).collect();
        text += &format!("{} {}{}\n", face.len(), corners.join(" "), quirks.face_columns);
    }
    let comment = if quirks.comments { " # 1 2 3\n# a comment\n" } else { "\n" };
    let blank = if quirks.blank_lines { "\n  \n" } else { "" };
    text.replace('\n', &format!("{comment}{blank}")).replace('\n', quirks.line_end)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn what_is_written_is_read_to_the_bit((positions, faces) in polygons(40), quirks in quirks()) {
        let text = write(&positions, &faces, &quirks);
        let parsed = parse(text.as_bytes(), MeshFormat::Off).unwrap();
        let bits = |position: [f64; 3]| position.map(f64::to_bits);
        let read: Vec<_> = parsed.mesh.vertices.iter().map(|v| bits(v.to_array())).collect();
        let expected: Vec<_> = positions.iter().map(|position| bits(*position)).collect();
        prop_assert_eq!(read, expected);

        let mut triangles = parsed.mesh.triangles.iter();
        for face in &faces {
            let own: Vec<_> = triangles.by_ref().take(face.len().saturating_sub(2)).collect();
            prop_assert_eq!(own.len(), face.len().saturating_sub(2));
            prop_assert!(own.iter().all(|corners| corners.iter().all(|i| face.contains(i))));
            prop_assert!(face.len() != 3 || own[0][..] == face[..]);
        }
        prop_assert_eq!(triangles.next(), None);
        prop_assert_eq!(parsed.dropped_faces, faces.iter().filter(|face| face.len() < 3).count());
    }
}
