// 1 where the return is lost. Counterpart: `sim-gpu/src/cpu/effects.rs`.

override dropout_probability: f32;

fn dropout(i: u32, ray: TraceRay, nearest: Nearest) -> f32 {
    // 24 bits: exact in f32, so that every adapter drops the same returns.
    let unit = f32(random_bits(i, 2u).x >> 8u) * (1.0 / 16777216.0);
    return select(0.0, 1.0, unit < dropout_probability);
}
