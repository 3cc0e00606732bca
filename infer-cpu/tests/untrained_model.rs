//! Checks that the bundled model with random weights is the generated one. `UPDATE_GOLDEN=1`
//! rewrites it.

use crate::tiny_model;
use std::path::Path;

use formats::model_card::ModelCard;

#[test]
fn the_untrained_model_is_made_by_rule() {
    let card = ModelCard {
        classes: ["chair", "cup", "lamp", "table"].map(str::to_owned).to_vec(),
        trained: false,
        provenance: Some(
            "random weights, made by rule for tests: infer-cpu/tests/untrained_model.rs".to_owned(),
        ),
        ..ModelCard::default()
    };
    let golden =
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights/untrained-test.safetensors");
    let folder = tempfile::tempdir().unwrap();
    let made = folder.path().join("untrained-test.safetensors");
    tiny_model::write(&made, &tiny_model::tensors(card.classes.len()), &card);
    let made = std::fs::read(made).unwrap();
    assert!(made.len() <= 64 << 10, "{} bytes", made.len());
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&golden, &made).unwrap();
    }
    let found = std::fs::read(&golden).unwrap_or_default();
    assert!(found == made, "{} is stale: UPDATE_GOLDEN=1 writes it anew", golden.display());
}
