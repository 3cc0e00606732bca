//! Any bytes, taken for glTF, are an error, or nodes at finite places.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sim_gpu::glam::DAffine3;
use edgepuck_mesh::parse_assembly;

fuzz_target!(|bytes: &[u8]| {
    let Ok(found) = parse_assembly(bytes, None, DAffine3::IDENTITY) else { return };
    for part in &found.parts {
        assert!(part.world_from_mesh.is_finite());
        let mesh = &found.meshes[part.mesh].mesh;
        assert!(mesh.vertices.iter().all(|vertex| vertex.is_finite()));
        assert!(mesh.triangles.as_flattened().iter().all(|i| (*i as usize) < mesh.vertices.len()));
    }
});
