//! The one switch that decides on which casters a test runs.

use std::sync::{Mutex, Once, PoisonError};

use sim_gpu::caster::Caster;
use sim_gpu::effects::Effects;
use sim_gpu::gpu::AdapterRequest;

/// Set to 1, a missing adapter fails the tests that want one.
pub const REQUIRE_ADAPTER: &str = "EDGEPUCK_REQUIRE_ADAPTER";

const NO_ADAPTER: &str = "there is no GPU and no software Vulkan";

/// The CPU twin, and the adapter if there is one.
#[must_use]
pub fn casters(effects: &Effects) -> Vec<&'static Caster> {
    [Some(open(&AdapterRequest::Cpu, effects)), adapter(effects)].into_iter().flatten().collect()
}

/// The best adapter; without any, one line says that this half did not run.
///
/// # Panics
/// If there is none and [`REQUIRE_ADAPTER`] is 1.
#[must_use]
pub fn adapter(effects: &Effects) -> Option<&'static Caster> {
    static SAID: Once = Once::new();
    let caster = open(&AdapterRequest::Auto, effects);
    let is_there = matches!(caster, Caster::Gpu(_));
    let required = std::env::var(REQUIRE_ADAPTER).is_ok_and(|value| value == "1");
    assert!(is_there || !required, "{REQUIRE_ADAPTER}=1, but {NO_ADAPTER}");
    SAID.call_once(|| {
        if is_there {
            println!("adapter: {}", caster.name());
        } else {
            println!("the GPU half did not run: {NO_ADAPTER}");
        }
    });
    is_there.then_some(caster)
}

/// One device per process and set of effects: tests run side by side, and
/// opening a device takes longer than most of them.
fn open(request: &AdapterRequest, effects: &Effects) -> &'static Caster {
    static OPEN: Mutex<Vec<(AdapterRequest, Effects, &Caster)>> = Mutex::new(Vec::new());
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((.., caster)) = open.iter().find(|(r, e, _)| r == request && e == effects) {
        return caster;
    }
    let caster = Caster::open(request, effects).expect("the adapter that was listed opens");
    let caster: &'static Caster = Box::leak(Box::new(caster));
    open.push((request.clone(), effects.clone(), caster));
    caster
}
