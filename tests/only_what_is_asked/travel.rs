//! What travels to the adapter and back for each ray, in bytes.

use glam::DVec3;
use sim_gpu::effects::Effects;
use sim_gpu::internals::gpu::Batch;
use tests::{adapter, casting, meshes};

use super::Rows;

/// As batches are laid out, and as every caster that there is answers.
pub fn rows(effects: &Effects) -> Rows {
    let target = casting::target(&meshes::icosphere(4));
    let job = casting::job(&target, &casting::at(DVec3::X * 3.0), &casting::builtin("vlp32c"));
    let mut batch = Batch::default();
    batch.push(&job, 0..job.beams.len(), effects);
    let n = job.beams.len() as u64;
    let codes = n * size_of::<u32>() as u64;
    let outputs = n * (effects.outputs_per_ray() * size_of::<f32>()) as u64;
    for caster in adapter::casters(effects) {
        let cast = casting::cast(caster, &job);
        let answered = [size_of_val(&cast.codes[..]), size_of_val(&cast.effect_outputs[..])];
        assert_eq!(answered.map(|bytes| bytes as u64), [codes, outputs], "{}", caster.name());
    }
    let per_ray = |bytes: u64| {
        assert_eq!(bytes % n, 0, "every ray has the same share");
        bytes / n
    };
    let bytes_of = |sent: usize| per_ray(sent as u64);
    [
        ("ray, bytes of rays sent", bytes_of(size_of_val(&batch.rays[..]))),
        ("ray, bytes of streams sent", bytes_of(size_of_val(&batch.streams[..]))),
        ("ray, bytes of codes read back", per_ray(codes)),
        ("ray, bytes of effect outputs read back", per_ray(outputs)),
    ]
    .map(|(row, bytes)| (row.to_owned(), bytes))
    .into()
}
