//! The bytes of shapes stay the same: the meshes under `assets/meshes`, and hashes of larger ones.
//!
//! After an intended change, `UPDATE_GOLDEN=1 cargo test -p edgepuck-shapes --test shapes_golden`
//! rewrites both.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use edgepuck_shapes::{ShapeClass, generate, write_obj, write_off};
use sha2::{Digest, Sha256};

/// The seed of the committed meshes; `gen-dataset --save-meshes` gives the same meshes with it.
const SEED: u64 = 1;

/// The committed meshes: path under `assets/meshes`, class, instance. The numbers in names start at
/// 1, as those of `write_tree`.
const COMMITTED: [(&str, ShapeClass, u32); 11] = [
    ("airplane/airplane_0019.off", ShapeClass::Airplane, 18),
    ("bottle/bottle_0052.off", ShapeClass::Bottle, 51),
    ("bowl/bowl_0052.off", ShapeClass::Bowl, 51),
    ("chair/chair_0046.obj", ShapeClass::Chair, 45),
    ("chair/chair_0053.obj", ShapeClass::Chair, 52),
    ("cone/cone_0014.off", ShapeClass::Cone, 13),
    ("cup/cup_0028.obj", ShapeClass::Cup, 27),
    ("lamp/lamp_0026.off", ShapeClass::Lamp, 25),
    ("monitor/monitor_0046.off", ShapeClass::Monitor, 45),
    ("table/table_0044.off", ShapeClass::Table, 43),
    ("vase/vase_0047.off", ShapeClass::Vase, 46),
];

const HOW_TO_UPDATE: &str = "if that is meant, UPDATE_GOLDEN=1 rewrites it";

/// The largest total size of the committed meshes, bytes.
const MAX_COMMITTED_BYTES: usize = 300 * 1024;

fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Whether the golden file holds `bytes`. With `UPDATE_GOLDEN`, writes it first.
fn is_golden(path: &Path, bytes: &[u8]) -> io::Result<bool> {
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        path.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::write(path, bytes)?;
    }
    Ok(fs::read(path)? == bytes)
}

#[test]
fn committed_meshes_are_what_the_generator_gives() {
    let folder = tempfile::tempdir().unwrap();
    let mut total = 0;
    for (name, class, instance) in COMMITTED {
        let mesh = generate(class, SEED, instance);
        let written = folder.path().join("mesh");
        let write = if name.ends_with(".obj") { write_obj } else { write_off };
        write(&mesh, &written).unwrap();
        let bytes = fs::read(&written).unwrap();
        total += bytes.len();
        let golden = repository().join("assets/meshes").join(name);
        assert!(is_golden(&golden, &bytes).unwrap(), "{name} differs; {HOW_TO_UPDATE}");
    }
    assert!(total < MAX_COMMITTED_BYTES, "{total} bytes are too many for the repository");
}

#[test]
fn hashes_of_files_stay_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("mesh.off");
    let mut lines = String::new();
    for class in ShapeClass::ALL {
        for instance in 0..5 {
            let mesh = generate(class, SEED, instance);
            write_off(&mesh, &path).unwrap();
            let digest = Sha256::digest(fs::read(&path).unwrap());
            let start: String = digest[..8].iter().map(|byte| format!("{byte:02x}")).collect();
            let n = mesh.triangles.len();
            writeln!(lines, "{class} {instance} {n} triangles {start}").unwrap();
        }
    }
    let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/shapes.txt");
    let same = is_golden(&golden, lines.as_bytes()).unwrap();
    assert!(same, "shapes differ; {HOW_TO_UPDATE}; now:\n{lines}");
}
