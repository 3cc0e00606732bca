//! Any text, taken for URDF, is an error or a robot at a finite place.

#![no_main]

use libfuzzer_sys::fuzz_target;
use sim_gpu::Import;
use sim_gpu::glam::DAffine3;
use edgepuck_mesh::import::parse_urdf;

fuzz_target!(|text: &str| {
    for collision in [false, true] {
        let import = Import { collision, ..Import::default() };
        let Ok(robot) = parse_urdf(text, None, &import, DAffine3::IDENTITY) else { continue };
        assert!(robot.parts.iter().all(|part| part.world_from_mesh.is_finite()));
    }
});
