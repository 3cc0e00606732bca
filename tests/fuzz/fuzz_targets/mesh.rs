//! Any bytes, taken for any format, are an error or a mesh that can be placed
//! and surveyed; an OBJ file is an error or has materials. The first byte chooses
//! the format.

#![no_main]

use libfuzzer_sys::fuzz_target;
use edgepuck_mesh::material::{Material, Materials};
use edgepuck_mesh::frame::{Normalize, Up, to_world};
use edgepuck_mesh::validate::triangle_stats;
use edgepuck_mesh::{MeshFormat, parse};
use std::collections::BTreeMap;
use std::fs;

fuzz_target!(|bytes: &[u8]| {
    let Some((choice, content)) = bytes.split_first() else { return };
    let Some(format) = MeshFormat::ALL.get(usize::from(choice % 7)) else {
        return load_materials(content);
    };
    let Ok(parsed) = parse(content, *format) else { return };
    let n_vertices = parsed.mesh.vertices.len();
    assert!(parsed.mesh.triangles.as_flattened().iter().all(|i| (*i as usize) < n_vertices));
    for normalize in [Normalize::UnitSphere, Normalize::Bbox, Normalize::None] {
        let world = to_world(&parsed.mesh, Up::Y, normalize);
        assert!(world.mesh.vertices.iter().all(|vertex| vertex.is_finite()));
        assert!(world.centre.is_finite() && world.scale.is_finite() && world.scale > 0.0);
        assert!(triangle_stats(&world.mesh).kept.len() <= parsed.mesh.triangles.len());
    }
});

/// Takes the bytes for an OBJ file.
fn load_materials(content: &[u8]) {
    let folder = std::env::temp_dir().join(format!("fuzz-mesh-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("the folder of temporary files can be written");
    fs::write(folder.join("a.obj"), content).expect("as the folder");
    let none = BTreeMap::new();
    let _ = Materials::load(&folder.join("a.obj"), &none, Material::diffuse(1.0));
}
