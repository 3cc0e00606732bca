//! Models: how they are found, and which are rejected.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use formats::weights::Tensor;

use crate::program::{Folder, card, strip};
use crate::tiny_model;

#[test]
fn the_bundled_model_is_untrained_and_must_be_allowed() {
    let folder = Folder::with_cloud(20);
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
    fs::create_dir_all(folder.path("assets/weights")).unwrap();
    let name = "untrained-test.safetensors";
    fs::copy(assets.join(name), folder.path("assets/weights").join(name)).unwrap();
    // Another folder may have a trained model, so this one is named.
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
    let folder = Folder::with_cloud(20);
    let mut command = folder.command("classify c.xyz");
    let output = command.env("EDGEPUCK_MODEL", "m.safetensors").output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    let output = command.env("EDGEPUCK_MODEL", "absent.safetensors").output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8(output.stderr).unwrap().starts_with("error: absent.safetensors: "));
}

/// Checks that a model whose tensors are changed is refused with `cause`.
fn refuses(cause: &str, change: impl FnOnce(&mut BTreeMap<String, Tensor>)) {
    let folder = Folder::with_cloud(20);
    let mut tensors = tiny_model::tensors(4);
    change(&mut tensors);
    tiny_model::write(&folder.path("m.safetensors"), &tensors, &card());
    let expected = format!("error: m.safetensors: tensor `{cause}");
    folder.classify("c.xyz").assert_refused(1, &expected);
    folder.run("inspect m.safetensors").assert_refused(1, &expected);
}

#[test]
fn tensors_that_do_not_fit_are_named_with_both_shapes() {
    let insert = |tensors: &mut BTreeMap<String, Tensor>, name: &str, shape: &[usize]| {
        let values = vec![0.5; shape.iter().product()];
        tensors.insert(name.to_owned(), Tensor { shape: shape.to_vec(), values });
    };
    refuses("feat.conv2.bias`: missing", |all| drop(all.remove("feat.conv2.bias")));
    refuses("fc", |all| insert(all, "fc9.extra", &[2, 3]));
    let unexpected = "other`: unexpected: no layer takes a tensor of this name (shape [2, 3])";
    refuses(unexpected, |all| insert(all, "other", &[2, 3]));
    let shapes = "feat.conv2.weight`: expected shape [16, 8, 1], found [16, 9, 1]";
    refuses(shapes, |all| insert(all, "feat.conv2.weight", &[16, 9, 1]));
    let nan = "fc2.bias`: element 3 is NaN";
    refuses(nan, |all| all.get_mut("fc2.bias").unwrap().values[3] = f32::NAN);
}

#[test]
fn classes_that_do_not_fit_the_logits_are_refused() {
    let folder = Folder::with_cloud(20);
    tiny_model::write(&folder.path("m.safetensors"), &tiny_model::tensors(5), &card());
    let error =
        "error: m.safetensors: metadata `classes`: expected 5 names, one for each logit, found 4";
    folder.classify("c.xyz").assert_refused(1, error);
}

#[test]
fn numbers_of_another_type_are_refused() {
    let folder = Folder::with_cloud(20);
    let path = folder.path("m.safetensors");
    let bytes = fs::read(&path).unwrap();
    // Integers of the same size.
    let at = bytes.windows(5).position(|part| part == b"\"F32\"").unwrap();
    let changed = [&bytes[..at], b"\"I32\"", &bytes[at + 5..]].concat();
    fs::write(&path, changed).unwrap();
    let ran = folder.classify("c.xyz");
    ran.assert_refused(1, "error: m.safetensors: tensor `");
    assert!(ran.err.contains("expected f32 or f16, found I32"), "{}", ran.err);
}

#[test]
fn a_model_that_is_cut_short_or_none_is_refused() {
    let folder = Folder::with_cloud(20);
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
