use std::path::Path;

use formats::model_card::ModelCard;
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Evaluation, Options};
use train::clouds::Clouds;
use train::cpl::Cpl;
use train::model_file;
use train::recipe::Recipe;
use train::shape::{Abstraction, Edge};
use train::trainer::Trainer;

use crate::reference::{self, Reference};

fn recipe(input_transform: bool, feature_transform: bool) -> Recipe {
    crate::recipe(&format!(
        "points = 32\nbatch = 10\nepochs = 3\n\
         [network]\ninput_transform = {input_transform}\nfeature_transform = {feature_transform}\n\
         trunk = [16, 24, 40]\nt_net = [16, 40]\nt_net_head = [24]\nhead = [32, 20]\n"
    ))
}

#[test]
fn logits_are_those_of_infer_cpu() {
    let clouds = crate::clouds(100);
    let edges = vec![Edge { radius: 0.25, channels: 12 }, Edge { radius: 0.6, channels: 7 }];
    let abstraction = |centres, radius, widths| Abstraction { centres, radius, widths };
    let sets = vec![abstraction(12, 0.4, vec![24, 70]), abstraction(5, 0.9, vec![48])];
    for (t_nets, edges, sets) in [
        (true, vec![], vec![]),
        (false, vec![], vec![]),
        (false, edges.clone(), vec![]),
        (true, edges, vec![]),
        (false, vec![], sets),
    ] {
        let mut recipe = recipe(t_nets, t_nets);
        (recipe.network.edges, recipe.network.abstractions) = (edges, sets);
        let mut trainer = Trainer::new(recipe.clone(), clouds.classes.len()).unwrap();
        for _ in 0..recipe.epochs {
            trainer.learn(&clouds, |_| {}).unwrap();
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.safetensors");
        let edge_radii = recipe.network.edges.iter().map(|edge| edge.radius).collect();
        let sets = recipe.network.abstractions.iter().map(|set| (set.centres, set.radius));
        let (classes, abstractions) = (clouds.classes.clone(), sets.collect());
        let card = ModelCard { classes, edge_radii, abstractions, ..ModelCard::default() };
        model_file::write(&path, &mut trainer.model, &card).unwrap();

        let options =
            Options { normalization: Some("none".parse().unwrap()), ..Options::default() };
        let mut classifier = Classifier::load(&path, &options).unwrap();
        let values = reference::values(&mut trainer.model);
        for cloud in 0..clouds.len() {
            let points = clouds.set.cloud(cloud);
            let wide: Vec<_> = points.iter().map(|p| p.map(f64::from).to_vec()).collect();
            let (clouds, around) = (vec![wide.clone()], vec![wide]);
            let reference = Reference { values: &values, clouds, around, kept: None };
            let (expected, _) = reference.logits(&recipe.network);
            let found = &classifier.classify(points).unwrap().logits;
            for (found, expected) in found.iter().zip(&expected[0]) {
                // What the issue asks for; some ten layers in fp32.
                let near = (f64::from(*found) - expected).abs() <= 1e-4 * expected.abs().max(1.0);
                assert!(near, "cloud {cloud}: {found} for {expected}");
            }
        }
    }
}

#[test]
fn shipped_weights_are_those_that_were_learnt() {
    let clouds = crate::clouds(60);
    let mut trainer = Trainer::new(recipe(true, true), clouds.classes.len()).unwrap();
    trainer.learn(&clouds, |_| {}).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let [learnt, shipped] = ["learnt", "shipped"].map(|name| folder.path().join(name));
    let card = ModelCard { classes: clouds.classes.clone(), ..ModelCard::default() };
    model_file::write(&learnt, &mut trainer.model, &card).unwrap();
    model_file::ship(&shipped, &mut trainer.model, &card).unwrap();
    let size = |path: &Path| std::fs::metadata(path).unwrap().len();
    assert!(size(&shipped) < size(&learnt) * 6 / 10);
    let mut again = Trainer::new(recipe(true, true), clouds.classes.len()).unwrap();
    model_file::read(&learnt, &mut again.model).unwrap();
    assert_eq!(model_file::tensors(&mut again.model), model_file::tensors(&mut trainer.model));
    let [mut a, mut b] =
        [&learnt, &shipped].map(|path| Classifier::load(path, &Options::default()).unwrap());
    for cloud in 0..clouds.len() {
        let points = clouds.set.cloud(cloud);
        let expected = a.classify(points).unwrap().logits.clone();
        let found = &b.classify(points).unwrap().logits;
        let largest = expected.iter().fold(1.0f32, |most, x| most.max(x.abs()));
        for (found, expected) in found.iter().zip(&expected) {
            // Ten layers of weights rounded by 2^-12, relatively.
            assert!((found - expected).abs() < 0.01 * largest, "{found} for {expected}");
        }
    }
}

#[test]
fn plain_shapes_are_classified() {
    let (clouds, test) = (crate::clouds(120), crate::test_clouds(150));
    let mut trainer = Trainer::new(Recipe { epochs: 12, ..recipe(false, false) }, 3).unwrap();
    let first = trainer.learn(&clouds, |_| {}).unwrap();
    let last = (1..12).map(|_| trainer.learn(&clouds, |_| {}).unwrap()).last().unwrap();
    assert!(last.loss < 0.5 * first.loss, "{first:?}, {last:?}");
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let card = ModelCard { classes: clouds.classes.clone(), ..ModelCard::default() };
    model_file::write(&path, &mut trainer.model, &card).unwrap();
    let found = train::evaluate::confusion(&path, &test, &Options::default()).unwrap();
    assert_eq!(found.total(), 150);
    assert!(found.instance_accuracy() > 0.95, "{found:?}");
}

#[test]
fn a_point_encoder_and_its_network_classify_plain_shapes_by_few_points() {
    let cpl = Cpl { front: vec![16, 32], keep: 8, ..Cpl::default() };
    let (clouds, test) = (crate::clouds(120), crate::test_clouds(150));
    let recipe = Recipe { epochs: 12, cpl: Some(cpl), ..recipe(false, false) };
    let mut trainer = Trainer::new(recipe, 3).unwrap();
    let first = trainer.learn(&clouds, |_| {}).unwrap();
    let last = (1..12).map(|_| trainer.learn(&clouds, |_| {}).unwrap()).last().unwrap();
    assert!(last.loss < 0.7 * first.loss, "{first:?}, {last:?}");
    let found = by_eight_points(&test, |path, card| {
        model_file::ship(path, &mut trainer.model, card).unwrap()
    });
    assert!(found.instance_accuracy() > 0.9, "{found:?}");
}

/// What a model that `write` writes answers on `test` by eight critical points.
fn by_eight_points(test: &Clouds, write: impl FnOnce(&Path, &ModelCard)) -> Evaluation {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let card = ModelCard {
        classes: test.classes.clone(),
        sampler: Some("cpl".to_owned()),
        points: Some(8),
        ..ModelCard::default()
    };
    write(&path, &card);
    let mut classifier = Classifier::load(&path, &Options::default()).unwrap();
    assert!(classifier.classify(test.set.cloud(0)).unwrap().n_used <= 8);
    train::evaluate::confusion(&path, test, &Options::default()).unwrap()
}

/// An EdgeConv network of 8 of 32 points, compared with its reference: neighbors are searched
/// among all 32 points, for every sampler and number of threads.
#[test]
fn neighbors_are_searched_among_all_points_whatever_the_sampler_kept() {
    let clouds = crate::clouds(30);
    let mut recipe = recipe(false, false);
    recipe.network.edges = vec![Edge { radius: 0.5, channels: 9 }];
    let mut trainer = Trainer::new(recipe.clone(), 3).unwrap();
    trainer.learn(&clouds, |_| {}).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.safetensors");
    let card = ModelCard { edge_radii: vec![0.5], ..ModelCard::default() };
    model_file::write(&path, &mut trainer.model, &card).unwrap();
    let values = reference::values(&mut trainer.model);
    for (kind, threads) in [
        (SamplerKind::Fps, 1),
        (SamplerKind::Fps, 3),
        (SamplerKind::Random, 1),
        (SamplerKind::Cpl, 3),
    ] {
        let sampler = Some(SamplerSpec { kind, points: 8, ..SamplerSpec::default() });
        let normalization = Some("none".parse().unwrap());
        let options = Options { sampler, threads, normalization, ..Options::default() };
        let mut classifier = Classifier::load(&path, &options).unwrap();
        for cloud in 0..clouds.len() {
            let points = clouds.set.cloud(cloud);
            let wide: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
            let chosen = classifier.sample(&wide).unwrap();
            let chosen = chosen.iter().map(|&i| wide[i as usize].to_vec()).collect();
            let around = vec![wide.iter().map(|p| p.to_vec()).collect()];
            let reference = Reference { values: &values, clouds: vec![chosen], around, kept: None };
            let (expected, _) = reference.logits(&recipe.network);
            let found = &classifier.classify(points).unwrap().logits;
            for (found, expected) in found.iter().zip(&expected[0]) {
                // As `logits_are_those_of_infer_cpu`.
                let near = (f64::from(*found) - expected).abs() <= 1e-4 * expected.abs().max(1.0);
                assert!(near, "{kind}, cloud {cloud}: {found} for {expected}");
            }
        }
    }
}
