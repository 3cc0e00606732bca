use glam::DVec3;

use super::error::ParseError;
use super::triangle_mesh::{Parsed, TriangleMesh};

type Parse = fn(&[u8]) -> Result<Parsed, ParseError>;

#[track_caller]
pub fn is_the_triangle(parse: Parse, file: impl AsRef<[u8]>) {
    let vertices = vec![DVec3::ZERO, DVec3::X, DVec3::Y];
    let expected = TriangleMesh { vertices, triangles: vec![[0, 1, 2]] };
    let found = parse(file.as_ref()).map(|parsed| (parsed.mesh, parsed.dropped_faces));
    assert_eq!(found, Ok((expected, 0)), "{}", String::from_utf8_lossy(file.as_ref()));
}

#[track_caller]
pub fn fails<File: AsRef<[u8]>>(
    parse: Parse,
    cases: impl IntoIterator<Item = (File, &'static str)>,
) {
    for (file, message) in cases {
        let found = parse(file.as_ref()).map_err(|error| error.to_string());
        assert_eq!(found, Err(message.to_owned()));
    }
}
