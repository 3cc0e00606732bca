//! What SIGINT and SIGTERM do to the program.

use crate::threads;
use edgepuck_dataset::Progress;
use formats::atomic;
use signal_hook::consts::{SIGINT, SIGTERM};
use std::process;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::SeqCst};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The flags of a run that can be resumed: to stop it, and whether that comes too late.
type Flags = (Arc<AtomicBool>, Arc<AtomicBool>);

/// Bytes that a thread needs to end the program.
const STACK: usize = 1 << 18;

/// The flags of the run at work.
static RUN: Mutex<Option<Flags>> = Mutex::new(None);

fn of_run() -> MutexGuard<'static, Option<Flags>> {
    RUN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does the `work` of `run`. Meanwhile the signals stop it where it can be resumed, instead of ending
/// the program.
pub fn stop<T>(run: &Progress, work: impl FnOnce() -> T) -> T {
    *of_run() = Some((Arc::clone(&run.stop), Arc::clone(&run.is_scanned)));
    let made = work();
    *of_run() = None;
    made
}

/// Ends the program at SIGINT and SIGTERM, without the files that it has not finished. Of a run that
/// can be resumed, they end the scanning. There, a second Ctrl-C ends the program immediately;
/// schedulers may repeat SIGTERM.
pub fn handle() -> anyhow::Result<()> {
    let caught = Arc::new(AtomicUsize::new(0));
    for signal in [SIGINT, SIGTERM] {
        signal_hook::flag::register_usize(signal, Arc::clone(&caught), signal as usize)?;
    }
    let watch = move || {
        loop {
            std::thread::sleep(Duration::from_millis(10));
            match caught.swap(0, SeqCst) {
                0 => {}
                signal => end(signal as i32),
            }
        }
    };
    let watching = std::thread::Builder::new().stack_size(STACK).spawn(watch);
    watching.map(drop).map_err(|cause| threads::cannot_start(1, &cause))
}

fn end(signal: i32) {
    let run = of_run().clone();
    if let Some((stop, is_scanned)) = &run
        && !is_scanned.load(SeqCst)
        && (!stop.swap(true, SeqCst) || signal == SIGTERM)
    {
        return;
    }
    atomic::abandon();
    if run.is_some_and(|(_, is_scanned)| is_scanned.load(SeqCst)) {
        program::outcome::say("stopped before the scans were packed; --resume continues");
        process::exit(i32::from(program::outcome::exit_code(Ok(crate::Outcome::Interrupted))));
    }
    let _ = signal_hook::low_level::emulate_default_handler(signal);
}
