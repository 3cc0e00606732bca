//! `export-onnx`. That the graphs compute what infer-cpu does is shown by
//! `tests/peers/onnx_runtime.py`.

use crate::{exits, said, succeeds};
use std::fs;

#[test]
fn a_bundled_model_becomes_the_same_bytes_each_time() {
    let folder = tempfile::tempdir().unwrap();
    let output = succeeds(folder.path(), "export-onnx edge-64 --out a.onnx");
    assert!(said(&output).contains("points, cloud -> logits, opset 18"), "{}", said(&output));
    succeeds(folder.path(), "export-onnx edge-64 --out b.onnx");
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert_eq!(bytes("a.onnx"), bytes("b.onnx"));
}

#[test]
fn what_cannot_be_exported_is_named_and_nothing_is_written() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("cut.safetensors"), b"{}").unwrap();
    for (code, words, cause) in [
        (1, "missing", "missing"),
        (1, "cut.safetensors", "too short for safetensors"),
        (2, "untrained-test --critical-points", "name a number by --points"),
        (2, "edge-64 --points 16", "--critical-points"),
        (2, "edge-64 --critical-points --points 0", "--points"),
    ] {
        let told = exits(code, folder.path(), &format!("export-onnx {words} --out m.onnx"));
        assert!(told.contains(cause), "{words}: {told}");
        assert!(!folder.path().join("m.onnx").exists(), "{words}");
    }
}
