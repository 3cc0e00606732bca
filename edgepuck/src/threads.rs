//! The threads of the program.

use anyhow::anyhow;
use rayon::ThreadPoolBuilder;
use std::error::Error;
use std::sync::Mutex;
use std::thread::{self, Builder};

/// Starts the threads that share the work of a command, and tries whether another one could start beside them,
/// and as many `times` over: a command that lacks threads fails before it writes anything.
pub fn start(times: usize) -> anyhow::Result<()> {
    let asked = std::env::var("RAYON_NUM_THREADS").ok().and_then(|n| n.parse().ok());
    let cores = || thread::available_parallelism().map_or(1, usize::from);
    let n = asked.filter(|n| *n > 0).unwrap_or_else(cores);
    // Without a source, the error is that the threads run already.
    if let Err(error) = ThreadPoolBuilder::new().num_threads(n).build_global()
        && let Some(cause) = error.source()
    {
        return Err(cannot_start(n, cause));
    }
    let (beside, gate) = (times * n + 1, Mutex::new(()));
    let closed = gate.lock();
    thread::scope(|scope| {
        let tried = (0..beside)
            .try_for_each(|_| Builder::new().spawn_scoped(scope, || drop(gate.lock())).map(drop));
        drop(closed);
        tried.map_err(|cause| cannot_start(n + beside, &cause))
    })
}

/// The error of `n` threads that the system does not start.
pub fn cannot_start(n: usize, cause: &dyn Error) -> anyhow::Error {
    anyhow!(
        "cannot start {n} threads: {cause}; allow more (`ulimit -u`), or set RAYON_NUM_THREADS=1 to use \
         fewer"
    )
}
