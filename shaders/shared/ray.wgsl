// The record of `sim-gpu/src/ray.rs`, and what the caster answers.

struct TraceRay {
    origin: vec3f,
    root: u32,
    direction: vec3f,
    // Distance from the sensor to `origin`, in unit lengths.
    skipped: f32,
}

struct Nearest {
    t: f32,
    // How far the true distance may be from `t`.
    error: f32,
    // Place in `triangles`.
    leaf: u32,
    index: u32,
    // No surface that starts beyond this can be the nearest.
    farthest: f32,
    // The lowest distance that another surface may truly have.
    rival: f32,
}
