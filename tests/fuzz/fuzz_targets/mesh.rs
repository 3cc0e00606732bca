//! Any bytes, taken for any format, are an error or a mesh that can be placed
//! and surveyed. The first byte chooses the format.

#![no_main]

use sim_gpu::internals::mesh::validate::triangle_stats;
use sim_gpu::internals::mesh::frame::{Normalize, Up, to_world};
use sim_gpu::internals::mesh::{MeshFormat, parse};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    const FORMATS: [MeshFormat; 4] =
        [MeshFormat::Off, MeshFormat::Obj, MeshFormat::Ply, MeshFormat::Stl];
    let Some((choice, content)) = bytes.split_first() else { return };
    let Ok(parsed) = parse(content, FORMATS[usize::from(choice % 4)]) else { return };
    for normalize in [Normalize::UnitSphere, Normalize::Bbox, Normalize::None] {
        let world = to_world(&parsed.mesh, Up::Y, normalize);
        assert!(world.mesh.vertices.iter().all(|vertex| vertex.is_finite()));
        assert!(world.centre.is_finite() && world.scale.is_finite() && world.scale > 0.0);
        assert!(triangle_stats(&world.mesh).kept.len() <= parsed.mesh.triangles.len());
    }
});
