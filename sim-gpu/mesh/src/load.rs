//! Loads meshes from files, and checks them.

use std::path::Path;

use formats::hash::{FileHash, Hashing};
use formats::plausible::{Warning, foreign};
use glam::{DAffine3, DVec3};

use super::assembly::Assembly;
use super::error::{Malformed, MeshError, ParseError};
use super::file::read;
use super::format::MeshFormat;
use super::tokens::without_mark;
use super::triangle_mesh::{Parsed, TriangleMesh};
use super::{gltf, obj, off, ply, stl};

/// A mesh as in its file, with the properties of the file.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedMesh {
    /// The mesh, in the axes and units of the file. It has at least one triangle, fewer than 2^32
    /// vertices, all finite, and all indices in range.
    pub mesh: TriangleMesh,
    /// The format by the file's extension.
    pub format: MeshFormat,
    /// The number of faces of fewer than three corners, which were dropped.
    pub dropped_faces: usize,
    /// What is probably wrong with the file.
    pub warnings: Vec<Warning>,
}

/// Reads the mesh at `path`, in the format of its extension.
pub fn load(path: &Path) -> Result<LoadedMesh, MeshError> {
    Ok(load_hashed(path, Hashing::None)?.0)
}

/// As [`load`], with the hash of the file's bytes that `hashing` asks for. The file is read once.
pub fn load_hashed(
    path: &Path,
    hashing: Hashing,
) -> Result<(LoadedMesh, Option<FileHash>), MeshError> {
    let bytes = read(path)?;
    Ok((loaded(path, &bytes, path.parent())?, hashing.of_bytes(&bytes)))
}

/// As [`load`], from the bytes of a file called `name`, which needs no other file.
pub fn load_bytes(name: &Path, bytes: &[u8]) -> Result<LoadedMesh, MeshError> {
    loaded(name, bytes, None)
}

/// The mesh of the file at `path` from its `bytes`; files that it names are in `folder`.
fn loaded(path: &Path, bytes: &[u8], folder: Option<&Path>) -> Result<LoadedMesh, MeshError> {
    let format = MeshFormat::from_path(path)
        .ok_or_else(|| MeshError::UnknownFormat { path: path.into() })?;
    let parsed = parse_in(bytes, format, folder);
    let Parsed { mesh, dropped_faces, warnings, .. } = parsed.map_err(|error| error.of(path))?;
    Ok(LoadedMesh { mesh, format, dropped_faces, warnings })
}

/// Reads the nodes of the glTF file at `path`; `world_from_file` stands above its roots.
pub fn load_assembly(path: &Path, world_from_file: DAffine3) -> Result<Assembly, MeshError> {
    let (bytes, folder) = (read(path)?, path.parent());
    parse_assembly(&bytes, folder, world_from_file).map_err(|error| error.of(path))
}

/// As [`load_assembly`], from a file's bytes; files that it names are in `folder`.
pub fn parse_assembly(
    bytes: &[u8],
    folder: Option<&Path>,
    world_from_file: DAffine3,
) -> Result<Assembly, ParseError> {
    if bytes.is_empty() {
        return Err(Malformed::Empty.into());
    }
    gltf::assemble(without_mark(bytes), folder, world_from_file)
        .and_then(|found| match found.parts.is_empty() {
            true => Err(Malformed::NoTriangle.into()),
            false => Ok(found),
        })
        .map_err(|error| explained(error, bytes, MeshFormat::Glb, folder))
}

/// Reads a mesh of `format` from a file's bytes, which need no other file.
pub fn parse(bytes: &[u8], format: MeshFormat) -> Result<Parsed, ParseError> {
    parse_in(bytes, format, None)
}

/// As [`parse`], with the files in `folder` that this one names.
fn parse_in(bytes: &[u8], format: MeshFormat, folder: Option<&Path>) -> Result<Parsed, ParseError> {
    let mut parsed =
        parse_as(bytes, format, folder).map_err(|error| explained(error, bytes, format, folder))?;
    parsed.cut_polygons();
    parsed.warnings.extend(flat(&parsed.mesh));
    Ok(parsed)
}

/// `error`, or what the bytes are if they are not of this format at all.
fn explained(
    error: ParseError,
    bytes: &[u8],
    format: MeshFormat,
    folder: Option<&Path>,
) -> ParseError {
    let is_gltf = |it: MeshFormat| matches!(it, MeshFormat::Glb | MeshFormat::Gltf);
    let is_same = |other: MeshFormat| other == format || is_gltf(other) && is_gltf(format);
    let is_other = |other: &MeshFormat| !is_same(*other) && parse_as(bytes, *other, folder).is_ok();
    let expected = format.name().to_uppercase();
    match (foreign(bytes), MeshFormat::ALL.into_iter().find(is_other)) {
        (Some(found), _) => Malformed::Syntax(format!("expected a mesh, found {found}")).into(),
        (None, Some(other)) => {
            let found = other.name().to_uppercase();
            let cause = format!("expected {expected}, found {found}: rename it to .{other}");
            Malformed::Syntax(cause).into()
        }
        (None, None) => error,
    }
}

fn parse_as(bytes: &[u8], format: MeshFormat, folder: Option<&Path>) -> Result<Parsed, ParseError> {
    let text = without_mark(bytes);
    let parsed = match format {
        _ if bytes.is_empty() => Err(Malformed::Empty.into()),
        MeshFormat::Off => off::parse(text),
        MeshFormat::Obj => obj::parse(text),
        MeshFormat::Ply => ply::parse(text),
        MeshFormat::Stl => stl::parse(bytes),
        MeshFormat::Glb | MeshFormat::Gltf => gltf::parse(text, folder),
    };
    parsed.and_then(|mut parsed| {
        parsed.mesh.settle_unused();
        check(&parsed.mesh).map(|()| parsed)
    })
}

/// The warning if no triangle of `mesh` has an area.
pub fn flat(mesh: &TriangleMesh) -> Option<Warning> {
    let has_area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|corner| mesh.vertices[corner as usize]);
        let longest = (b - a).abs().max(c - a).max(a - c).max_element();
        // Products of very short edges would be 0.
        longest > 0.0 && ((b - a) / longest).cross((c - a) / longest) != DVec3::ZERO
    };
    (!mesh.triangles.iter().any(has_area)).then_some(Warning::NoArea)
}

/// Checks that `mesh` has the properties of [`LoadedMesh::mesh`].
pub fn check(mesh: &TriangleMesh) -> Result<(), ParseError> {
    let n_vertices = mesh.vertices.len() as u64;
    Malformed::check_vertex_count(n_vertices)?;
    mesh.check_finite().map_err(Malformed::Syntax)?;
    let mut corners = mesh.triangles.iter().flatten();
    if let Some(index) = corners.find(|&&index| u64::from(index) >= n_vertices) {
        return Err(Malformed::IndexOutOfRange { found: index.to_string(), n_vertices }.into());
    }
    if mesh.triangles.is_empty() {
        return Err(Malformed::NoTriangle.into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    const TRIANGLE: &str = "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

    #[test]
    fn a_file_is_read_with_its_hash_and_its_extension_in_either_case() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.OFF");
        fs::write(&path, TRIANGLE).unwrap();
        let (loaded, hash) = load_hashed(&path, Hashing::Sha256).unwrap();
        assert_eq!(loaded.format, MeshFormat::Off);
        assert_eq!(loaded.mesh.triangles, [[0, 1, 2]]);
        assert_eq!(hash, Hashing::Sha256.of_bytes(TRIANGLE.as_bytes()));
    }

    #[test]
    fn other_files_fail_with_their_causes() {
        let folder = tempfile::tempdir().unwrap();
        let message = |name: &str| {
            let error = load(&folder.path().join(name)).unwrap_err().to_string();
            error.strip_prefix(&folder.path().display().to_string()).unwrap()[1..].to_owned()
        };
        fs::create_dir(folder.path().join("folder.off")).unwrap();
        fs::write(folder.path().join("empty.off"), "").unwrap();
        fs::write(folder.path().join("bad.off"), "OFF\n3 1 0\n0 0 nan\n").unwrap();
        fs::write(folder.path().join("notes.txt"), "").unwrap();
        fs::write(folder.path().join("off.stl"), TRIANGLE).unwrap();
        fs::write(folder.path().join("off.obj"), TRIANGLE).unwrap();
        let solid = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\n\
                     vertex 0 1 0\nendloop\nendfacet\nendsolid a\n";
        fs::write(folder.path().join("stl.obj"), solid).unwrap();
        assert_eq!(message("off.stl"), "off.stl: expected STL, found OFF: rename it to .off");
        assert_eq!(message("off.obj"), "off.obj: expected OBJ, found OFF: rename it to .off");
        assert_eq!(message("stl.obj"), "stl.obj: expected OBJ, found STL: rename it to .stl");
        assert_eq!(message("folder.off"), "folder.off: expected a mesh file, found a directory");
        assert_eq!(message("empty.off"), "empty.off: the file is empty");
        assert_eq!(message("bad.off"), "bad.off:3: expected a finite coordinate, found \"nan\"");
        let extension = "notes.txt: expected one of the extensions off, obj, ply, stl, glb, gltf";
        assert_eq!(message("notes.txt"), extension);
        assert!(message("missing.off").starts_with("missing.off: cannot be read: "));
    }

    #[test]
    fn concave_polygons_are_cut_in_every_format() {
        let corners = "0 0 0\n4 0 0\n4 4 0\n2 1 0\n0 4 0\n";
        let off = format!("OFF\n5 1 0\n{corners}5 0 1 2 3 4\n");
        let obj = corners.replace("0\n", "0\nv ");
        let obj = format!("v {}f 1 2 3 4 5\n", obj.trim_end_matches("v "));
        let ply = format!(
            "ply\nformat ascii 1.0\nelement face 1\nproperty list uchar int vertex_index\n\
             element vertex 5\nproperty float x\nproperty float y\nproperty float z\n\
             end_header\n5 0 1 2 3 4\n{corners}"
        );
        for (text, format) in
            [(off, MeshFormat::Off), (obj, MeshFormat::Obj), (ply, MeshFormat::Ply)]
        {
            let parsed = parse(text.as_bytes(), format).unwrap();
            let TriangleMesh { vertices, triangles } = &parsed.mesh;
            let area = |corners: &[u32; 3]| {
                let [a, b, c] = corners.map(|corner| vertices[corner as usize]);
                0.5 * (b - a).cross(c - a).length()
            };
            // By hand: a square of 16 less a triangle of 6.
            assert_eq!(triangles.iter().map(area).sum::<f64>(), 10.0, "{format}");
            assert_eq!((triangles.len(), &parsed.warnings[..]), (3, &[][..]));
        }
    }

    #[test]
    fn text_may_begin_with_a_byte_order_mark() {
        let stl = "solid\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n\
                   endloop\nendfacet\nendsolid\n";
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n\
                   property float z\nelement face 1\nproperty list uchar int vertex_index\n\
                   end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        let obj = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";
        for (text, format) in MeshFormat::ALL
            .into_iter()
            .zip([TRIANGLE, obj, ply, stl])
            .map(|(format, text)| (text, format))
        {
            let plain = parse(text.as_bytes(), format);
            assert!(plain.is_ok(), "{plain:?}");
            assert_eq!(parse(format!("\u{FEFF}{text}").as_bytes(), format), plain);
            // Line ends of old Macintoshes.
            assert_eq!(parse(text.replace('\n', "\r").as_bytes(), format), plain);
        }
    }

    #[test]
    fn other_kinds_of_files_are_named() {
        let pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 3\n";
        let wide =
            |of: fn(u16) -> [u8; 2]| "v 0 0 0\n".encode_utf16().flat_map(of).collect::<Vec<_>>();
        let marked = |mark: [u8; 2], of| [mark.to_vec(), wide(of)].concat();
        for (bytes, found) in [
            (pointer.into(), "a Git LFS pointer: fetch the file by `git lfs pull`"),
            (wide(u16::to_le_bytes), "text in UTF-16: save it as UTF-8"),
            (wide(u16::to_be_bytes), "text in UTF-16: save it as UTF-8"),
            (marked([0xFF, 0xFE], u16::to_le_bytes), "text in UTF-16: save it as UTF-8"),
            (marked([0xFE, 0xFF], u16::to_be_bytes), "text in UTF-16: save it as UTF-8"),
            (b"\x1F\x8B\x08\0".to_vec(), "a compressed file: unpack it"),
            (b"PK\x03\x04\0".to_vec(), "a compressed file: unpack it"),
            (b"<!DOCTYPE html>\n".to_vec(), "a web page"),
        ] {
            for format in MeshFormat::ALL {
                let error = parse(&bytes, format).unwrap_err().to_string();
                assert_eq!(error, format!("expected a mesh, found {found}"), "{format}");
            }
        }
    }

    #[test]
    fn every_format_refuses_what_has_no_triangle_or_is_not_finite() {
        let ply = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n\
                   property float z\nelement face 0\nproperty list uchar int vertex_index\n\
                   end_header\n0 0 0\n";
        for (text, format) in [
            ("OFF\n0 0 0\n", MeshFormat::Off),
            ("OFF\n1 0 0\n0 0 0\n", MeshFormat::Off),
            ("OFF\n2 1 0\n0 0 0\n1 0 0\n2 0 1\n", MeshFormat::Off),
            ("v 0 0 0\n", MeshFormat::Obj),
            (ply, MeshFormat::Ply),
            ("solid a\nendsolid a\n", MeshFormat::Stl),
        ] {
            let error = parse(text.as_bytes(), format).unwrap_err();
            assert_eq!(error.cause, Malformed::NoTriangle, "{format}");
        }
        let mut stl = vec![0; 84 + 50];
        stl[80] = 1;
        stl[100..104].copy_from_slice(&f32::NAN.to_le_bytes());
        let error = parse(&stl, MeshFormat::Stl).unwrap_err();
        let start = "face 1 of 1: expected finite coordinates, found ";
        assert!(error.to_string().starts_with(start), "{error}");
    }
}
