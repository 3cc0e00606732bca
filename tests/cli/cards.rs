//! `gen-dataset --card`: the description of a finished dataset. `tests/peers/croissant.py` reads it.

use crate::Folder;

const WORDS: &str = "gen-dataset meshes --adapter cpu --sensor vlp32c --noise 0.01 --views 2 --distance 2,3 --points 64";
const PUBLICATION: &str =
    "--license CC-BY-4.0 --url https://example.org/d --creator Ada --published 2026-11-25";

#[test]
fn a_dataset_of_either_form_has_a_card_and_metadata() {
    let folder = Folder::with_meshes();
    folder.succeeds(&format!("{WORDS} --out files"));
    folder.succeeds(&format!("{WORDS} --out tars --layout webdataset --tar-clouds 4"));
    // Files that the manifest does not list are the user's.
    folder.write("files/train-000001.tar", "mine");
    // 6 meshes for training and 3 for tests, with 2 views each; scans are clean or noisy.
    for (out, manifest, told, held) in [
        (
            "files",
            "manifest.json",
            "36 scans of",
            "rotational-clean-train.npz` | 12 clouds of 64 points |",
        ),
        (
            "tars",
            "dataset.json",
            "18 point clouds of",
            "| 2 tars `test-*.tar` | 6 clouds of 64 points |",
        ),
    ] {
        folder.succeeds(&format!("gen-dataset --card {out} {PUBLICATION}"));
        let (card, metadata) = (
            folder.text(&format!("{out}/README.md")),
            folder.text(&format!("{out}/croissant.json")),
        );
        assert!(card.starts_with("---\nlicense: \"cc-by-4.0\"\npretty_name: "), "{card}");
        assert!(card.contains("at 2 to 3 m and an elevation of 20 degrees"), "{card}");
        let metadata: serde_json::Value = serde_json::from_str(&metadata).unwrap();
        assert!(card.contains(held) && card.contains(told), "{card}");
        assert_eq!(metadata["name"], out);
        for set in metadata["recordSet"].as_array().unwrap() {
            for field in set["field"].as_array().unwrap() {
                // Croissant 1.1: a field's identifier begins with that of its set.
                let [set, id, name] = [&set["@id"], &field["@id"], &field["name"]]
                    .map(|value| value.as_str().unwrap());
                assert_eq!((id, &field["@type"]), (&*format!("{set}/{name}"), &"cr:Field".into()));
            }
        }
        assert_eq!(metadata["license"], "https://spdx.org/licenses/CC-BY-4.0.html");
        assert_eq!(metadata["distribution"][0]["contentUrl"], manifest);
        folder.succeeds(&format!("gen-dataset --verify {out}"));
        // A dataset may be named by its manifest.
        let said = folder
            .succeeds(&format!("gen-dataset --card {out}/{manifest} {PUBLICATION} --overwrite"));
        assert!(said.starts_with(&format!("{out}/README.md")), "{said}");
        folder.succeeds(&format!("gen-dataset --verify {out}/{manifest}"));
    }
}

#[test]
fn a_card_goes_with_its_dataset_unless_its_user_went_on() {
    let folder = Folder::with_meshes();
    let again = "gen-dataset meshes --out out --sensor vlp16 --views 1 --overwrite";
    folder.succeeds(again);
    for addition in ["", "How we measured it.\n"] {
        folder.succeeds(&format!("gen-dataset --card out {PUBLICATION}"));
        folder.write("out/README.md", folder.text("out/README.md") + addition);
        folder.succeeds(again);
        assert_eq!(folder.at("out/README.md").exists(), !addition.is_empty());
        assert!(!folder.at("out/croissant.json").exists());
    }
}
