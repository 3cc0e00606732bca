// Counter-based random numbers. Counterpart: `formats/src/rng.rs` and
// `sim-gpu/src/cpu/random.rs`.

// Key in x and y, beam in z.
@group(1) @binding(1) var<storage, read> streams: array<vec4u>;

// Philox4x32-10: Salmon et al., SC 2011.
fn philox(counter: vec4u, key: vec2u) -> vec4u {
    var x = counter;
    var k = key;
    for (var round = 0; round < 10; round++) {
        let high0 = multiply_high(0xD2511F53u, x.x);
        let high1 = multiply_high(0xCD9E8D57u, x.z);
        let low0 = 0xD2511F53u * x.x;
        let low1 = 0xCD9E8D57u * x.z;
        x = vec4u(high1 ^ x.y ^ k.x, low1, high0 ^ x.w ^ k.y, low0);
        k += vec2u(0x9E3779B9u, 0xBB67AE85u);
    }
    return x;
}

fn random_bits(i: u32, purpose: u32) -> vec4u {
    let stream = streams[i];
    return philox(vec4u(stream.z, purpose, 0u, 0u), stream.xy);
}
