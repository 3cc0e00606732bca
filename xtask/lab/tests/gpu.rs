//! `bench gpu`, in the small size, on the adapter that there is, as users run it in a temporary folder.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on should stop")]

use serde_json::Value;
use sim_gpu::effects::Effects;
use sim_gpu::internals::gpu::{AdapterKind, list_adapters};
use std::path::Path;
use std::process::Command;
use test_support::need;

/// Runs the laboratory's program with the words, separated by spaces, in `folder`, and expects this exit
/// code; returns what it printed.
fn exits(code: i32, folder: &Path, words: &str) -> String {
    let mut program = Command::new(env!("CARGO_BIN_EXE_edgepuck-lab"));
    let output = program.current_dir(folder).args(words.split_whitespace()).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    let said = text(&output.stdout) + &text(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{words}\n{said}");
    said
}

#[test]
fn a_small_run_compares_every_shader_and_measures_everything() {
    need!(harness::adapter::adapter(&Effects::default()));
    let folder = tempfile::tempdir().unwrap();
    exits(0, folder.path(), "bench gpu --all --quick --out out");
    let written = std::fs::read_to_string(folder.path().join("out/gpu.json")).unwrap();
    let report: Value = serde_json::from_str(&written).unwrap();
    let parts = report["parts"].as_array().unwrap();
    let names: Vec<&str> = parts.iter().map(|part| part["name"].as_str().unwrap()).collect();
    assert_eq!(
        names,
        ["scans", "rays at vertices and edges", "effects", "speed", "batches", "datasets"]
    );
    assert!(parts.iter().all(|part| part["figures"] != Value::Null), "{written}");
    let checks = report["checks"].as_array().unwrap();
    assert!(checks.iter().all(|check| check["passed"] == true), "{checks:?}");
    // Scans, rays at edges, four effects and batches, of each adapter; rays at edges and batches, of the
    // CPU.
    let mut adapters: Vec<String> = list_adapters().into_iter().map(|a| a.name).collect();
    adapters.sort_unstable();
    adapters.dedup();
    assert_eq!(checks.len(), 7 * adapters.len() + 2, "{checks:?}");
    let rays = &parts[1]["figures"];
    for caster in rays.as_array().unwrap() {
        // 162 vertices and 480 edges, from 20 places.
        assert_eq!((&caster["rays"], &caster["missed"]), (&12_840.into(), &0.into()), "{rays}");
    }
}

#[test]
fn software_vulkan_is_measured_only_if_asked_for() {
    if list_adapters().iter().any(|adapter| adapter.kind != AdapterKind::Software) {
        return test_support::skip("this machine has a GPU");
    }
    let folder = tempfile::tempdir().unwrap();
    let said = exits(1, folder.path(), "bench gpu --quick --out out");
    assert!(said.contains("expected a GPU"), "{said}");
    assert!(!folder.path().join("out").exists());
}
