use crate::augment::augment;
use crate::clouds::Clouds;
use crate::recipe::{Augment, ClusterVariation, Recipe, Sampling};
use formats::labelled::LabelledSet;
use formats::model_card::Normalization;
use formats::rng::StreamKey;

/// `n` points in a box of a car's size, some metres from the sensor.
fn car(n: usize) -> Clouds {
    let key = StreamKey::new(1, "cluster", 0);
    let centre = [5.0 + 20.0 * key.unit(0), 10.0 * key.unit(1), -1.7];
    let unit = |i: usize, axis: usize| key.unit((2 + 3 * i + axis) as u64);
    let point = |i| [0, 1, 2].map(|k| (centre[k] + [4.5, 1.8, 1.5][k] * unit(i, k)) as f32);
    let mut set = LabelledSet::default();
    set.push(&(0..n).map(point).collect::<Vec<_>>(), 0);
    Clouds { set, classes: ["car", "person"].map(str::to_owned).to_vec() }
}

fn metric() -> Recipe {
    let augment = Augment { drop: 0.0, scale: [1.0, 1.0], shift: 0.0, ..Augment::default() };
    let (sampling, normalization) = (Sampling::Random, Normalization::Metric);
    Recipe { points: 1000, sampling, normalization, augment, ..Recipe::default() }
}

fn varied(clusters: ClusterVariation) -> Recipe {
    Recipe { clusters, ..metric() }
}

/// 40 draws of one cluster.
fn drawn(clouds: &Clouds, recipe: &Recipe) -> Vec<Vec<[f32; 3]>> {
    recipe.check().unwrap();
    (0..40).map(|epoch| augment(clouds, 0, (epoch, 0), recipe).points).collect()
}

fn span(points: &[[f32; 3]], axis: usize) -> (f32, f32) {
    let along = points.iter().map(|point| point[axis]);
    along.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

#[test]
fn a_cluster_keeps_its_size_and_stands_on_zero() {
    let before = car(300);
    for drawn in drawn(&before, &metric()) {
        assert_eq!(drawn.len(), 300);
        for axis in 0..3 {
            let [(low, high), (before_low, before_high)] =
                [&drawn, before.set.cloud(0)].map(|points| span(points, axis));
            // Coordinates of up to 32 m have steps of 2e-6 m.
            assert!((high - low - (before_high - before_low)).abs() < 1e-5, "{axis}");
            assert!(if axis == 2 { low == 0.0 } else { low < 0.0 && high > 0.0 });
        }
    }
}

#[test]
fn a_draw_has_a_density_of_its_own_and_the_network_its_own_number_of_points() {
    let density = Some([20, 200]);
    let recipe =
        Recipe { points: 100, ..varied(ClusterVariation { density, ..Default::default() }) };
    let sizes = |n| drawn(&car(n), &recipe).iter().map(Vec::len).collect::<Vec<_>>();
    let of_many = sizes(300);
    assert!(of_many.iter().all(|n| (20..=100).contains(n)), "{of_many:?}");
    // Half of the draws, log-uniform from 20 to 200, have less than 63 points. Of 40 such draws, 8
    // to 32 are within 3.8 standard deviations.
    let few = of_many.iter().filter(|n| **n < 63).count();
    assert!((8..=32).contains(&few), "{of_many:?}");
    assert!(sizes(15).iter().all(|n| *n == 15));
}

#[test]
fn a_sensor_s_noise_is_along_the_rays_from_the_origin() {
    let first = Recipe { sampling: Sampling::First, ..metric() };
    let noisy = Augment { sensor_noise: 0.05, ..metric().augment };
    let clouds = car(200);
    let plain = drawn(&clouds, &first).swap_remove(0);
    let mut squares = 0.0;
    for drawn in drawn(&clouds, &Recipe { augment: noisy, ..first }) {
        // The centring moved all of them alike: what is left is along the rays, which lie within
        // some degrees, so that the height's share is small.
        for axis in 0..3 {
            let errors = || (0..200).map(|i| f64::from(drawn[i][axis] - plain[i][axis]));
            let mean = errors().sum::<f64>() / 200.0;
            squares += errors().map(|error| (error - mean).powi(2)).sum::<f64>();
        }
    }
    // 8000 squares of a deviation of 0.05 m: their mean is off by 1.6 %; five of those.
    let variance = squares / 8000.0;
    assert!((variance / 0.0025 - 1.0).abs() < 0.08, "{variance}");
}

#[test]
fn a_foot_is_cut_and_strays_are_added_as_the_recipe_says() {
    for drawn in drawn(&car(300), &varied(ClusterVariation { cut: 0.3, ..Default::default() })) {
        // A fifth of a box 1.5 m high is cut at most.
        assert!((200..=300).contains(&drawn.len()), "{}", drawn.len());
        assert!(span(&drawn, 2).1 > 1.1);
    }
    let strays = varied(ClusterVariation { stray_share: 1.0, ..Default::default() });
    let drawn = drawn(&car(100), &strays);
    assert!(drawn.iter().all(|drawn| (101..=105).contains(&drawn.len())));
    assert!(drawn.iter().any(|drawn| span(drawn, 2).1 > 1.6));
    assert!(drawn.iter().all(|drawn| span(drawn, 2).1 < 2.1));
}

/// The cluster begins 0.4 m above the ground, which is at 0.
#[test]
fn strips_of_ground_lie_on_the_ground_where_it_is_known() {
    let mut clouds = car(100);
    clouds.set.height_m = Some(vec![0.4]);
    let ground = ClusterVariation { ground_share: 1.0, ..Default::default() };
    let mut n_known = 0;
    for drawn in drawn(&clouds, &Recipe { sampling: Sampling::First, ..varied(ground) }) {
        let (cluster, strips) = drawn.split_at(100);
        assert!(!strips.is_empty());
        // The height counts as unknown for three clusters of ten.
        if (span(cluster, 2).0 - 0.4).abs() < 1e-6 {
            n_known += 1;
            assert!(strips.iter().all(|point| point[2].abs() < 1e-6));
        }
    }
    // 40 draws with a chance of 0.7: 28, and four standard deviations of 2.9.
    assert!((17..40).contains(&n_known), "{n_known}");
}

#[test]
fn variations_without_a_meaning_are_refused() {
    let noisy = Augment { sensor_noise: 0.02, ..Augment::default() };
    let unknown = vec!["car".to_owned()];
    let clusters = ClusterVariation { cut: 0.1, ..Default::default() };
    let density = Some([9, 3]);
    for (recipe, expected) in [
        (Recipe { clusters, ..Recipe::default() }, "clusters: expected `normalization` to be"),
        (varied(ClusterVariation { density, ..Default::default() }), "clusters.density: "),
        (Recipe { unknown, validation: 0.0, ..metric() }, "validation: expected more than 0"),
        (Recipe { augment: noisy, ..Recipe::default() }, "augment.sensor_noise: expected 0"),
    ] {
        let error = recipe.check().unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
