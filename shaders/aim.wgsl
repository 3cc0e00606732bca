// Makes rays from a sensor's beams in integers, which every adapter computes alike; the distance
// of a sensor would magnify rounding to f32. Counterpart: `sim-gpu/src/cpu/aim.rs`, which documents
// the units and the bounds of rounding.

// The frame of a sensor and an object, and the places of its rays and beams in their buffers.
struct View {
    turn_x: vec3i,
    root: u32,
    turn_y: vec3i,
    first_ray: u32,
    turn_z: vec3i,
    first_word: u32,
    // Integers of 64 bits, in two halves.
    origin_low: vec3u,
    first_direction: u32,
    origin_high: vec3u,
    reach_low: u32,
    reach_high: u32,
    // The reflectivity of the object, 0 to 1.
    reflectivity: f32,
}

// The high half of a 64-bit product, from 16-bit halves.
fn multiply_high(a: u32, b: u32) -> u32 {
    let a0 = a & 0xFFFFu;
    let a1 = a >> 16u;
    let b0 = b & 0xFFFFu;
    let b1 = b >> 16u;
    let middle = a1 * b0 + ((a0 * b0) >> 16u);
    let carry = (a0 * b1 + (middle & 0xFFFFu)) >> 16u;
    return a1 * b1 + (middle >> 16u) + carry;
}

// Numbers of 64 bits: the low half, then the high one, in two's complement.

fn product(a: i32, b: i32) -> vec2u {
    let p = bitcast<u32>(a);
    let q = bitcast<u32>(b);
    return vec2u(p * q, multiply_high(p, q) - select(0u, q, a < 0) - select(0u, p, b < 0));
}

fn sum(a: vec2u, b: vec2u) -> vec2u {
    let low = a.x + b.x;
    return vec2u(low, a.y + b.y + select(0u, 1u, low < a.x));
}

fn dot_product(a: vec3i, b: vec3i) -> vec2u {
    return sum(sum(product(a.x, b.x), product(a.y, b.y)), product(a.z, b.z));
}

// a / 2^shift, rounded down; the shift is 1 to 31, and the result has 32 bits.
fn shifted(a: vec2u, shift: u32) -> i32 {
    return bitcast<i32>((a.y << (32u - shift)) | (a.x >> shift));
}

fn rounded(a: vec2u, shift: u32) -> i32 {
    return shifted(sum(a, vec2u(1u << (shift - 1u), 0u)), shift);
}

fn turned(turn: vec3i, direction: vec3i) -> i32 {
    return rounded(dot_product(turn, direction), 30u);
}

fn aim(view: View, beam: vec3i) -> TraceRay {
    let direction =
        vec3i(turned(view.turn_x, beam), turned(view.turn_y, beam), turned(view.turn_z, beam));
    let x = vec2u(view.origin_low.x, view.origin_high.x);
    let y = vec2u(view.origin_low.y, view.origin_high.y);
    let z = vec2u(view.origin_low.z, view.origin_high.z);
    let sensor = vec3i(shifted(x, 27u), shifted(y, 27u), shifted(z, 27u));
    let along = -(bitcast<i32>(dot_product(sensor, direction).y) >> 1u);
    let reach = vec2u(view.reach_low, view.reach_high);
    let within = max(shifted(sum(reach, product(along, along)), 24u), 0);
    let skipped = max(along - 6 * within - BEFORE, 0);
    let origin = vec3i(
        rounded(sum(x, product(direction.x, skipped)), 27u),
        rounded(sum(y, product(direction.y, skipped)), 27u),
        rounded(sum(z, product(direction.z, skipped)), 27u),
    );
    // Integers of 24 bits are exact in f32, and so are their multiples of powers of two.
    return TraceRay(
        vec3f(origin) / 8388608.0,
        view.root,
        vec3f((direction + 32) >> vec3u(6u)) / 16777216.0,
        0u,
    );
}
