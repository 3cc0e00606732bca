use crate::checkpoint;
use crate::recipe::Recipe;
use crate::trainer::Trainer;

fn recipe() -> Recipe {
    super::recipe(
        "points = 24\nbatch = 8\nepochs = 4\nsampling = \"random\"\n\
         [network]\ntrunk = [8, 16]\nhead = [12]\n",
    )
}

/// All that a checkpoint holds.
fn bytes(trainer: &mut Trainer) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    checkpoint::write(&path, trainer, "data", &[]).unwrap();
    std::fs::read(path).unwrap()
}

#[test]
fn a_resumed_run_is_the_unbroken_one_to_the_bit() {
    let clouds = super::clouds(50);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    let [mut unbroken, mut broken] = [(); 2].map(|()| Trainer::new(recipe(), 3));
    for _ in 0..4 {
        let [expected, epoch] = [&mut unbroken, &mut broken].map(|t| t.learn(&clouds).unwrap());
        assert_eq!(epoch.loss, expected.loss);
        checkpoint::write(&path, &mut broken, "data", &[epoch]).unwrap();
        broken = Trainer::new(recipe(), 3);
        assert_eq!(checkpoint::read(&path, &mut broken, "data").unwrap(), [epoch]);
    }
    assert!(bytes(&mut broken) == bytes(&mut unbroken));
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let clouds = super::clouds(50);
    let learnt = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let mut trainer = Trainer::new(recipe(), 3);
            trainer.learn(&clouds).unwrap();
            bytes(&mut trainer)
        })
    };
    assert!(learnt(1) == learnt(3));
}

#[test]
fn a_checkpoint_of_another_recipe_or_of_other_data_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("checkpoint.safetensors");
    checkpoint::write(&path, &mut Trainer::new(recipe(), 3), "data", &[]).unwrap();
    let mut longer = Trainer::new(Recipe { epochs: 9, ..recipe() }, 3);
    checkpoint::read(&path, &mut longer, "data").unwrap();
    let mut other = Trainer::new(Recipe { batch: 9, ..recipe() }, 3);
    let mut shorter = Trainer::new(recipe(), 3);
    shorter.recipe.epochs = 0;
    longer.epoch = 2;
    checkpoint::write(&path, &mut longer, "data", &[]).unwrap();
    for (trainer, data, cause) in [
        (&mut other, "data", "its recipe differs"),
        (&mut longer, "other data", "its training data differ"),
        (&mut shorter, "data", "expected at most 0 epochs, found 2"),
    ] {
        let error = checkpoint::read(&path, trainer, data).unwrap_err();
        let expected = format!("expected a checkpoint of this run: {cause}");
        assert!(error.to_string().contains(&expected), "{error}");
    }
    std::fs::write(&path, b"no checkpoint").unwrap();
    assert!(checkpoint::read(&path, &mut longer, "data").is_err());
}

#[test]
fn a_loss_that_is_not_finite_names_step_and_layer() {
    let mut clouds = super::clouds(20);
    clouds.set.points.iter_mut().for_each(|x| *x *= 1e38);
    let error = Trainer::new(recipe(), 3).learn(&clouds).unwrap_err();
    let message = error.to_string();
    assert!(message.contains("at step 1 of epoch 1"), "{message}");
    assert!(message.contains("; feat.conv1 is the first"), "{message}");
}
