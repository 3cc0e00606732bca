//! Casting on a GPU, or on software Vulkan, through wgpu.

mod adapter;
#[cfg(test)]
mod aim_tests;
mod batch;
mod caster;
mod clock;
mod compose;
mod pipeline;
mod slot;

pub use adapter::{AdapterKind, AdapterSummary, list_adapters};
pub(crate) use adapter::{adapters, find_adapter, kind};
pub use batch::{Batch, BatchLimits, View};
pub use caster::{GpuCaster, Pending};
pub use compose::compose;
