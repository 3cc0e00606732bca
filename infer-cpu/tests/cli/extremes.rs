//! Messages for extreme clouds and weights. `tests/extremes` has the expected classes.

use crate::program::{Folder, card};
use crate::tiny_model;

#[test]
fn points_that_are_not_finite_are_dropped_if_asked() {
    let folder = Folder::new();
    folder.write("clean.xyz", "5 0 0\n1 2 3\n7 8 10\n");
    for word in ["nan", "inf", "-inf"] {
        folder.write("c.xyz", format!("5 0 0\n1 2 3\n4 {word} 6\n7 8 10\n{word} 0 0\n"));
        let found = &folder.classify_json("--drop-invalid c.xyz")[0];
        assert_eq!((&found["points"], &found["dropped"]), (&3.into(), &2.into()));
        assert_eq!(found["logits"], folder.classify_json("clean.xyz")[0]["logits"]);
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
