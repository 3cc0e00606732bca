//! The one switch that decides on which casters a test runs.

use std::sync::{LazyLock, Mutex, PoisonError};

use sim_gpu::effects::Effects;
use sim_gpu::internals::caster::AdapterRequest;
use sim_gpu::internals::caster::OpenCaster;
use sim_gpu::internals::gpu::list_adapters;

/// The CPU twin, and the adapter if there is one.
pub fn casters(effects: &Effects) -> Vec<&'static OpenCaster> {
    [Some(open(&AdapterRequest::Cpu, effects)), adapter(effects).ok()]
        .into_iter()
        .flatten()
        .collect()
}

/// The best adapter, which may be software Vulkan.
pub fn adapter(effects: &Effects) -> Result<&'static OpenCaster, String> {
    static BEST: LazyLock<Option<AdapterRequest>> = LazyLock::new(|| {
        let best = list_adapters().into_iter().next();
        best.map(|adapter| AdapterRequest::Named(adapter.name))
    });
    test_support::adapter(BEST.as_ref().map(|best| open(best, effects)))
}

/// One device per process and set of effects: tests run side by side, and
/// opening a device takes longer than most of them.
fn open(request: &AdapterRequest, effects: &Effects) -> &'static OpenCaster {
    static OPEN: Mutex<Vec<(AdapterRequest, Effects, &OpenCaster)>> = Mutex::new(Vec::new());
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((.., caster)) = open.iter().find(|(r, e, _)| r == request && e == effects) {
        return caster;
    }
    let caster = OpenCaster::open(request, effects).expect("the adapter that was listed opens");
    let caster: &'static OpenCaster = Box::leak(Box::new(caster));
    open.push((request.clone(), effects.clone(), caster));
    caster
}
