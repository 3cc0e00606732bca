//! `inspect`: the content and cost of a model.

use test_support::{need, shared_data};

use crate::program::Folder;

#[test]
fn a_model_is_shown_layer_by_layer() {
    let folder = Folder::new();
    let ran = folder.run("inspect m.safetensors");
    assert_eq!(ran.code, 0, "{}", ran.err);
    for line in [
        "trained         yes",
        "classes         4: a, b, c, d",
        "sampler         all",
        "input T-Net     3-8-16-64, max, 64-32-16-9",
        "feature T-Net   8-8-16-64, max, 64-32-16-64, after conv1",
        "trunk           3-8-16-64, max",
        "head            64-32-16-4",
        "front end       none of its own",
        "int8            not calibrated: loading uses generated shapes",
    ] {
        assert!(ran.out.lines().any(|found| found == line), "{line}: {}", ran.out);
    }
    let json = &folder.run("inspect --json m.safetensors").json()[0];
    assert_eq!(
        json["trunk"][1],
        serde_json::json!({"name": "feat.conv2", "inputs": 8, "outputs": 16})
    );
    // 3*8 + 8*16 + 16*64 twice, 8*8 + 8*16 + 16*64 once; 3*3; 8*8.
    assert_eq!(json["macs_per_point"], 2 * 1176 + 1216 + 9 + 64);
    // 64*32 + 32*16 three times; 16*9, 16*64, 16*4.
    assert_eq!(json["macs_per_cloud"], 3 * 2560 + 16 * (9 + 64 + 4));
    assert_eq!(json["parameters"], json["stored"]);
    assert_eq!(json["bytes"]["f32"].as_u64(), json["parameters"].as_u64().map(|n| 4 * n));
}

/// The numbers of the baseline in its authors' code.
#[test]
fn the_baseline_has_its_known_cost() {
    let model = need!(shared_data("parity/pointnet.safetensors"));
    let folder = Folder::new();
    let json = &folder.run(&format!("inspect --json {}", model.display())).json()[0];
    assert_eq!(json["macs_per_point"], 426_377);
    assert_eq!(json["macs_per_cloud"], 3_027_200);
    assert_eq!(json["parameters"], 3_459_569);
}
