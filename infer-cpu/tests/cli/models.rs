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
    let named = format!("--model assets/weights/{name}");
    let ran = folder.run(&format!("classify {named} c.xyz"));
    ran.assert_refused(2, &format!("error: assets/weights/{name} is untrained: its weights"));
    assert!(ran.err.contains("--allow-untrained"));
    let ran = folder.run(&format!("classify {named} --allow-untrained c.xyz"));
    assert_eq!((ran.code, ran.err.as_str()), (0, ""));
}

/// The program is not in a checkout, as far as it knows.
#[test]
fn bundled_models_are_known_by_name_in_any_folder() {
    let folder = Folder::with_cloud(20);
    let (default, named) = (folder.run("classify c.xyz"), "classify --model edge-64 c.xyz");
    assert_eq!((default.code, default.err.as_str()), (0, ""));
    assert_eq!(folder.run(named).out, default.out);
    let weights = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights");
    for model in ["edge-64", "set-64", "street-128", "shapes-rotational-64"] {
        let file = weights.join(model).with_extension("safetensors");
        fs::copy(file, folder.path("x.safetensors")).unwrap();
        let line = |model: &str| format!("classify --model {model} --json --precision i8 c.xyz");
        let logits = |model: &str| folder.run(&line(model)).json()[0]["logits"].clone();
        assert_eq!(logits(model), logits("x.safetensors"));
        assert_eq!(folder.run(&format!("inspect {model}")).code, 0);
    }
}

/// A data set of gen-dataset, by its manifest, and a scan without one, by its rings.
#[test]
fn scans_of_known_classes_use_the_model_of_scans_by_default() {
    let folder = Folder::with_cloud(40);
    let vertex = |[x, y, z]: [f64; 3]| format!("{x} {y} {z} 1\n");
    let vertices: String = strip(40).into_iter().map(vertex).collect();
    let header = "ply\nformat ascii 1.0\nelement vertex 40\nproperty float x\nproperty float y\n\
                  property float z\nproperty ushort ring\nend_header\n";
    folder.write("scan.ply", format!("{header}{vertices}"));
    let place = |set: &str| format!("{set}/rotational/noisy/chair/test/c.xyz");
    for (set, class) in [("known", "bowl"), ("other", "sofa")] {
        fs::create_dir_all(folder.path(&place(set)).parent().unwrap()).unwrap();
        fs::copy(folder.path("c.xyz"), folder.path(&place(set))).unwrap();
        let meshes = format!(r#"[{{"class": "chair", "up": "z"}}, {{"class": "{class}"}}]"#);
        let manifest = format!(r#"{{"tool": "edgepuck", "meshes": {meshes}}}"#);
        folder.write(&format!("{set}/manifest.json"), manifest);
    }
    let logits = |line: &str| {
        let ran = folder.run(&format!("classify --json {line}"));
        let logits = ran.json().iter().map(|answer| answer["logits"].clone()).collect::<Vec<_>>();
        (logits, ran.err)
    };
    let (known, other) = (place("known"), place("other"));
    let (of_scans, _) = logits(&format!("--model shapes-rotational-64 {known}"));
    let (of_objects, err) = logits(&format!("--model edge-64 {other} scan.ply"));
    assert_eq!(err, "");
    let note = format!("note: {known} is a scan of one side: shapes-rotational-64");
    let warning = format!("warning: {other} is a scan of one side, and edge-64 learnt whole");
    let (found, err) = logits(&format!("{known} {known}"));
    assert_eq!(found, [of_scans.clone(), of_scans.clone()].concat());
    assert!(err.starts_with(&note) && err.lines().count() == 1, "{err}");
    let (found, err) = logits(&format!("{other} scan.ply c.xyz"));
    assert_eq!(found[..2], of_objects);
    assert!(err.starts_with(&warning) && err.lines().count() == 1, "{err}");
    let (_, err) = logits("scan.ply");
    assert!(err.starts_with("warning: scan.ply is a scan of one side"), "{err}");
    assert_eq!(logits("c.xyz").1, "");
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
fn truncated_models_are_refused() {
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
