//! Any bytes, taken for any format, are an error or a mesh that can be placed
//! and surveyed; an OBJ file with an MTL file is an error or has materials. The first byte chooses
//! the format.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sim_gpu::internals::material::{ColourSource, Material, MaterialChoice, Materials};
use sim_gpu::internals::mesh::frame::{Normalize, Up, to_world};
use sim_gpu::internals::mesh::validate::triangle_stats;
use sim_gpu::internals::mesh::{MeshFormat, parse};
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

/// Takes the bytes up to the first 0xFF for an MTL file, and those after it for an OBJ file.
fn load_materials(content: &[u8]) {
    let folder = std::env::temp_dir().join(format!("fuzz-mesh-{}", std::process::id()));
    let mut files = content.splitn(2, |byte| *byte == 0xFF);
    let [mtl, obj] = [0, 1].map(|_| files.next().unwrap_or_default());
    fs::create_dir_all(&folder).expect("the folder of temporary files can be written");
    for (name, content) in [("a.mtl", mtl), ("a.obj", &[b"mtllib a.mtl\n", obj].concat())] {
        fs::write(folder.join(name), content).expect("as the folder");
    }
    let choice = MaterialChoice { colours: Some(ColourSource::Mtl), ..MaterialChoice::default() };
    let _ = Materials::load(&folder.join("a.obj"), &choice, Material::diffuse(1.0));
}
