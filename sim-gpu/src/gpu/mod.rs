//! Casting on a GPU, or on software Vulkan, through wgpu.

mod adapter;
mod batch;
mod caster;
mod compose;

pub use adapter::{AdapterError, AdapterKind, AdapterRequest, AdapterSummary, list_adapters};
pub use batch::{Batch, BatchLimits};
pub use caster::{GpuCaster, GpuError, Pending};
pub use compose::{compose, modules};
pub(crate) use adapter::find_adapter;
