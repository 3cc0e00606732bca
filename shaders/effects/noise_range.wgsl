// Gaussian error of the range along the ray, metres. Counterpart:
// `sim-gpu/src/cpu/effects.rs`.

override noise_mean_m: f32;
override noise_sigma_m: f32;

fn noise_range(i: u32, ray: TraceRay, nearest: Nearest) -> f32 {
    return noise_mean_m + noise_sigma_m * normal_deviate(random_bits(i, 1u).x);
}
