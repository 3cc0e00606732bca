use std::path::{Path, PathBuf};

use super::reference::{self, Reference};
use super::{assert_near, largest};
use crate::clouds::Clouds;
use crate::evaluate::evaluate;
use crate::model_file;
use crate::recipe::{Cpl, Edge, Recipe};
use crate::trainer::Trainer;
use formats::model_card::{ModelCard, Normalization};
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Options};

fn recipe() -> Recipe {
    super::recipe(
        "points = 32\nbatch = 10\nepochs = 3\n[network]\ntrunk = [16, 24, 40]\nhead = [32, 20]\n",
    )
}

fn with_edges(edges: &[(f32, usize)]) -> Recipe {
    let mut recipe = recipe();
    recipe.network.edges =
        edges.iter().map(|&(radius, channels)| Edge { radius, channels }).collect();
    recipe
}

fn card(clouds: &Clouds) -> ModelCard {
    ModelCard { classes: clouds.classes.clone(), ..ModelCard::default() }
}

/// A network that learnt from `clouds` by `recipe`, and its model file in `folder`.
fn learnt(recipe: Recipe, clouds: &Clouds, folder: &Path) -> (Trainer, PathBuf) {
    let path = folder.join("model.safetensors");
    let edge_radii = recipe.network.edges.iter().map(|edge| edge.radius).collect();
    let mut trainer = Trainer::new(recipe, clouds.classes.len());
    for _ in 0..trainer.recipe.epochs {
        trainer.learn(clouds).unwrap();
    }
    let card = ModelCard { edge_radii, ..card(clouds) };
    model_file::write(&path, &mut trainer.model, &card).unwrap();
    (trainer, path)
}

/// Checks that infer-cpu gives all `clouds` the logits of the reference, with the sampler's points
/// and neighbors among all points.
fn check_logits(trainer: &mut Trainer, path: &Path, clouds: &Clouds, options: Options) {
    let options = Options { normalization: Some(Normalization::None), ..options };
    let mut classifier = Classifier::load(path, &options).unwrap();
    let values = reference::values(&mut trainer.model);
    for cloud in 0..clouds.len() {
        let points = clouds.set.cloud(cloud);
        let wide: Vec<[f64; 3]> = points.iter().map(|p| p.map(f64::from)).collect();
        let chosen = classifier.sample(&wide).unwrap();
        let chosen = chosen.iter().map(|&i| wide[i as usize].to_vec()).collect();
        let around = vec![wide.iter().map(|p| p.to_vec()).collect()];
        let reference = Reference { values: &values, clouds: vec![chosen], around, kept: None };
        let expected = reference.logits(&trainer.recipe.network).swap_remove(0);
        let expected: Vec<f32> = expected.iter().map(|x| *x as f32).collect();
        // Some ten layers in fp32.
        let tolerance = |x: f32| 1e-4 * x.abs().max(1.0);
        assert_near(&classifier.classify(points).unwrap().logits, &expected, tolerance);
    }
}

#[test]
fn logits_are_those_of_infer_cpu() {
    let clouds = super::clouds(100);
    for edges in [&[][..], &[(0.25, 12), (0.6, 7)]] {
        let folder = tempfile::tempdir().unwrap();
        let (mut trainer, path) = learnt(with_edges(edges), &clouds, folder.path());
        check_logits(&mut trainer, &path, &clouds, Options::default());
    }
}

/// An EdgeConv network of 8 of 32 points: neighbors are searched among all 32 points, for every
/// sampler and number of threads.
#[test]
fn neighbors_are_searched_among_all_points_whatever_the_sampler_kept() {
    let clouds = super::clouds(30);
    let folder = tempfile::tempdir().unwrap();
    let recipe = Recipe { epochs: 1, ..with_edges(&[(0.5, 9)]) };
    let (mut trainer, path) = learnt(recipe, &clouds, folder.path());
    for (kind, threads) in [
        (SamplerKind::Fps, 1),
        (SamplerKind::Fps, 3),
        (SamplerKind::Random, 1),
        (SamplerKind::Cpl, 3),
    ] {
        let sampler = Some(SamplerSpec { kind, points: 8, ..SamplerSpec::default() });
        let options = Options { sampler, threads, ..Options::default() };
        check_logits(&mut trainer, &path, &clouds, options);
    }
}

#[test]
fn shipped_weights_are_those_that_were_learnt() {
    let clouds = super::clouds(60);
    let folder = tempfile::tempdir().unwrap();
    let recipe = Recipe { epochs: 1, ..recipe() };
    let (mut trainer, learnt) = learnt(recipe.clone(), &clouds, folder.path());
    let shipped = folder.path().join("shipped");
    model_file::ship(&shipped, &mut trainer.model, &card(&clouds)).unwrap();
    let size = |path: &Path| std::fs::metadata(path).unwrap().len();
    assert!(size(&shipped) < size(&learnt) * 6 / 10);
    let mut again = Trainer::new(recipe, clouds.classes.len());
    model_file::read(&learnt, &mut again.model).unwrap();
    assert_eq!(model_file::tensors(&mut again.model), model_file::tensors(&mut trainer.model));
    let [found, expected] = [&shipped, &learnt].map(|path| super::logits(path, &clouds));
    for (found, expected) in found.iter().zip(&expected) {
        // Layers of weights rounded by 2^-12, relatively.
        assert_near(found, expected, |_| 0.01 * largest(expected));
    }
}

#[test]
fn plain_shapes_are_classified_by_all_points_and_by_few() {
    let (clouds, test) = (super::clouds(120), super::clouds_of(6, 150));
    let front = Cpl { front: vec![16, 32], keep: 8, ..Cpl::default() };
    for (cpl, most_loss, least) in [(None, 0.5, 0.95), (Some(front), 0.7, 0.9)] {
        let mut trainer = Trainer::new(Recipe { epochs: 12, cpl: cpl.clone(), ..recipe() }, 3);
        let losses = [(); 12].map(|()| trainer.learn(&clouds).unwrap().loss);
        assert!(losses[11] < most_loss * losses[0], "{cpl:?}: {losses:?}");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.safetensors");
        let points = cpl.as_ref().map(|cpl| cpl.keep);
        let sampler = points.map(|_| "cpl".to_owned());
        let card = ModelCard { sampler, points, ..card(&test) };
        model_file::ship(&path, &mut trainer.model, &card).unwrap();
        let mut classifier = Classifier::load(&path, &Options::default()).unwrap();
        let n_used = classifier.classify(test.set.cloud(0)).unwrap().n_used;
        assert!(n_used <= points.unwrap_or(32), "{n_used}");
        let found = evaluate(&path, &test, &Options::default()).unwrap();
        assert_eq!(found.total(), 150);
        assert!(found.instance_accuracy() > least, "{found:?}");
    }
}
