use std::path::{Path, PathBuf};

use super::{assert_near, largest, logits};
use crate::clouds::Clouds;
use crate::init;
use crate::job::Job;
use crate::model_file;
use crate::recipe::{Cpl, Recipe, Shape};
use crate::trainer::Trainer;
use formats::model_card::{ModelCard, Normalization};

fn recipe() -> Recipe {
    super::recipe(
        "points = 24\nbatch = 10\nepochs = 2\nsampling = \"random\"\n\
         [network]\ntrunk = [8, 12, 16]\nhead = [12, 10]\n",
    )
}

fn card(clouds: &Clouds) -> ModelCard {
    ModelCard { classes: clouds.classes.clone(), points: Some(24), ..ModelCard::default() }
}

/// Trained networks in `folder`: one as it was trained, one as it is shipped.
fn models(folder: &Path, clouds: &Clouds) -> [PathBuf; 2] {
    let [whole, shipped] = ["whole", "shipped"].map(|name| folder.join(name));
    let mut trainer = Trainer::new(recipe(), clouds.classes.len());
    trainer.learn(clouds).unwrap();
    model_file::write(&whole, &mut trainer.model, &card(clouds)).unwrap();
    model_file::ship(&shipped, &mut trainer.model, &card(clouds)).unwrap();
    [whole, shipped]
}

#[test]
fn a_network_begins_with_the_model_but_other_classes_with_a_random_last_layer() {
    let clouds = super::clouds(60);
    let mut others = clouds.clone();
    others.classes[2] = "stick".to_owned();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("started");
    for model in models(folder.path(), &clouds) {
        let mut fresh = Trainer::new(Recipe { seed: 7, ..recipe() }, 3).model;
        let [mut same, mut other] = [&clouds, &others].map(|clouds| {
            let mut started = fresh.clone();
            init::start(&mut started, &model, &card(clouds)).unwrap();
            started
        });
        model_file::write(&path, &mut same, &card(&clouds)).unwrap();
        for (found, expected) in logits(&path, &clouds).iter().zip(logits(&model, &clouds)) {
            // Some layers in f32, whose batch norms round once more.
            assert_near(found, &expected, |_| 1e-4 * largest(&expected));
        }
        let [fresh, other] = [&mut fresh, &mut other].map(|model| model_file::tensors(model));
        assert_eq!(fresh["fc3.weight"], other["fc3.weight"]);
        assert_ne!(fresh["fc2.weight"], other["fc2.weight"]);
    }
}

#[test]
fn a_model_that_the_recipe_does_not_fit_is_refused_with_file_and_part() {
    let clouds = super::clouds(60);
    let folder = tempfile::tempdir().unwrap();
    let model = folder.path().join("model");
    let cpl = Some(Cpl { front: vec![4, 8], ..Cpl::default() });
    let mut with_cpl = Trainer::new(Recipe { cpl, ..recipe() }, 3);
    model_file::write(&model, &mut with_cpl.model, &card(&clouds)).unwrap();
    let trunk = |trunk: &[usize]| Shape { trunk: trunk.to_vec(), ..recipe().network };
    let metric = ModelCard { normalization: Normalization::Metric, ..card(&clouds) };
    let of_32 = ModelCard { points: Some(32), ..card(&clouds) };
    for (network, card, expected) in [
        (
            trunk(&[8, 14, 16]),
            card(&clouds),
            "tensor `feat.conv2.weight`: expected shape [14, 8], as the recipe has it, found [12, 8]",
        ),
        (
            trunk(&[8, 12, 16, 9]),
            card(&clouds),
            "tensor `feat.conv4.weight`: expected shape [9, 16], as the recipe has it, found none",
        ),
        (
            recipe().network,
            card(&clouds),
            "tensor `cpl.bn1.bias`: expected the tensors of the recipe's network, found one more",
        ),
        (
            recipe().network,
            metric,
            "metadata `normalization`: expected metric, as the recipe has it, found unit-sphere",
        ),
        (recipe().network, of_32, "metadata `points`: expected 32, as the recipe has it, found 24"),
    ] {
        let mut trainer = Trainer::new(Recipe { network, ..recipe() }, 3);
        let error = init::start(&mut trainer.model, &model, &card).unwrap_err().to_string();
        assert_eq!(error, format!("{}: {expected}", model.display()));
    }
}

#[test]
fn a_run_that_was_interrupted_is_not_started_again() {
    let clouds = super::clouds(60);
    let folder = tempfile::tempdir().unwrap();
    let [_, model] = models(folder.path(), &clouds);
    let out = |name: &str| folder.path().join(name).with_extension("safetensors");
    let run = |name: &str, epochs| {
        let recipe = Recipe { epochs, init: Some(model.clone()), ..recipe() };
        let out = &out(name);
        Job { recipe, clouds: &clouds, data: "data", data_name: "data", out, overwrite: false }
            .run(None, &mut |_| {})
            .unwrap();
    };
    run("broken", 1);
    run("broken", 2);
    run("unbroken", 2);
    let bytes = |name| std::fs::read(out(name)).unwrap();
    assert!(bytes("broken") == bytes("unbroken"));
    let card = ModelCard::read(&out("broken")).unwrap();
    assert_eq!(card.provenance.unwrap(), "edgepuck train, seed 0, from shipped");
}
