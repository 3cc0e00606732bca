//! `export-onnx`. That the graphs compute what infer-cpu does is shown by
//! `tests/peers/onnx_runtime.py`.

use crate::{Folder, in_repository};

#[test]
fn a_bundled_model_becomes_the_same_bytes_each_time() {
    let folder = Folder::new();
    let said = folder.succeeds("export-onnx edge-64 --out a.onnx");
    assert!(said.contains("points, cloud -> logits, opset 18"), "{said}");
    folder.succeeds("export-onnx edge-64 --out b.onnx");
    assert_eq!(folder.bytes("a.onnx"), folder.bytes("b.onnx"));
}

#[test]
fn what_cannot_be_exported_is_named_and_nothing_is_written() {
    let folder = Folder::new();
    folder.write("cut.safetensors", b"{}");
    let untrained = in_repository("assets/weights/untrained-test.safetensors");
    std::fs::copy(untrained, folder.at("u.safetensors")).unwrap();
    for (code, words, cause) in [
        (1, "missing", "missing"),
        (1, "cut.safetensors", "too short for safetensors"),
        (
            2,
            "u.safetensors --critical-points",
            "does not state its number of points: give --points",
        ),
        (2, "edge-64 --points 16", "--critical-points"),
        (2, "edge-64 --critical-points --points 0", "--points"),
    ] {
        folder.refuses(code, &[(&format!("export-onnx {words} --out m.onnx"), cause)]);
        assert!(!folder.at("m.onnx").exists(), "{words}");
    }
}
