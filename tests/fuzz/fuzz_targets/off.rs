//! Any bytes are an error or a valid mesh: the OFF parser neither panics nor
//! hangs, nor takes memory that the file does not justify.

#![no_main]

use edgepuck_mesh::{MeshFormat, parse};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(parsed) = parse(bytes, MeshFormat::Off) {
        // The shortest line of a vertex has 6 bytes.
        assert!(parsed.mesh.vertices.capacity() <= bytes.len() / 6 + 1);
        assert!(!parsed.mesh.triangles.is_empty());
    }
});
