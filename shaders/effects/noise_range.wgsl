// Gaussian error of the range along the ray, metres. Twin:
// `sim-gpu/src/cpu/effects/noise_range.rs`.

override noise_mean_m: f32;
override noise_sigma_m: f32;

fn noise_range(i: u32, ray: TraceRay, nearest: Nearest) -> f32 {
    return noise_mean_m + noise_sigma_m * normal_deviate(stream_words(i, 1u).x);
}
