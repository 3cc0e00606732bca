//! The processor that casts.

use super::Error;
use crate::cast_error::CastError;
use crate::caster::{AdapterRequest, OpenCaster};
use crate::effects::Effects;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Pipelines of a GPU that are kept, each with its buffers.
const MOST_OPEN: usize = 4;

/// What casts the beams: a GPU, software Vulkan, or the CPU. All give the same points.
///
/// It casts for any [`Effects`]: a GPU's pipeline for them is built once and kept.
///
/// ```
/// # use sim_gpu::Caster;
/// let caster = Caster::auto();
/// match caster.why_no_gpu() {
///     None => println!("casting on {}", caster.name()),
///     Some(reason) => println!("casting on the CPU: {reason}"),
/// }
/// ```
pub struct Caster {
    name: String,
    why_no_gpu: Option<String>,
    skipped: Vec<String>,
    opened: Mutex<Vec<Arc<OpenCaster>>>,
    /// Held while one opens.
    opening: Mutex<()>,
}

impl fmt::Debug for Caster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Caster").field("name", &self.name).finish_non_exhaustive()
    }
}

impl Caster {
    /// The CPU, on all its cores; it needs no graphics driver.
    #[must_use]
    pub fn cpu() -> Self {
        let cpu = OpenCaster::Cpu(Effects::default());
        Self { why_no_gpu: Some("the CPU was asked for".to_owned()), ..Self::of(cpu) }
    }

    /// The best GPU that opens, or else the CPU. [`Caster::why_no_gpu`] says why it is the CPU.
    #[must_use]
    pub fn auto() -> Self {
        pollster::block_on(Self::auto_async())
    }

    /// As [`Caster::auto`], in a browser too, where nothing may wait.
    pub async fn auto_async() -> Self {
        let (best, errors) = OpenCaster::open_best(&Effects::default()).await;
        let skipped: Vec<String> = errors.iter().map(ToString::to_string).collect();
        let why = if !cfg!(feature = "gpu") {
            "this program was built without GPU support".to_owned()
        } else if skipped.is_empty() {
            "no GPU was found; software Vulkan is used only if it is named".to_owned()
        } else {
            skipped.join("; ")
        };
        let why_no_gpu = matches!(best, OpenCaster::Cpu(_)).then_some(why);
        Self { why_no_gpu, skipped, ..Self::of(best) }
    }

    /// The first adapter whose name contains this text, in upper or lower case; `auto` and `cpu` are
    /// [`Caster::auto`] and [`Caster::cpu`].
    ///
    /// # Errors
    /// No adapter has such a name (the message lists those that there are), or it does not open.
    pub fn named(name: &str) -> Result<Self, Error> {
        pollster::block_on(Self::named_async(name))
    }

    /// As [`Caster::named`], in a browser too, where nothing may wait.
    ///
    /// # Errors
    /// As [`Caster::named`].
    pub async fn named_async(name: &str) -> Result<Self, Error> {
        match name.parse() {
            Ok(AdapterRequest::Auto) => Ok(Self::auto_async().await),
            Ok(AdapterRequest::Cpu) => Ok(Self::cpu()),
            Ok(request) => {
                Ok(Self::of(OpenCaster::open_async(&request, &Effects::default()).await?))
            }
        }
    }

    /// The names of the adapters that there are, best first, and `cpu` at the end:
    /// [`Caster::named`] takes each.
    ///
    /// ```
    /// # use sim_gpu::Caster;
    /// assert_eq!(Caster::adapters().last().unwrap(), Caster::cpu().name());
    /// ```
    #[must_use]
    pub fn adapters() -> Vec<String> {
        #[cfg(feature = "gpu")]
        let found = crate::gpu::list_adapters().into_iter().map(|adapter| adapter.name);
        #[cfg(not(feature = "gpu"))]
        let found = std::iter::empty();
        found.chain(["cpu".to_owned()]).collect()
    }

    /// The adapter's name, or `cpu`.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Why the CPU casts and not a GPU; `None` where a GPU does.
    #[must_use]
    pub fn why_no_gpu(&self) -> Option<&str> {
        self.why_no_gpu.as_deref()
    }

    /// Why better GPUs did not open.
    #[doc(hidden)]
    pub fn skipped(&self) -> &[String] {
        &self.skipped
    }

    /// The caster of this adapter that models `effects`, which it opens unless it is open.
    ///
    /// # Errors
    /// The adapter does not open.
    #[doc(hidden)]
    pub fn for_effects(&self, effects: &Effects) -> Result<Arc<OpenCaster>, CastError> {
        let request = AdapterRequest::Named(self.name.clone());
        self.open_once(effects, || OpenCaster::open(&request, effects))
    }

    /// As [`Caster::for_effects`], in a browser too.
    ///
    /// # Errors
    /// As [`Caster::for_effects`].
    #[doc(hidden)]
    pub async fn for_effects_async(&self, effects: &Effects) -> Result<Arc<OpenCaster>, CastError> {
        // Only a browser's adapters answer later. A page has one thread, which must not wait for itself.
        if !cfg!(target_family = "wasm") {
            return self.for_effects(effects);
        }
        if let Some(caster) = self.opened(effects) {
            return Ok(caster);
        }
        let request = AdapterRequest::Named(self.name.clone());
        Ok(self.keep(OpenCaster::open_async(&request, effects).await?))
    }

    /// The caster that models `effects`. If it is not open, one thread calls `open`; the others wait and
    /// find what it opened.
    fn open_once(
        &self,
        effects: &Effects,
        open: impl FnOnce() -> Result<OpenCaster, CastError>,
    ) -> Result<Arc<OpenCaster>, CastError> {
        if let Some(caster) = self.opened(effects) {
            return Ok(caster);
        }
        let _opening = lock(&self.opening);
        match self.opened(effects) {
            Some(caster) => Ok(caster),
            None => Ok(self.keep(open()?)),
        }
    }

    /// Keeps `caster` in place of the one that was opened before all others that are kept.
    fn keep(&self, caster: OpenCaster) -> Arc<OpenCaster> {
        let caster = Arc::new(caster);
        let mut opened = lock(&self.opened);
        opened.insert(0, Arc::clone(&caster));
        opened.truncate(MOST_OPEN);
        caster
    }

    /// The caster that models `effects`, if it is open. The CPU's always is.
    fn opened(&self, effects: &Effects) -> Option<Arc<OpenCaster>> {
        let opened = lock(&self.opened);
        if let Some(caster) = opened.iter().find(|caster| caster.effects() == effects) {
            return Some(Arc::clone(caster));
        }
        let is_cpu = opened.iter().any(|caster| matches!(**caster, OpenCaster::Cpu(_)));
        is_cpu.then(|| Arc::new(OpenCaster::Cpu(effects.clone())))
    }

    fn of(caster: OpenCaster) -> Self {
        let name = caster.name().to_owned();
        Self {
            name,
            why_no_gpu: None,
            skipped: Vec::new(),
            opened: Mutex::new(vec![Arc::new(caster)]),
            opening: Mutex::new(()),
        }
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Barrier;
    use std::sync::atomic::{AtomicUsize, Ordering};

    #[test]
    fn one_thread_opens_and_the_others_find_what_it_opened() {
        const N: usize = 8;
        let caster = Caster { opened: Mutex::default(), ..Caster::cpu() };
        let (start, n_opened) = (Barrier::new(N), AtomicUsize::new(0));
        let open = || {
            n_opened.fetch_add(1, Ordering::Relaxed);
            // Long enough that the others come meanwhile.
            std::thread::sleep(std::time::Duration::from_millis(50));
            Ok(OpenCaster::Cpu(Effects::default()))
        };
        let found: Vec<_> = std::thread::scope(|scope| {
            let find = || {
                start.wait();
                caster.open_once(&Effects::default(), open).unwrap()
            };
            let threads: Vec<_> = (0..N).map(|_| scope.spawn(find)).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert_eq!(n_opened.into_inner(), 1);
        assert!(found.iter().all(|one| one.effects() == &Effects::default()));
    }
}
