//! The ways of casting that a run compares.

use anyhow::{Context, Result, bail};
use sim_gpu::caster::AdapterRequest;
use sim_gpu::caster::Caster;
use sim_gpu::effects::Effects;
use sim_gpu::gpu::{AdapterKind, list_adapters};

/// Rays that fill a GPU, so that what is measured is not its idling.
const RAYS_TO_FILL_A_GPU: usize = 1 << 22;

/// Rays that keep the cores busy for some tenths of a second.
const RAYS_TO_FILL_THE_CORES: usize = 1 << 19;

/// One way of casting.
pub struct Lane {
    /// What casts.
    pub caster: Caster,
    /// Rays that one repeat should cast at least.
    pub rays: usize,
    /// Whether it casts beside the CPU, whose time then tells nothing.
    pub is_gpu: bool,
}

impl Lane {
    /// The adapter's name, `cpu` for the twin.
    pub fn name(&self) -> &str {
        self.caster.name()
    }
}

/// The CPU twin and all adapters, or the one that `request` names.
///
/// # Errors
/// If the adapter asked for is not there or does not open.
pub fn open(request: Option<&AdapterRequest>) -> Result<Vec<Lane>> {
    let cpu = Lane {
        caster: Caster::Cpu(Effects::default()),
        rays: RAYS_TO_FILL_THE_CORES,
        is_gpu: false,
    };
    let mut lanes = Vec::new();
    if matches!(request, None | Some(AdapterRequest::Cpu)) {
        lanes.push(cpu);
    }
    for adapter in list_adapters() {
        let wanted = match request {
            None => true,
            Some(AdapterRequest::Auto) => lanes.is_empty(),
            Some(AdapterRequest::Cpu) => false,
            Some(AdapterRequest::Named(name)) => {
                adapter.name.to_lowercase().contains(&name.to_lowercase())
            }
        };
        let known = lanes.iter().any(|lane: &Lane| lane.name() == adapter.name);
        if wanted && !known {
            let named = AdapterRequest::Named(adapter.name.clone());
            let caster = Caster::open(&named, &Effects::default())
                .with_context(|| format!("opening {}", adapter.name))?;
            let software = adapter.kind == AdapterKind::Software;
            let rays = if software { RAYS_TO_FILL_THE_CORES } else { RAYS_TO_FILL_A_GPU };
            lanes.push(Lane { caster, rays, is_gpu: !software });
        }
    }
    if lanes.is_empty() {
        bail!("no adapter answers to that name; `cargo xtask adapters` lists them");
    }
    Ok(lanes)
}
