//! What belongs to one process: its threads and its adapters.
//!
//! A process that forks leaves its threads behind: a pool of the parent's never answers in the
//! child, and an adapter that the parent opened is not the child's. So both are made when they are
//! first needed and kept with the number of the process. Nothing is started by an import.

use crate::error::{argument_error, raised};
use edgepuck_program::Outcome;
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};
use sim_gpu::Caster;
use std::ffi::OsString;
use std::mem;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A value and the process that made it. Only that process drops it: the threads and the device of a
/// parent are not in its children.
struct Own<T> {
    process: u32,
    of: Option<T>,
}

impl<T> Own<T> {
    fn new(of: T) -> Self {
        Self { process: std::process::id(), of: Some(of) }
    }

    /// What is kept, if this process made it.
    fn of_this_process(own: &Option<Self>) -> Option<&T> {
        own.as_ref().filter(|own| own.process == std::process::id())?.of.as_ref()
    }
}

impl<T> Drop for Own<T> {
    fn drop(&mut self) {
        if self.process != std::process::id() {
            mem::forget(self.of.take());
        }
    }
}

/// The pool of this process. A thread that locks it holds Python's lock, and runs no Python code until it
/// unlocks it: so no thread waits for the other lock, and no fork finds this one locked.
static POOL: Mutex<Option<Own<Arc<ThreadPool>>>> = Mutex::new(None);

/// How many threads the user of this process asked for; 0 if they did not.
static THREADS: Mutex<Option<Own<usize>>> = Mutex::new(None);

pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Does `work` on the threads of this process, without Python's lock.
pub fn run<T: Send>(py: Python<'_>, work: impl FnOnce() -> T + Send) -> PyResult<T> {
    let pool = pool(py)?;
    Ok(py.detach(|| pool.install(work)))
}

fn pool(py: Python<'_>) -> PyResult<Arc<ThreadPool>> {
    if let Some(pool) = Own::of_this_process(&lock(&POOL)) {
        return Ok(Arc::clone(pool));
    }
    let asked = Own::of_this_process(&lock(&THREADS)).copied().unwrap_or_default();
    let threads = match asked {
        0 if is_worker(py)? => 1,
        // 0 is as many as there are cores, or as RAYON_NUM_THREADS says.
        asked => asked,
    };
    let built = ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|number| format!("edgepuck-{number}"))
        .build()
        .map_err(raised)?;
    let mut pool = lock(&POOL);
    // Another thread may have been as quick.
    if let Some(pool) = Own::of_this_process(&pool) {
        return Ok(Arc::clone(pool));
    }
    let built = Arc::new(built);
    *pool = Some(Own::new(Arc::clone(&built)));
    Ok(built)
}

/// Whether this is a child that `multiprocessing` started, such as a worker of a `DataLoader`, or is
/// about to be one: a child that is not forked reads what it is to work on before it knows its parent.
fn is_worker(py: Python<'_>) -> PyResult<bool> {
    // A process that has not imported it is no child of it.
    let modules = py.import("sys")?.getattr("modules")?;
    let multiprocessing = modules.call_method1("get", ("multiprocessing.process",))?;
    if multiprocessing.is_none() {
        return Ok(false);
    }
    let process = multiprocessing.call_method0("current_process")?;
    let reads = process.getattr_opt("_inheriting")?;
    Ok(reads.is_some() || !multiprocessing.call_method0("parent_process")?.is_none())
}

/// Use this many threads in this process from now on; 0 is the default.
#[pyfunction]
pub fn set_num_threads(threads: i64) -> PyResult<()> {
    let expected = || raised(format!("threads: expected a whole number from 0, found {threads}"));
    let threads = usize::try_from(threads).map_err(|_| expected())?;
    *lock(&THREADS) = Some(Own::new(threads));
    let old = lock(&POOL).take();
    drop(old);
    Ok(())
}

/// An adapter, opened by each process that casts.
pub struct LazyCaster {
    adapter: String,
    opened: Mutex<Option<Own<Arc<Caster>>>>,
}

impl LazyCaster {
    pub fn new(adapter: &str) -> Self {
        Self { adapter: adapter.to_owned(), opened: Mutex::new(None) }
    }

    /// The caster of this process.
    pub fn open(&self) -> PyResult<Arc<Caster>> {
        let mut opened = lock(&self.opened);
        if let Some(caster) = Own::of_this_process(&opened) {
            return Ok(Arc::clone(caster));
        }
        let caster = Arc::new(Caster::named(&self.adapter).map_err(raised)?);
        *opened = Some(Own::new(Arc::clone(&caster)));
        Ok(caster)
    }
}

/// The names of the adapters that can cast, the CPU last.
#[pyfunction]
pub fn adapters(py: Python<'_>) -> Vec<String> {
    py.detach(Caster::adapters)
}

/// Run a command of the program `edgepuck`, whose name comes first, and raise what it reports.
#[pyfunction(name = "run")]
pub fn run_command(py: Python<'_>, words: Vec<OsString>) -> PyResult<()> {
    let ran = py.detach(|| edgepuck_program::cli::run_words(words));
    match ran.map_err(|error| raised(argument_error(&error)))? {
        Outcome::Success => Ok(()),
        other => Err(raised(format!("the command ended with {other:?}"))),
    }
}

/// Run the program `edgepuck` with these words, of which the first is its name, and return its exit
/// code.
#[pyfunction]
pub fn main(py: Python<'_>, words: Vec<OsString>) -> u8 {
    py.detach(|| edgepuck_program::cli::main(words))
}
