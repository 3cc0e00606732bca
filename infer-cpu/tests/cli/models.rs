//! Models: where they are found, and what is refused of them.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use formats::model_card::ModelCard;
use formats::weights::Tensor;

use crate::program::{Folder, card, strip};
use crate::tiny_model;

#[test]
fn the_bundled_model_is_untrained_and_must_be_allowed() {
    let folder = Folder::new();
    folder.cloud("c.xyz", &strip(20));
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
    fs::create_dir_all(folder.path("assets/weights")).unwrap();
    let name = "untrained-test.safetensors";
    fs::copy(assets.join(name), folder.path("assets/weights").join(name)).unwrap();
    // Named, for the trained model that another place may hold.
    let named = format!("--model assets/weights/{name}");
    let ran = folder.run(&format!("classify {named} c.xyz"));
    ran.assert_refused(2, &format!("error: assets/weights/{name} is untrained: its weights"));
    assert!(ran.err.contains("--allow-untrained"));
    let ran = folder.run(&format!("classify {named} --allow-untrained c.xyz"));
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
    let ran = folder.run("classify --allow-untrained c.xyz");
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
}

#[test]
fn a_variable_names_the_model_where_no_flag_does() {
    let folder = Folder::new();
    folder.cloud("c.xyz", &strip(20));
    let mut command = folder.command("classify c.xyz");
    let output = command.env("EDGEPUCK_MODEL", "m.safetensors").output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let output = command.env("EDGEPUCK_MODEL", "absent.safetensors").output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8(output.stderr).unwrap().starts_with("error: absent.safetensors: "));
}

/// Classifies with a model whose tensors are changed, which must be refused
/// with `cause`.
fn refuses(change: impl FnOnce(&mut BTreeMap<String, Tensor>), card: &ModelCard, cause: &str) {
    let folder = Folder::new();
    folder.cloud("c.xyz", &strip(20));
    let mut tensors = tiny_model::tensors(4);
    change(&mut tensors);
    tiny_model::write(&folder.path("m.safetensors"), &tensors, card);
    let expected = format!("error: m.safetensors: {cause}");
    folder.classify("c.xyz").assert_refused(1, &expected);
    folder.run("inspect m.safetensors").assert_refused(1, &expected);
}

#[test]
fn tensors_that_do_not_fit_are_named_with_both_shapes() {
    let card = card();
    let tensor = |shape: &[usize]| Tensor {
        shape: shape.to_vec(),
        values: vec![0.5; shape.iter().product()],
    };
    refuses(
        |tensors| drop(tensors.remove("feat.conv2.bias")),
        &card,
        "tensor `feat.conv2.bias`: missing",
    );
    refuses(
        |tensors| drop(tensors.insert("fc9.extra".to_owned(), tensor(&[2, 3]))),
        &card,
        "tensor `fc",
    );
    refuses(
        |tensors| drop(tensors.insert("other".to_owned(), tensor(&[2, 3]))),
        &card,
        "tensor `other`: unexpected: no layer takes a tensor of this name (shape [2, 3])",
    );
    refuses(
        |tensors| drop(tensors.insert("feat.conv2.weight".to_owned(), tensor(&[16, 9, 1]))),
        &card,
        "tensor `feat.conv2.weight`: expected shape [16, 8, 1], found [16, 9, 1]",
    );
    refuses(
        |tensors| tensors.get_mut("fc2.bias").unwrap().values[3] = f32::NAN,
        &card,
        "tensor `fc2.bias`: element 3 is NaN",
    );
}

#[test]
fn classes_that_do_not_fit_the_logits_are_refused() {
    let folder = Folder::new();
    folder.cloud("c.xyz", &strip(20));
    tiny_model::write(&folder.path("m.safetensors"), &tiny_model::tensors(5), &card());
    let error =
        "error: m.safetensors: metadata `classes`: expected 5 names, one for each logit, found 4";
    folder.classify("c.xyz").assert_refused(1, error);
}

#[test]
fn numbers_of_another_type_are_refused() {
    let folder = Folder::new();
    folder.cloud("c.xyz", &strip(20));
    let path = folder.path("m.safetensors");
    let bytes = fs::read(&path).unwrap();
    // Of as many bytes: integers.
    let at = bytes.windows(5).position(|part| part == b"\"F32\"").unwrap();
    let changed = [&bytes[..at], b"\"I32\"", &bytes[at + 5..]].concat();
    fs::write(&path, changed).unwrap();
    let ran = folder.classify("c.xyz");
    ran.assert_refused(1, "error: m.safetensors: tensor `");
    assert!(ran.err.contains("expected f32 or f16, found I32"), "{}", ran.err);
}

#[test]
fn a_model_that_is_cut_short_or_none_is_refused() {
    let folder = Folder::new();
    folder.cloud("c.xyz", &strip(20));
    let path = folder.path("m.safetensors");
    let whole = fs::read(&path).unwrap();
    for length in [0, 7, 8, 100, whole.len() / 2, whole.len() - 1] {
        fs::write(&path, &whole[..length]).unwrap();
        folder.classify("c.xyz").assert_refused(1, "error: m.safetensors: header: ");
    }
    fs::write(&path, strip(20).iter().map(|p| format!("{p:?}\n")).collect::<String>()).unwrap();
    folder
        .classify("c.xyz")
        .assert_refused(1, "error: m.safetensors: header: expected safetensors");
}
