//! Messages for extreme clouds and weights. `tests/extremes` has the expected classes.

use crate::program::{Folder, card};
use crate::tiny_model;

#[test]
fn no_point_has_no_class() {
    let folder = Folder::new();
    folder.write("c.xyz", "");
    folder.classify("c.xyz").assert_refused(1, "error: c.xyz: ");
    formats::cloud_file::write_cloud(&folder.path("c.npy"), &[]).unwrap();
    folder.classify("c.npy").assert_refused(1, "error: c.npy: the cloud has no points\n");
    let found = &folder.classify_json("c.npy")[0];
    assert_eq!(found["error"], "c.npy: the cloud has no points");
    assert_eq!(found["file"], "c.npy");
}

#[test]
fn what_is_not_finite_is_refused_or_dropped_and_counted() {
    let folder = Folder::new();
    for (word, told) in [("nan", "NaN"), ("inf", "inf"), ("-inf", "-inf")] {
        folder.write("c.xyz", format!("0 0 0\n1 2 3\n4 {word} 6\n7 8 10\n{word} 0 0\n"));
        let error =
            format!("error: c.xyz: point 2: expected finite coordinates, found (4, {told}, 6)\n");
        folder.classify("c.xyz").assert_refused(1, &error);
        let found = &folder.classify_json("--drop-invalid c.xyz")[0];
        assert_eq!((&found["points"], &found["dropped"]), (&3.into(), &2.into()));
        let ran = folder.classify("--drop-invalid c.xyz");
        assert_eq!(ran.code, 0);
        assert_eq!(ran.err, "warning: c.xyz: 2 points that are not finite were dropped\n");
        folder.write("clean.xyz", "0 0 0\n1 2 3\n7 8 10\n");
        assert_eq!(found["logits"], folder.classify_json("clean.xyz")[0]["logits"]);
    }
    folder.write("c.xyz", "nan 0 0\n");
    let ran = folder.classify("--drop-invalid c.xyz");
    ran.assert_refused(1, "error: c.xyz: the cloud has no points");
}

/// Writes a model whose tensor `name` is `factor` times as large.
fn scaled_model(folder: &Folder, name: &str, factor: f32) {
    let mut tensors = tiny_model::tensors(4);
    tiny_model::scale(&mut tensors, name, factor);
    tiny_model::write(&folder.path("m.safetensors"), &tensors, &card());
}

#[test]
fn what_overflows_f16_is_computed_in_f32() {
    let folder = Folder::with_cloud(60);
    scaled_model(&folder, "feat.conv1.weight", 1e6);
    let ran = folder.classify("--precision f16 c.xyz");
    assert_eq!(ran.code, 0);
    assert_eq!(
        ran.err,
        "warning: c.xyz: f16 overflows on this cloud, which was classified in f32 instead\n"
    );
    let f16 = &folder.classify_json("--precision f16 c.xyz")[0];
    let f32 = &folder.classify_json("--precision f32 c.xyz")[0];
    assert_eq!(f16["precision"], "f32");
    assert_eq!(f16["logits"], f32["logits"]);
}

#[test]
fn what_overflows_f32_has_no_class() {
    let folder = Folder::with_cloud(60);
    // Activations of trunk or T-Net reach 1e48.
    for net in ["feat", "feat.stn", "feat.fstn"] {
        let mut tensors = tiny_model::tensors(4);
        for layer in ["conv1", "conv2", "conv3"] {
            tiny_model::scale(&mut tensors, &format!("{net}.{layer}.weight"), 1e12);
        }
        let first = if net == "feat" { "fc1" } else { &format!("{net}.fc1") };
        tiny_model::scale(&mut tensors, &format!("{first}.weight"), 1e12);
        tiny_model::write(&folder.path("m.safetensors"), &tensors, &card());
        for precision in ["f32", "f32-fc16", "f16"] {
            let ran = folder.classify(&format!("--precision {precision} c.xyz"));
            ran.assert_refused(1, "error: c.xyz: the network overflows");
        }
    }
}

#[test]
fn int8_counts_what_its_calibration_clips() {
    let folder = Folder::with_cloud(60);
    let mut narrow = card();
    let layers = ["conv1", "conv2", "stn.conv1", "stn.conv2", "fstn.conv1", "fstn.conv2"];
    narrow.activation_ranges = layers.map(|layer| (format!("feat.{layer}"), 1e-3)).into();
    tiny_model::write(&folder.path("m.safetensors"), &tiny_model::tensors(4), &narrow);
    let n = folder.classify_json("--precision i8 c.xyz")[0]["clipped"].as_u64().unwrap();
    assert!(n > 0);
    let ran = folder.classify("--precision i8 c.xyz");
    assert_eq!(ran.code, 0);
    let expected = format!(
        "warning: c.xyz: {n} activations were above the calibrated range of i8 and were clipped to it\n"
    );
    assert_eq!(ran.err, expected);
}
