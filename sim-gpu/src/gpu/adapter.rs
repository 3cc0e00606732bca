//! The adapters of this machine.

use std::fmt;

use crate::cast_error::CastError;

/// The kinds of adapters, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A GPU with its own memory.
    Discrete,
    /// A GPU that shares the CPU's memory.
    Integrated,
    /// A GPU that the host of a virtual machine provides.
    Virtual,
    /// A device that its driver does not describe.
    Other,
    /// Vulkan in software, such as lavapipe.
    Software,
}

impl fmt::Display for AdapterKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Discrete => "discrete GPU",
            Self::Integrated => "integrated GPU",
            Self::Virtual => "virtual GPU",
            Self::Other => "unknown device",
            Self::Software => "software",
        })
    }
}

/// The description of an adapter.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterSummary {
    /// The device's name.
    pub name: String,
    /// The kind of the device.
    pub kind: AdapterKind,
    /// The graphics interface, such as Vulkan.
    pub backend: String,
    /// The driver and its version.
    pub driver: String,
    /// The size limit of a binding, bytes.
    pub max_binding_bytes: u64,
}

/// All adapters, best first.
#[must_use]
pub fn list_adapters() -> Vec<AdapterSummary> {
    pollster::block_on(adapters()).iter().map(summary).collect()
}

/// The best adapter whose name contains `wanted`.
pub(crate) async fn find_adapter(wanted: &str) -> Result<wgpu::Adapter, CastError> {
    let mut adapters = adapters().await;
    let holds =
        |a: &wgpu::Adapter| a.get_info().name.to_lowercase().contains(&wanted.to_lowercase());
    match adapters.iter().position(holds) {
        Some(at) => Ok(adapters.swap_remove(at)),
        None => Err(CastError::NoSuchAdapter {
            wanted: wanted.to_owned(),
            present: adapters.iter().map(|a| a.get_info().name).chain(["cpu".to_owned()]).collect(),
        }),
    }
}

pub(crate) fn summary(adapter: &wgpu::Adapter) -> AdapterSummary {
    let info = adapter.get_info();
    AdapterSummary {
        kind: kind(adapter),
        backend: info.backend.to_string(),
        driver: format!("{} {}", info.driver, info.driver_info).trim().to_owned(),
        max_binding_bytes: adapter.limits().max_storage_buffer_binding_size,
        name: info.name,
    }
}

/// All adapters that can compute, best first. A browser shows one at most, which it chooses.
pub(crate) async fn adapters() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let mut adapters = instance.enumerate_adapters(wgpu::Backends::PRIMARY).await;
    adapters.retain(|adapter| {
        let flags = adapter.get_downlevel_capabilities().flags;
        flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
    });
    adapters.sort_by_key(kind);
    adapters
}

pub(crate) fn kind(adapter: &wgpu::Adapter) -> AdapterKind {
    match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => AdapterKind::Discrete,
        wgpu::DeviceType::IntegratedGpu => AdapterKind::Integrated,
        wgpu::DeviceType::VirtualGpu => AdapterKind::Virtual,
        wgpu::DeviceType::Other => AdapterKind::Other,
        wgpu::DeviceType::Cpu => AdapterKind::Software,
    }
}
