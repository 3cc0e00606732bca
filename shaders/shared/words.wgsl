// What the effects answer, `WORDS` per ray; the composer declares `WORDS`.
@group(1) @binding(0) var<storage, read_write> words: array<f32>;
