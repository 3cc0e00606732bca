use train::checkpoint;
use train::clouds::Clouds;
use train::error::Error;
use train::layer::Module;
use train::model_file;
use train::recipe::Recipe;
use train::shape::Abstraction;
use train::trainer::Trainer;

fn recipe() -> Recipe {
    crate::recipe(
        "points = 24\nbatch = 8\nepochs = 4\nsampling = \"random\"\n\
         [network]\ntrunk = [8, 16]\nt_net = [8, 12]\nt_net_head = [8]\nhead = [12]\n",
    )
}

/// Set abstractions, whose weights are averaged.
fn averaged() -> Recipe {
    let widths = vec![12];
    let mut recipe = Recipe { average: 0.5, ..recipe() };
    recipe.network.abstractions = vec![Abstraction { centres: 6, radius: 0.8, widths }];
    (recipe.network.input_transform, recipe.network.feature_transform) = (false, false);
    recipe
}

fn parameters(trainer: &mut Trainer) -> Vec<u32> {
    let mut bits = Vec::new();
    for parameter in trainer.model.parameters() {
        bits.extend(parameter.value.iter().chain(&parameter.square).map(|x| x.to_bits()));
    }
    for (_, values) in trainer.model.statistics() {
        bits.extend(values.iter().map(|x| x.to_bits()));
    }
    bits.extend(trainer.averages.values().flat_map(|t| &t.values).map(|x| x.to_bits()));
    bits
}

#[test]
fn a_resumed_run_is_the_unbroken_one_to_the_bit() {
    resumes_to_the_bit(&recipe());
    resumes_to_the_bit(&averaged());
}

fn resumes_to_the_bit(recipe: &Recipe) {
    let clouds = crate::clouds(50);
    let recipe = || recipe.clone();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let mut unbroken = Trainer::new(recipe(), 3).unwrap();
    let losses: Vec<f64> = (0..4).map(|_| unbroken.learn(&clouds, |_| {}).unwrap().loss).collect();
    let mut broken = Trainer::new(recipe(), 3).unwrap();
    for (epoch, loss) in losses.iter().enumerate() {
        assert_eq!(broken.learn(&clouds, |_| {}).unwrap().loss, *loss, "epoch {epoch}");
        checkpoint::write(&path, &mut broken, "data", "a note").unwrap();
        broken = Trainer::new(recipe(), 3).unwrap();
        assert_eq!(checkpoint::read(&path, &mut broken, "data").unwrap(), "a note");
    }
    assert_eq!(parameters(&mut broken), parameters(&mut unbroken));
}

/// With one step an epoch, the weights of each step are known.
#[test]
fn averages_are_the_running_means_of_the_steps() {
    let clouds = crate::clouds(8);
    let mut trainer = Trainer::new(averaged(), 3).unwrap();
    let name = "sa1.conv2.weight";
    let mut expected = 0.0;
    for step in 1..=20 {
        trainer.learn(&clouds, |_| {}).unwrap();
        let value = f64::from(model_file::tensors(&mut trainer.model)[name].values[3]);
        expected += (value - expected) * f64::max(0.5, 10.0 / f64::from(step + 9));
    }
    // 20 roundings of numbers below 1.
    let found = f64::from(trainer.tensors()[name].values[3]);
    assert!((found - expected).abs() < 20.0 * f64::from(f32::EPSILON), "{found}, {expected}");
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let clouds = crate::clouds(50);
    for recipe in [recipe(), averaged()] {
        let learn = |threads| learnt_by(&recipe, &clouds, threads);
        assert_eq!(learn(1), learn(3));
    }
}

fn learnt_by(recipe: &Recipe, clouds: &Clouds, threads: usize) -> Vec<u32> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| {
        let mut trainer = Trainer::new(recipe.clone(), 3).unwrap();
        trainer.learn(clouds, |_| {}).unwrap();
        parameters(&mut trainer)
    })
}

#[test]
fn a_checkpoint_of_another_recipe_or_of_other_data_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    checkpoint::write(&path, &mut Trainer::new(recipe(), 3).unwrap(), "data", "").unwrap();
    let mut longer = Trainer::new(Recipe { epochs: 9, ..recipe() }, 3).unwrap();
    checkpoint::read(&path, &mut longer, "data").unwrap();
    let mut other = Trainer::new(Recipe { batch: 9, ..recipe() }, 3).unwrap();
    let mut shorter = Trainer::new(recipe(), 3).unwrap();
    shorter.recipe.epochs = 0;
    longer.epoch = 2;
    checkpoint::write(&path, &mut longer, "data", "").unwrap();
    for (trainer, data, cause) in [
        (&mut other, "data", "its recipe differs"),
        (&mut longer, "other data", "its training data differ"),
        (&mut shorter, "data", "expected at most 0 epochs, found 2"),
    ] {
        let error = checkpoint::read(&path, trainer, data).unwrap_err();
        assert!(matches!(error, Error::OtherRun { .. }), "{error}");
        assert!(error.to_string().contains(cause), "{error}");
    }
    std::fs::write(&path, b"no checkpoint").unwrap();
    assert!(checkpoint::read(&path, &mut longer, "data").is_err());
}

#[test]
fn a_loss_that_is_not_finite_names_step_and_layer() {
    let mut clouds = crate::clouds(20);
    clouds.set.points.iter_mut().for_each(|x| *x *= 1e38);
    let error = Trainer::new(recipe(), 3).unwrap().learn(&clouds, |_| {}).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("at step 1 of epoch 1"), "{message}");
    assert!(message.contains("; feat.stn.conv1 is the first"), "{message}");
}
