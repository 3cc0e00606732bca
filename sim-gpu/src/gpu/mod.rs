//! Casting on a GPU, or on software Vulkan, through wgpu.

pub(crate) mod adapter;
mod batch;
mod caster;
mod compose;
mod slot;

pub use adapter::{AdapterError, AdapterKind, AdapterRequest, AdapterSummary, list_adapters};
pub use batch::{Batch, BatchLimits};
pub use caster::{GpuCaster, GpuError, Pending};
pub use compose::{Input, Module, compose, modules, reads, words_per_ray};
