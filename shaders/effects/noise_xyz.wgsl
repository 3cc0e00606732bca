// Gaussian error of each coordinate, metres, in the world frame. Counterpart:
// `sim-gpu/src/cpu/effects.rs`.

override noise_mean_m: f32;
override noise_sigma_m: f32;

fn noise_xyz(i: u32, ray: TraceRay, nearest: Nearest) -> vec3f {
    let bits = random_bits(i, 1u);
    let deviate =
        vec3f(normal_deviate(bits.x), normal_deviate(bits.y), normal_deviate(bits.z));
    return vec3f(noise_mean_m) + noise_sigma_m * deviate;
}
