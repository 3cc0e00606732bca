//! The adapters of this machine.

use std::fmt;

use crate::cast_error::CastError;

/// What sort of device an adapter is, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum AdapterKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the CPU's memory.
    Integrated,
    /// A GPU lent by a virtual machine's host.
    Virtual,
    /// A driver that says nothing of its device.
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

/// One adapter, for people to choose from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AdapterSummary {
    /// The device's name.
    pub name: String,
    /// What sort of device it is.
    pub kind: AdapterKind,
    /// The graphics interface, such as Vulkan.
    pub backend: String,
    /// The driver and its version.
    pub driver: String,
    /// The largest buffer one binding can show, bytes.
    pub max_binding_bytes: u64,
}

/// All adapters, best first.
#[must_use]
pub fn list_adapters() -> Vec<AdapterSummary> {
    adapters().iter().map(summary).collect()
}

/// The first adapter whose name holds `wanted`, best first.
pub(crate) fn find_adapter(wanted: &str) -> Result<wgpu::Adapter, CastError> {
    let mut adapters = adapters();
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

/// What there is to say of `adapter`.
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

/// All adapters that can compute, best first.
pub(crate) fn adapters() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let mut adapters: Vec<_> =
        pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY))
            .into_iter()
            .filter(|a| {
                a.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS)
            })
            .collect();
    adapters.sort_by_key(kind);
    adapters
}

/// What sort of device `adapter` is.
pub(crate) fn kind(adapter: &wgpu::Adapter) -> AdapterKind {
    match adapter.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => AdapterKind::Discrete,
        wgpu::DeviceType::IntegratedGpu => AdapterKind::Integrated,
        wgpu::DeviceType::VirtualGpu => AdapterKind::Virtual,
        wgpu::DeviceType::Other => AdapterKind::Other,
        wgpu::DeviceType::Cpu => AdapterKind::Software,
    }
}
