//! Any bytes, taken for glTF, are an error, or nodes at finite places that move along finite trajectories.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sim_gpu::glam::DAffine3;
use sim_gpu::internals::mesh::parse_assembly;

fuzz_target!(|bytes: &[u8]| {
    let Ok(found) = parse_assembly(bytes, None, DAffine3::IDENTITY) else { return };
    for part in &found.parts {
        assert!(part.world_from_mesh.is_finite());
        let mesh = &found.meshes[part.mesh].mesh;
        assert!(mesh.vertices.iter().all(|vertex| vertex.is_finite()));
        assert!(mesh.triangles.as_flattened().iter().all(|i| (*i as usize) < mesh.vertices.len()));
        if let Some(motion) = &part.motion {
            let [from_s, to_s] = motion.known_s();
            let at = motion.at(0.5 * from_s + 0.5 * to_s);
            assert!(at.position_m.is_finite() && at.rotation.is_normalized());
        }
    }
});
