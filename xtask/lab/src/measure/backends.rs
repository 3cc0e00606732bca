//! The casters that a run compares.

use anyhow::{Context, Result, bail};
use sim_gpu::effects::Effects;
use sim_gpu::internals::caster::{AdapterRequest, OpenCaster};
use sim_gpu::internals::gpu::{AdapterKind, AdapterSummary, list_adapters};

/// Rays that fill a GPU, so that no idle time is measured.
const RAYS_TO_FILL_A_GPU: usize = 1 << 22;

/// Rays that keep the cores busy for some tenths of a second.
const RAYS_TO_FILL_THE_CORES: usize = 1 << 19;

pub struct Backend {
    pub caster: OpenCaster,
    /// Rays that one repeat should cast at least.
    pub rays: usize,
}

impl Backend {
    pub fn name(&self) -> &str {
        self.caster.name()
    }

    /// The request that opens another caster on the same adapter.
    pub fn request(&self) -> AdapterRequest {
        match &self.caster {
            OpenCaster::Cpu(_) => AdapterRequest::Cpu,
            OpenCaster::Gpu(_) => AdapterRequest::Named(self.name().to_owned()),
        }
    }
}

/// The CPU and all adapters, or the one that `request` names, which must be there.
pub fn open(request: Option<&AdapterRequest>) -> Result<Vec<Backend>> {
    let mut backends = Vec::new();
    if matches!(request, None | Some(AdapterRequest::Cpu)) {
        backends.push(cpu());
    }
    for adapter in list_adapters() {
        let wanted = match request {
            None => true,
            Some(AdapterRequest::Auto) => backends.is_empty(),
            Some(AdapterRequest::Cpu) => false,
            Some(AdapterRequest::Named(name)) => {
                adapter.name.to_lowercase().contains(&name.to_lowercase())
            }
        };
        let known = backends.iter().any(|backend: &Backend| backend.name() == adapter.name);
        if wanted && !known {
            backends.push(of_adapter(&adapter)?);
        }
    }
    if backends.is_empty() {
        bail!("expected an adapter of that name; `cargo xtask scan --adapter list` lists them");
    }
    Ok(backends)
}

pub fn cpu() -> Backend {
    let caster = OpenCaster::Cpu(Effects::default());
    Backend { caster, rays: RAYS_TO_FILL_THE_CORES }
}

/// The first adapter that has the name of `adapter`.
pub fn of_adapter(adapter: &AdapterSummary) -> Result<Backend> {
    let named = AdapterRequest::Named(adapter.name.clone());
    let caster = OpenCaster::open(&named, &Effects::default())
        .with_context(|| format!("opening {}", adapter.name))?;
    let is_gpu = adapter.kind != AdapterKind::Software;
    let rays = if is_gpu { RAYS_TO_FILL_A_GPU } else { RAYS_TO_FILL_THE_CORES };
    Ok(Backend { caster, rays })
}

pub fn short(name: &str) -> String {
    name.split(" (").next().unwrap_or(name).to_owned()
}
