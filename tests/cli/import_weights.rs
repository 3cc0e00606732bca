//! `import-weights`: from PyTorch checkpoints to model files.

use crate::{Folder, checkpoints, in_repository};
use formats::model_card::{ModelCard, Normalization};
use formats::weights::{Tensor, WeightsFile};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use test_support::{need, shared_data};

type Tensors = BTreeMap<String, Tensor>;

type Change<'a> = &'a dyn Fn(&mut Tensors);

/// The tensor that `tests/golden/checkpoints/make.py` wrote under our name `name`.
fn golden_value(name: &str, element: usize) -> f32 {
    let step = (name.bytes().map(usize::from).sum::<usize>() + 7 * element) % 61;
    let step = step as f32;
    if name.ends_with("running_var") { (step + 1.0) / 64.0 } else { (step - 30.0) / 64.0 }
}

fn golden(name: &str) -> PathBuf {
    in_repository("tests/golden/checkpoints").join(name)
}

fn read(path: &Path) -> (Tensors, ModelCard) {
    let mut file = WeightsFile::open(path).unwrap();
    let card = ModelCard::from_metadata(path, &file.metadata()).unwrap();
    let names = file.shapes().into_keys();
    (names.map(|name| (name.clone(), file.read(&name).unwrap())).collect(), card)
}

fn words(checkpoint: &Path, flags: &str) -> String {
    format!("import-weights {} --overwrite --out m.safetensors {flags}", checkpoint.display())
}

impl Folder {
    fn imports(&self, checkpoint: &Path, flags: &str) -> (Tensors, ModelCard) {
        self.succeeds(&words(checkpoint, flags));
        read(&self.at("m.safetensors"))
    }
}

#[test]
fn every_storage_type_layout_and_wrapper_becomes_the_same_f32() {
    let folder = Folder::new();
    for (name, n_layers, n_norms) in [("yanx27.pth", 18, 15), ("3dcertify_legacy.pth", 8, 7)] {
        let (tensors, _) = folder.imports(&golden(name), "");
        assert_eq!(tensors.len(), 2 * n_layers + 4 * n_norms);
        for (name, tensor) in &tensors {
            let expected = (0..tensor.values.len()).map(|element| golden_value(name, element));
            assert!(tensor.values.iter().copied().eq(expected), "{name}");
        }
    }
}

#[test]
fn a_card_holds_what_table_and_checkpoint_say() {
    let folder = Folder::new();
    let (_, card) = folder.imports(&golden("3dcertify_legacy.pth"), "");
    let digest = formats::hash::of_file(&golden("3dcertify_legacy.pth")).unwrap();
    let expected = ModelCard {
        sampler: Some("fps".into()),
        points: Some(64),
        fps_start: Some("first".into()),
        pooled_relu: true,
        training_set: Some("ModelNet40".into()),
        accuracy: Some("instance 83.35 %, class 80.11 %, as its checkpoint says".into()),
        provenance: Some(format!("3dcertify_legacy.pth, SHA-256 {digest}")),
        ..ModelCard::default()
    };
    assert_eq!(card, expected);
    let file = WeightsFile::open(&folder.at("m.safetensors")).unwrap();
    assert_eq!(file.metadata()["widths"], "3-4-4-4-5-6 | 6-5-4-3");

    let said = folder.succeeds(&words(&golden("yanx27.pth"), ""));
    let (_, card) = read(&folder.at("m.safetensors"));
    assert_eq!((card.sampler.as_deref(), card.points), (Some("all"), None));
    assert_eq!((card.pooled_relu, card.accuracy), (false, None));
    for part in [
        "yanx27.pth: 3 classes without names",
        "its accuracy is a numpy.core.multiarray.scalar; --accuracy states it",
        "3-4-5-8 | 8-6-5-3, named as by yanx27: m.safetensors",
    ] {
        assert!(said.contains(part), "{part} in {said}");
    }
}

#[test]
fn flags_overrule_table_and_checkpoint() {
    let folder = Folder::new();
    folder.write("names.txt", "cup\r\nbowl\nvase\n\n");
    let flags = "--classes names.txt --sampler cpl --points 48 --normalization none \
                 --training-set ours --accuracy 99% --provenance me";
    let (_, card) = folder.imports(&golden("3dcertify_legacy.pth"), flags);
    let expected = ModelCard {
        classes: ["cup", "bowl", "vase"].map(str::to_owned).to_vec(),
        normalization: Normalization::None,
        sampler: Some("cpl".into()),
        points: Some(48),
        pooled_relu: true,
        training_set: Some("ours".into()),
        accuracy: Some("99%".into()),
        provenance: Some("me".into()),
        ..ModelCard::default()
    };
    assert_eq!(card, expected);
}

#[test]
fn the_same_checkpoint_gives_the_same_bytes_in_place_of_an_old_file() {
    let folder = Folder::new();
    folder.write("m.safetensors", "old");
    let [first, second] = [(); 2].map(|()| {
        folder.imports(&golden("yanx27.pth"), "");
        folder.bytes("m.safetensors")
    });
    assert!(first == second);
    assert_eq!(fs::read_dir(folder.at("")).unwrap().count(), 1);
}

#[test]
fn a_table_of_ones_own_renames_layers() {
    let folder = Folder::new();
    let (tensors, _) = folder.imports(&golden("yanx27.pth"), "");
    let theirs = tensors.iter().map(|(name, tensor)| (format!("net.{name}"), tensor.clone()));
    checkpoints::write(&folder.at("c.pth"), &theirs.collect());
    let layers: Vec<String> = tensors
        .keys()
        .filter_map(|name| name.strip_suffix(".weight"))
        .map(|layer| format!("\"net.{layer}\" = \"{layer}\"\n"))
        .collect();
    let table = format!(
        "name = \"mine\"\ndefault_classes = [\"a\", \"b\", \"c\"]\n[layers]\n{}[card]\npoints = 7\n",
        layers.concat()
    );
    folder.write("mine.toml", table);
    let (imported, card) = folder.imports(Path::new("c.pth"), "--table mine.toml");
    assert_eq!(imported, tensors);
    assert_eq!((card.classes.join(" ").as_str(), card.points), ("a b c", Some(7)));
}

#[test]
fn a_file_that_is_no_checkpoint_is_refused_and_the_old_output_stays() {
    let folder = Folder::new();
    folder.write("m.safetensors", "old");
    let zip = fs::read(golden("yanx27.pth")).unwrap();
    let legacy = fs::read(golden("3dcertify_legacy.pth")).unwrap();
    for (content, cause) in [
        (&b""[..], "not a PyTorch checkpoint"),
        (b"[net]\nwidth = 3\n", "not a PyTorch checkpoint"),
        (b"\x80\x02}.", "no tensor in it"),
        (b"\x80\x02K\x01.", "Expected a dictionary at the root"),
        (&zip[..zip.len() / 2], "zip archive error"),
        (&legacy[..100], "legacy format"),
        (&legacy[..legacy.len() - 1], "extends beyond the end of the file"),
    ] {
        folder.write("c.pth", content);
        let said = folder.exits(1, &words(Path::new("c.pth"), ""));
        assert!(said.starts_with("error: c.pth: ") && said.contains(cause), "{cause} in {said}");
    }
    let said = folder.exits(1, &words(Path::new("absent.pth"), ""));
    assert!(said.contains("absent.pth: ") && said.contains("No such file"), "{said}");
    assert_eq!(folder.text("m.safetensors"), "old");
}

#[test]
fn weights_that_make_no_model_are_named() {
    let folder = Folder::new();
    let (good, _) = folder.imports(&golden("yanx27.pth"), "");
    let add = |name: &'static str| {
        let tensor = Tensor { shape: vec![1], values: vec![1.0] };
        move |tensors: &mut Tensors| drop(tensors.insert(name.into(), tensor.clone()))
    };
    let unknown =
        "no importer table knows all of its tensors; the nearest, `yanx27`, does not know";
    let table = "Write a table like assets/importers/3dcertify.toml";
    let changes: [(Change<'_>, String); 8] = [
        (
            &|tensors| tensors.get_mut("fc2.bias").unwrap().values[3] = f32::NAN,
            "tensor `fc2.bias`: element 3 is NaN".into(),
        ),
        (&add("encoder.0.weight"), format!("{unknown} `encoder.0.weight`. {table}")),
        (&add("fc1.scale"), format!("{unknown} `fc1.scale`.")),
        (
            &|tensors| drop(tensors.remove("feat.bn2.running_mean")),
            "tensor `feat.bn2.running_mean`: missing".into(),
        ),
        (&add("fc4.bias"), "tensor `bn3.weight`: missing".into()),
        (&add("bn7.bias"), "tensor `bn7.bias`: unexpected".into()),
        (
            &|tensors| tensors.get_mut("feat.conv2.weight").unwrap().shape = vec![4, 5, 1],
            "tensor `feat.conv2.weight`: expected shape [4, 4, 1], found [4, 5, 1]".into(),
        ),
        (
            &|tensors| tensors.retain(|name, _| name.starts_with("fc")),
            "tensor `feat.conv2.weight`: missing".into(),
        ),
    ];
    for (change, cause) in changes {
        let mut tensors = good.clone();
        change(&mut tensors);
        checkpoints::write(&folder.at("c.pth"), &tensors);
        let message = format!("error: c.pth: {cause}");
        folder.refuses(1, &[(&words(Path::new("c.pth"), ""), &message)]);
    }
}

#[test]
fn a_tensor_that_was_renamed_is_told_by_both_names() {
    let folder = Folder::new();
    let (mut tensors, _) = folder.imports(&golden("3dcertify_legacy.pth"), "");
    tensors.get_mut("fc2.bias").unwrap().shape = vec![1, 4];
    let theirs = tensors.into_iter().map(|(name, tensor)| (format!("net.{name}"), tensor));
    checkpoints::write(&folder.at("c.pth"), &theirs.collect());
    let table = ["feat.conv", "feat.bn", "fc", "bn"]
        .map(|layer| format!("\"net.{layer}{{i}}\" = \"{layer}{{i}}\"\n"));
    let table = format!("name = \"t\"\n[layers]\n{}", table.concat());
    folder.write("t.toml", table);
    let message = "error: c.pth: tensor `fc2.bias` (there `net.fc2.bias`): expected shape [4]";
    folder.refuses(1, &[(&words(Path::new("c.pth"), "--table t.toml"), message)]);
}

#[test]
fn bad_tables_and_class_lists_are_named() {
    let folder = Folder::new();
    let words = |flags: &str| words(&golden("yanx27.pth"), flags);
    for (table, message) in [
        ("", "missing field `name`"),
        ("name = 3\n", "line 1"),
        ("name = \"t\"\nlayer = 1\n", "unknown field `layer`"),
        ("name = \"t\"\n[layers]\n\"a{i}\" = \"b\"\n", "\"a{i}\" = \"b\": {i} may stand once"),
        ("name = \"t\"\n[layers]\n[card]\npoint = 3\n", "card: unknown key `point`"),
        (
            "name = \"t\"\n[layers]\n[card]\npoints = -3\n",
            "metadata `points`: expected a count, found `-3`",
        ),
        ("name = \"t\"\n[layers]\n", "the nearest, `t`, does not know `bn1.bias`, "),
    ] {
        folder.write("t.toml", table);
        folder.refuses(1, &[(&words("--table t.toml"), message)]);
    }
    folder.write("names.txt", "cup\nbowl\n");
    let message = "names.txt: 2 class names for 3 logits";
    folder.refuses(1, &[(&words("--classes names.txt"), message)]);
    folder.write("names.txt", "cup\nbowl\ncup\n");
    let message = "names.txt: expected a name for each class, found two classes `cup`";
    folder.refuses(1, &[(&words("--classes names.txt"), message)]);
    let words_for_npz = words("").replace("m.safetensors", "m.npz");
    let message = "--out: expected a name with .safetensors, found m.npz";
    folder.refuses(2, &[(&words_for_npz, message)]);
    folder.exits(2, &words("--normalization box"));
    assert!(!folder.at("m.safetensors").exists());
}

#[test]
fn an_imported_baseline_equals_the_same_weights_saved_as_safetensors() {
    let checkpoint = need!(shared_data("parity/pointnet.pth"));
    let (imported, card) = Folder::new().imports(&checkpoint, "");
    let mut peer = WeightsFile::open(&checkpoint.with_extension("safetensors")).unwrap();
    let names = peer.shapes().into_keys().filter(|name| !name.ends_with("num_batches_tracked"));
    let expected: Tensors = names.map(|name| (name.clone(), peer.read(&name).unwrap())).collect();
    assert!(imported == expected);
    assert_eq!((card.classes.len(), card.classes[39].as_str()), (40, "xbox"));
}

#[test]
fn weights_that_others_trained_without_t_nets_come_whole() {
    let checkpoint = need!(shared_data("checkpoints/3dcertify_64p_natural.pth"));
    let (tensors, card) = Folder::new().imports(&checkpoint, "");
    let shape = |name: &str| tensors[name].shape.clone();
    let mut inputs = 3;
    for (i, width) in (1..).zip([64, 64, 64, 128, 1024]) {
        assert_eq!(shape(&format!("feat.conv{i}.weight")), [width, inputs, 1]);
        assert_eq!(shape(&format!("feat.bn{i}.running_var")), [width]);
        inputs = width;
    }
    for (i, width) in (1..).zip([512, 256, 40]) {
        assert_eq!(shape(&format!("fc{i}.weight")), [width, inputs]);
        inputs = width;
    }
    assert_eq!(tensors.len(), 8 * 2 + 7 * 4);
    assert_eq!((card.points, card.pooled_relu, card.classes.len()), (Some(64), true, 40));
}
