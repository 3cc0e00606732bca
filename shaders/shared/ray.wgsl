// The record of `sim-gpu/src/ray.rs`, and the nearest surface along a ray.

struct TraceRay {
    origin: vec3f,
    root: u32,
    direction: vec3f,
    _padding: u32,
}

struct Nearest {
    t: f32,
    // Bound of the difference between `t` and the true distance.
    error: f32,
    // Index in `triangles`.
    leaf: u32,
    index: u32,
    // Surfaces that begin beyond this are not the nearest.
    farthest: f32,
    // Lower bound of the true distance of every other surface that the ray may meet.
    rival: f32,
}
