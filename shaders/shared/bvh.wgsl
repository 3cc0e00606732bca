// The records of `sim-gpu/src/bvh/node.rs`.

struct Node {
    left_min: vec3f,
    left: u32,
    left_max: vec3f,
    left_count: u32,
    right_min: vec3f,
    right: u32,
    right_max: vec3f,
    right_count: u32,
}

// Corners in canonical order: lexicographic by position.
struct LeafTriangle {
    a: vec3f,
    index: u32,
    b: vec3f,
    // The length of the longest side, and some rounding.
    longest: f32,
    c: vec3f,
    _padding_c: u32,
}
