use std::path::{Path, PathBuf};

use formats::model_card::{ModelCard, Normalization};
use infer_cpu::{Classifier, Options};
use train::clouds::Clouds;
use train::init;
use train::model_file;
use train::recipe::Recipe;
use train::run::Job;
use train::shape::Shape;
use train::trainer::Trainer;

fn recipe() -> Recipe {
    crate::recipe(
        "points = 24\nbatch = 10\nepochs = 2\nsampling = \"random\"\n\
         [network]\ntrunk = [8, 12, 16]\nt_net = [8, 16]\nt_net_head = [8]\nhead = [12, 10]\n",
    )
}

fn card(clouds: &Clouds) -> ModelCard {
    ModelCard { classes: clouds.classes.clone(), points: Some(24), ..ModelCard::default() }
}

/// Trained networks in `folder`: one as it was trained, one as it is shipped.
fn models(folder: &Path, clouds: &Clouds) -> [PathBuf; 2] {
    let [whole, shipped] = ["whole", "shipped"].map(|name| folder.join(name));
    let mut trainer = Trainer::new(recipe(), clouds.classes.len()).unwrap();
    trainer.learn(clouds, |_| {}).unwrap();
    model_file::write(&whole, &mut trainer.model, &card(clouds)).unwrap();
    model_file::ship(&shipped, &mut trainer.model, &card(clouds)).unwrap();
    [whole, shipped]
}

fn logits(model: &Path, clouds: &Clouds) -> Vec<Vec<f32>> {
    let mut classifier = Classifier::load(model, &Options::default()).unwrap();
    let clouds = (0..clouds.len()).map(|i| clouds.set.cloud(i));
    clouds.map(|points| classifier.classify(points).unwrap().logits.clone()).collect()
}

#[test]
fn before_the_first_step_the_network_computes_what_the_model_does() {
    let clouds = crate::clouds(60);
    let folder = tempfile::tempdir().unwrap();
    for model in models(folder.path(), &clouds) {
        let mut trainer = Trainer::new(Recipe { seed: 7, ..recipe() }, 3).unwrap();
        init::start(&mut trainer, &model, &card(&clouds), &clouds).unwrap();
        let path = folder.path().join("started");
        model_file::write(&path, &mut trainer.model, &card(&clouds)).unwrap();
        let expected = logits(&model, &clouds);
        for (found, expected) in logits(&path, &clouds).iter().zip(&expected) {
            let largest = expected.iter().fold(1.0f32, |most, x| most.max(x.abs()));
            for (found, expected) in found.iter().zip(expected) {
                // Some fifteen layers in f32, whose batch norms round once more.
                assert!((found - expected).abs() <= 1e-4 * largest, "{found} for {expected}");
            }
        }
    }
}

/// A batch norm that normalises by a batch hardly changes what a folded layer computes: the first
/// loss is that of the model, not of random numbers.
#[test]
fn a_folded_model_keeps_what_it_has_learnt_in_training() {
    let clouds = crate::clouds(60);
    let folder = tempfile::tempdir().unwrap();
    let long = Recipe { epochs: 12, dropout: 0.0, ..recipe() };
    let mut trainer = Trainer::new(long.clone(), 3).unwrap();
    let losses: Vec<f64> = (0..12).map(|_| trainer.learn(&clouds, |_| {}).unwrap().loss).collect();
    let path = folder.path().join("shipped");
    model_file::ship(&path, &mut trainer.model, &card(&clouds)).unwrap();
    let mut again = Trainer::new(Recipe { seed: 7, ..long }, 3).unwrap();
    init::start(&mut again, &path, &card(&clouds), &clouds).unwrap();
    let loss = again.learn(&clouds, |_| {}).unwrap().loss;
    assert!(loss < 0.5 * (losses[0] + losses[11]), "{loss} after {losses:?}");
}

#[test]
fn other_classes_begin_with_a_random_last_layer() {
    let mut clouds = crate::clouds(60);
    let folder = tempfile::tempdir().unwrap();
    let [model, _] = models(folder.path(), &clouds);
    clouds.classes[2] = "stick".to_owned();
    let fresh = Trainer::new(Recipe { seed: 7, ..recipe() }, 3).unwrap();
    let mut trainer = fresh.clone();
    init::start(&mut trainer, &model, &card(&clouds), &clouds).unwrap();
    let [mut fresh, mut trainer] = [fresh, trainer].map(|mut t| model_file::tensors(&mut t.model));
    assert_eq!(fresh.remove("fc3.weight"), trainer.remove("fc3.weight"));
    assert_ne!(fresh.remove("fc2.weight"), trainer.remove("fc2.weight"));
}

#[test]
fn a_model_that_the_recipe_does_not_fit_is_refused_with_file_and_part() {
    let clouds = crate::clouds(60);
    let folder = tempfile::tempdir().unwrap();
    let [model, _] = models(folder.path(), &clouds);
    let shape = recipe().network;
    for (network, card, expected) in [
        (
            Shape { trunk: vec![8, 14, 16], ..shape.clone() },
            card(&clouds),
            "tensor `feat.conv2.weight`: expected shape [14, 8], as the recipe has it, found [12, 8]",
        ),
        (
            Shape { head: vec![12, 10, 8], ..shape.clone() },
            card(&clouds),
            "tensor `fc3.weight`: expected shape [8, 10], as the recipe has it, found [3, 10]",
        ),
        (
            Shape { trunk: vec![8, 12, 16, 9], ..shape.clone() },
            card(&clouds),
            "tensor `feat.conv4.weight`: expected shape [9, 16], as the recipe has it, found none",
        ),
        (
            Shape { feature_transform: false, ..shape.clone() },
            card(&clouds),
            "tensor `feat.fstn.bn1.bias`: expected the tensors of the recipe's network, found one more",
        ),
        (
            shape.clone(),
            ModelCard { normalization: Normalization::Metric, ..card(&clouds) },
            "metadata `normalization`: expected metric, as the recipe has it, found unit-sphere",
        ),
        (
            shape.clone(),
            ModelCard { points: Some(32), ..card(&clouds) },
            "metadata `points`: expected 32, as the recipe has it, found 24",
        ),
    ] {
        let mut trainer = Trainer::new(Recipe { network, ..recipe() }, 3).unwrap();
        let error = init::start(&mut trainer, &model, &card, &clouds).unwrap_err().to_string();
        assert_eq!(error, format!("{}: {expected}", model.display()));
    }
}

#[test]
fn a_run_that_was_interrupted_is_not_started_again() {
    let clouds = crate::clouds(60);
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
