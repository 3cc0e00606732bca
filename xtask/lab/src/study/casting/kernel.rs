//! The tracing kernel by the adapter's own clock: what is left of a cast when
//! upload and read-back are free.

use crate::measure::backends::Backend;
use anyhow::Result;
use sim_gpu::caster::Caster;
use sim_gpu::job::CastJob;

/// Seconds that each of `repeats` casts of `copies` copies of `job` took on
/// `backend`; `None` where its adapter keeps no time.
///
/// # Errors
/// If the device fails.
pub fn measure(
    backend: &Backend,
    job: &CastJob,
    copies: usize,
    repeats: usize,
) -> Result<Option<Vec<f64>>> {
    let Caster::Gpu(gpu) = &backend.caster else { return Ok(None) };
    let jobs = vec![job.clone(); copies];
    // The first cast warms up and is left out.
    gpu.cast_timed(&jobs)?;
    let seconds = (0..repeats).map(|_| Ok(gpu.cast_timed(&jobs)?.1));
    seconds.collect()
}
