use formats::model_card::ModelCard;
use formats::rng::StreamKey;
use infer_cpu::{Classifier, Options};
use train::augment::{augment, varied_too};
use train::init;
use train::model_file;
use train::negatives::{Negative, added, negative};
use train::recipe::{Augment, Recipe, Sampling};
use train::trainer::Trainer;

fn recipe() -> Recipe {
    crate::recipe(
        "points = 32\nbatch = 8\nsampling = \"fps\"\noutlier_filter = true\n\
         negatives = 0.5\nunknown = [\"unknown\"]\n\
         [network]\ninput_transform = false\nfeature_transform = false\n\
         trunk = [8, 16]\nhead = [12]\nedges = [{ radius = 0.5, channels = 4 }]\n\
         [clusters]\ndensity = [12, 32]\nstray_share = 1.0\nstrays = 2\nstray_reach = 0.5\n\
         [augment]\ndrop = 0.0\nscale = [1.0, 1.0]\nshift = 0.0\n",
    )
}

fn largest_radius(cloud: &[[f32; 3]]) -> f32 {
    cloud.iter().map(|p| (p[0] * p[0] + p[1] * p[1] + p[2] * p[2]).sqrt()).fold(0.0, f32::max)
}

#[test]
fn an_object_is_thinned_and_fills_the_unit_sphere_whatever_strays_it_met() {
    let clouds = crate::clouds(6);
    recipe().check().unwrap();
    let drawn: Vec<_> = (0..40).map(|epoch| augment(&clouds, 0, (epoch, 0), &recipe())).collect();
    for cloud in &drawn {
        // Half of 12 points or more are drawn from; a stray more or less may be left.
        assert!((6..=34).contains(&cloud.neighborhood.len()), "{}", cloud.neighborhood.len());
        assert!(largest_radius(&cloud.neighborhood) < 1.0 + 1e-6);
    }
    assert!(drawn.iter().any(|cloud| cloud.neighborhood.len() < 16));
    assert_eq!(drawn[3], augment(&clouds, 0, (3, 0), &recipe()));
}

#[test]
fn validation_has_each_cloud_as_it_is_and_as_training_varies_it() {
    let clouds = crate::clouds(6);
    let both = varied_too(&clouds, &recipe());
    assert_eq!((both.len(), &both.set.labels[6..]), (12, &clouds.set.labels[..]));
    for i in 0..6 {
        assert_eq!(both.set.cloud(i), clouds.set.cloud(i));
        assert_ne!(both.set.cloud(6 + i), clouds.set.cloud(i));
    }
    assert_eq!(both, varied_too(&clouds, &recipe()));
    // Each copy has random numbers of its own.
    let twins = varied_too(&clouds.select(&[0, 0]), &recipe());
    assert_ne!(twins.set.cloud(2), twins.set.cloud(3));
}

#[test]
fn a_share_of_clouds_keeps_its_direction() {
    let clouds = crate::clouds(4);
    let augment_by = Augment { rotate_degrees: 180.0, rotate_share: 0.8, ..recipe().augment };
    let plain = Recipe { augment: augment_by, sampling: Sampling::First, ..Recipe::default() };
    let plain = Recipe { points: 16, augment: Augment { drop: 0.0, ..plain.augment }, ..plain };
    let keeps = |epoch| augment(&clouds, 0, (epoch, 0), &plain).points == clouds.set.cloud(0)[..16];
    let kept = (0..200).filter(|&epoch| keeps(epoch)).count();
    // 200 draws with a chance of a fifth: 40, and four standard deviations of 5.7.
    assert!((18..=62).contains(&kept), "{kept}");
}

#[test]
fn negatives_follow_the_data_and_a_seed_an_epoch_and_a_purpose_make_them() {
    let clouds = crate::clouds(12);
    let with = |purpose, epoch| added(clouds.clone(), &recipe(), purpose, epoch);
    let one = with("learnt", 1);
    assert_eq!(one.classes, ["ball", "disc", "rod", "unknown"]);
    assert_eq!((one.len(), &one.set.labels[12..]), (18, &[3; 6][..]));
    assert_eq!(one.set.points[..clouds.set.points.len()], clouds.set.points);
    assert_eq!(one, with("learnt", 1));
    assert_ne!(one, with("learnt", 2));
    assert_ne!(one, with("held", 1));
    let none = Recipe { negatives: 0.0, ..recipe() };
    assert_eq!(added(clouds.clone(), &none, "learnt", 1), clouds);
}

/// Each has 32 points.
#[test]
fn the_two_objects_of_a_pair_stand_on_one_floor() {
    for i in 0..20 {
        let stream = StreamKey::new(1, "pair", i);
        let points = negative(Negative::Pair, &crate::clouds(6), stream);
        let [one, other] = [&points[..32], &points[32..]]
            .map(|of| of.iter().fold(f32::INFINITY, |floor, point| floor.min(point[2])));
        assert!((one - other).abs() < 1e-6, "{one} and {other}");
    }
}

#[test]
fn a_negative_fills_the_unit_sphere() {
    let clouds = crate::clouds(12);
    for kind in Negative::ALL {
        for i in 0..20 {
            let cloud = negative(kind, &clouds, StreamKey::new(1, "negative", i));
            assert!((largest_radius(&cloud) - 1.0).abs() < 1e-6, "{kind}");
            let heights = cloud.iter().map(|p| p[2].abs()).fold(0.0, f32::max);
            // A slope of a fifth, relief of 0.06 and five standard deviations of 0.03.
            assert!(kind != Negative::Ground || heights < 0.5, "{heights}");
        }
    }
}

/// A class that the model lacks is new, and the others are as far from each other as they were.
#[test]
fn a_network_that_starts_from_a_model_of_fewer_classes_computes_what_the_model_does() {
    let (clouds, folder) = (crate::clouds(24), tempfile::tempdir().unwrap());
    let [taught, started] = ["a", "b"].map(|name| folder.path().join(name));
    let plain = Recipe { negatives: 0.0, unknown: vec![], ..recipe() };
    let card = |classes: &[String]| ModelCard {
        classes: classes.to_vec(),
        points: Some(32),
        edge_radii: vec![0.5],
        ..ModelCard::default()
    };
    let mut trainer = Trainer::new(plain, 3).unwrap();
    trainer.learn(&clouds, |_| {}).unwrap();
    model_file::ship(&taught, &mut trainer.model, &card(&clouds.classes)).unwrap();

    let with_negatives = added(clouds.clone(), &recipe(), "learnt", 0);
    let card_of_four = card(&with_negatives.classes);
    let mut trainer = Trainer::new(Recipe { seed: 9, ..recipe() }, 4).unwrap();
    init::start(&mut trainer, &taught, &card_of_four, &with_negatives).unwrap();
    model_file::ship(&started, &mut trainer.model, &card_of_four).unwrap();

    let [mut before, mut after] =
        [taught, started].map(|path| Classifier::load(&path, &Options::default()).unwrap());
    for i in 0..clouds.len() {
        let before = &before.classify(clouds.set.cloud(i)).unwrap().logits;
        let after = &after.classify(clouds.set.cloud(i)).unwrap().logits;
        assert_eq!((before.len(), after.len()), (3, 4));
        for (before, after) in before.iter().zip(after) {
            // Five layers of weights that are rounded to 11 bits once more, relatively.
            assert!((before - after).abs() < 0.01 * before.abs().max(1.0), "{before}, {after}");
        }
    }
}
