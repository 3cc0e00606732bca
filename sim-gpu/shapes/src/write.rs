use std::fmt::Write as _;
use std::path::Path;

use edgepuck_mesh::TriangleMesh;
use formats::{FormatError, atomic};
use glam::DVec3;

/// Writes `mesh` as ASCII OFF, with the shortest decimal numbers that give the same f64. The file
/// is complete or absent.
///
/// # Errors
/// The file cannot be written. An earlier file of this name then stays.
pub fn write_off(mesh: &TriangleMesh, path: &Path) -> Result<(), FormatError> {
    let mut text = format!("OFF\n{} {} 0\n", mesh.vertices.len(), mesh.triangles.len());
    for DVec3 { x, y, z } in &mesh.vertices {
        push_line(&mut text, format_args!("{x} {y} {z}"));
    }
    for [a, b, c] in &mesh.triangles {
        push_line(&mut text, format_args!("3 {a} {b} {c}"));
    }
    atomic::write_bytes(path, text)
}

/// Writes `mesh` as OBJ, which has y up: (x, y, z) becomes (x, z, -y). Otherwise like
/// [`write_off`].
///
/// # Errors
/// The file cannot be written. An earlier file of this name then stays.
pub fn write_obj(mesh: &TriangleMesh, path: &Path) -> Result<(), FormatError> {
    let mut text = String::new();
    for DVec3 { x, y, z } in &mesh.vertices {
        // 0 - y gives no negative zero.
        push_line(&mut text, format_args!("v {x} {z} {}", 0.0 - y));
    }
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|corner| corner + 1);
        push_line(&mut text, format_args!("f {a} {b} {c}"));
    }
    atomic::write_bytes(path, text)
}

fn push_line(text: &mut String, line: std::fmt::Arguments<'_>) {
    // Writing to a `String` cannot fail.
    let _ = writeln!(text, "{line}");
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dvec3;
    use std::fs;

    fn tetrahedron() -> TriangleMesh {
        TriangleMesh {
            vertices: vec![DVec3::ZERO, DVec3::X, DVec3::Y * 0.1, dvec3(0.0, 0.0, 1e-6)],
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        }
    }

    #[test]
    fn files_hold_every_digit_that_matters_and_obj_is_y_up_and_counts_from_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mesh");
        write_off(&tetrahedron(), &path).unwrap();
        let off = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 0.1 0\n0 0 0.000001\n\
                   3 0 2 1\n3 0 1 3\n3 1 2 3\n3 2 0 3\n";
        assert_eq!(fs::read_to_string(&path).unwrap(), off);
        write_obj(&tetrahedron(), &path).unwrap();
        let obj = "v 0 0 0\nv 1 0 0\nv 0 0 -0.1\nv 0 0.000001 0\n\
                   f 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n";
        assert_eq!(fs::read_to_string(&path).unwrap(), obj);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_named_in_the_error() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, "").unwrap();
        let error = write_off(&tetrahedron(), &file.join("t.off")).unwrap_err();
        assert!(error.to_string().contains(file.to_str().unwrap()), "{error}");
    }
}
