// The outputs of the effects for each ray, in the order of `Effects::per_ray`.
@group(1) @binding(0) var<storage, read_write> effect_outputs: array<f32>;
