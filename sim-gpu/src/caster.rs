//! One interface to every way of casting.

use crate::cpu;
use crate::effects::Effects;
use crate::gpu::{AdapterRequest, GpuCaster, GpuError, Pending, adapter};
use crate::job::{Cast, CastJob};
use crate::target::Target;
use rayon::prelude::*;

/// A way of casting.
pub enum Caster {
    /// The CPU twin.
    Cpu(Effects),
    /// A GPU, or software Vulkan.
    Gpu(Box<GpuCaster>),
}

/// Jobs under way.
pub enum Casting {
    /// Already done, on the CPU.
    Done(Vec<Cast>),
    /// On their way through the adapter.
    Pending(Box<Pending>),
}

impl Caster {
    /// The caster that answers `request` and models `effects`.
    ///
    /// `Auto` falls back to the CPU twin where no adapter is found.
    ///
    /// # Errors
    /// If a named adapter is missing or the device cannot be opened.
    pub fn open(request: &AdapterRequest, effects: &Effects) -> Result<Self, GpuError> {
        match request {
            AdapterRequest::Cpu => Ok(Self::Cpu(effects.clone())),
            AdapterRequest::Auto => Ok(Self::open_best(effects).0),
            AdapterRequest::Named(name) => {
                let adapter = adapter::find_adapter(name)?;
                Ok(Self::Gpu(Box::new(GpuCaster::open(&adapter, effects)?)))
            }
        }
    }

    /// The best caster that opens, and why better ones did not.
    #[must_use]
    pub fn open_best(effects: &Effects) -> (Self, Vec<GpuError>) {
        let mut passed_over = Vec::new();
        for adapter in adapter::adapters() {
            match GpuCaster::open(&adapter, effects) {
                Ok(gpu) => return (Self::Gpu(Box::new(gpu)), passed_over),
                Err(error) => passed_over.push(error),
            }
        }
        (Self::Cpu(effects.clone()), passed_over)
    }

    /// The adapter's name, `cpu` for the twin.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Cpu(_) => "cpu",
            Self::Gpu(gpu) => &gpu.summary().name,
        }
    }

    /// Whether `target` fits the adapter's bindings; if not, the CPU twin
    /// casts it.
    #[must_use]
    pub fn fits(&self, target: &Target) -> bool {
        match self {
            Self::Cpu(_) => true,
            Self::Gpu(gpu) => gpu.limits().holds(target),
        }
    }

    /// Starts casting `jobs` all together.
    ///
    /// # Errors
    /// If the device is lost or out of memory.
    pub fn submit(&self, jobs: &[CastJob]) -> Result<Casting, GpuError> {
        match self {
            Self::Cpu(_) => Ok(Casting::Done(self.cast_on_cpu(jobs))),
            Self::Gpu(gpu) => Ok(Casting::Pending(Box::new(gpu.submit(jobs)?))),
        }
    }

    /// Casts `jobs` with the CPU twin, whatever the adapter.
    #[must_use]
    pub fn cast_on_cpu(&self, jobs: &[CastJob]) -> Vec<Cast> {
        let effects = match self {
            Self::Cpu(effects) => effects,
            Self::Gpu(gpu) => gpu.effects(),
        };
        jobs.par_iter().map(|job| cpu::trace::cast(job, effects)).collect()
    }

    /// Casts `jobs` and waits.
    ///
    /// # Errors
    /// As [`Caster::submit`].
    pub fn cast(&self, jobs: &[CastJob]) -> Result<Vec<Cast>, GpuError> {
        self.submit(jobs)?.wait()
    }
}

impl Casting {
    /// The answers, one per job, in order.
    ///
    /// # Errors
    /// If the device was lost.
    pub fn wait(self) -> Result<Vec<Cast>, GpuError> {
        match self {
            Self::Done(casts) => Ok(casts),
            Self::Pending(pending) => pending.wait(),
        }
    }
}
