//! One interface to every way of casting.

use crate::cast_error::CastError;
use crate::cpu;
use crate::effects::Effects;
#[cfg(feature = "gpu")]
use crate::gpu::{self, GpuCaster, Pending};
use crate::job::{Cast, CastJob};
use crate::target::Target;
use rayon::prelude::*;
use std::str::FromStr;

/// A way of casting.
pub enum OpenCaster {
    /// The CPU, with these effects.
    Cpu(Effects),
    /// A GPU, or software Vulkan.
    #[cfg(feature = "gpu")]
    Gpu(Box<GpuCaster>),
}

/// Jobs in flight.
pub enum Casting {
    /// Already done, on the CPU.
    Done(Vec<Cast>),
    /// In flight on the adapter.
    #[cfg(feature = "gpu")]
    Pending(Box<Pending>),
}

/// The choice of an adapter.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AdapterRequest {
    /// The best GPU that opens, or else the CPU. Software Vulkan must be named: it
    /// runs on the same cores as the CPU caster and is slower.
    #[default]
    Auto,
    /// The CPU, without any graphics driver.
    Cpu,
    /// The first adapter whose name contains this text, ignoring case.
    Named(String),
}

impl FromStr for AdapterRequest {
    type Err = std::convert::Infallible;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        Ok(match text {
            "auto" => Self::Auto,
            "cpu" => Self::Cpu,
            name => Self::Named(name.to_owned()),
        })
    }
}

impl OpenCaster {
    /// The caster that answers `request` and models `effects`.
    pub fn open(request: &AdapterRequest, effects: &Effects) -> Result<Self, CastError> {
        pollster::block_on(Self::open_async(request, effects))
    }

    /// As [`OpenCaster::open`], in a browser too, where nothing may wait.
    pub async fn open_async(
        request: &AdapterRequest,
        effects: &Effects,
    ) -> Result<Self, CastError> {
        match request {
            AdapterRequest::Cpu => Ok(Self::Cpu(effects.clone())),
            AdapterRequest::Auto => Ok(Self::open_best(effects).await.0),
            AdapterRequest::Named(name) => Self::open_named(name, effects).await,
        }
    }

    #[cfg(feature = "gpu")]
    async fn open_named(name: &str, effects: &Effects) -> Result<Self, CastError> {
        let adapter = gpu::find_adapter(name).await?;
        Ok(Self::Gpu(Box::new(GpuCaster::open(&adapter, effects).await?)))
    }

    #[cfg(not(feature = "gpu"))]
    async fn open_named(name: &str, _: &Effects) -> Result<Self, CastError> {
        Err(CastError::NoGpuSupport { wanted: name.to_owned() })
    }

    /// The best GPU that opens, or else the CPU; and why better GPUs did not open.
    #[cfg(feature = "gpu")]
    pub async fn open_best(effects: &Effects) -> (Self, Vec<CastError>) {
        let mut passed_over = Vec::new();
        for adapter in gpu::adapters().await {
            if gpu::kind(&adapter) == gpu::AdapterKind::Software {
                continue;
            }
            match GpuCaster::open(&adapter, effects).await {
                Ok(gpu) => return (Self::Gpu(Box::new(gpu)), passed_over),
                Err(error) => passed_over.push(error),
            }
        }
        (Self::Cpu(effects.clone()), passed_over)
    }

    /// The best caster that opens, which without the feature `gpu` is the CPU.
    #[cfg(not(feature = "gpu"))]
    pub async fn open_best(effects: &Effects) -> (Self, Vec<CastError>) {
        (Self::Cpu(effects.clone()), Vec::new())
    }

    /// The adapter's name, or `cpu`.
    #[must_use]
    pub fn name(&self) -> &str {
        match self {
            Self::Cpu(_) => "cpu",
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => &gpu.summary().name,
        }
    }

    /// The effects that the caster models.
    #[must_use]
    pub fn effects(&self) -> &Effects {
        match self {
            Self::Cpu(effects) => effects,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.effects(),
        }
    }

    /// Whether `target` fits the adapter's bindings; if not, the CPU must cast at it.
    #[must_use]
    #[cfg_attr(not(feature = "gpu"), expect(unused_variables, reason = "the CPU takes any target"))]
    pub fn fits(&self, target: &Target) -> bool {
        match self {
            Self::Cpu(_) => true,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.limits().holds(target),
        }
    }

    /// Starts casting all `jobs` together.
    pub fn submit(&self, jobs: &[CastJob]) -> Result<Casting, CastError> {
        match self {
            Self::Cpu(_) => Ok(Casting::Done(self.cast_on_cpu(jobs))),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => Ok(Casting::Pending(Box::new(gpu.submit(jobs)?))),
        }
    }

    /// Casts `jobs` on the CPU, whatever the adapter.
    #[must_use]
    pub fn cast_on_cpu(&self, jobs: &[CastJob]) -> Vec<Cast> {
        jobs.par_iter().map(|job| cpu::trace::cast(job, self.effects())).collect()
    }

    /// Casts `jobs` and waits.
    pub fn cast(&self, jobs: &[CastJob]) -> Result<Vec<Cast>, CastError> {
        self.submit(jobs)?.wait()
    }

    /// As [`OpenCaster::cast`], in a browser too.
    pub async fn cast_async(&self, jobs: &[CastJob]) -> Result<Vec<Cast>, CastError> {
        self.submit(jobs)?.answers().await
    }
}

impl Casting {
    /// The answers, one per job, in order.
    pub fn wait(self) -> Result<Vec<Cast>, CastError> {
        pollster::block_on(self.answers())
    }

    async fn answers(self) -> Result<Vec<Cast>, CastError> {
        match self {
            Self::Done(casts) => Ok(casts),
            #[cfg(feature = "gpu")]
            Self::Pending(pending) => pending.answers().await,
        }
    }
}
