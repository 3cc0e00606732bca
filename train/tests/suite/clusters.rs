use formats::labelled::LabelledSet;
use formats::model_card::Normalization;
use formats::rng::StreamKey;
use train::augment::{TrainingCloud, augment};
use train::clouds::Clouds;
use train::cluster_variation::ClusterVariation;
use train::recipe::{Augment, Recipe, Sampling};

/// Edges of boxes of each class, metres.
const BOXES: [(&str, [f64; 3]); 3] =
    [("car", [4.5, 1.8, 1.5]), ("person", [0.5, 0.5, 1.75]), ("wall", [9.0, 0.2, 3.0])];

/// Points in a box some metres from the sensor.
fn cluster(class: usize, n: usize, key: StreamKey) -> Vec<[f32; 3]> {
    let centre = [5.0 + 20.0 * key.unit(0), 10.0 * key.unit(1), -1.7];
    let point = |i: usize| {
        let unit = |axis: usize| key.unit((2 + 3 * i + axis) as u64);
        [0, 1, 2].map(|axis| (centre[axis] + BOXES[class].1[axis] * unit(axis)) as f32)
    };
    (0..n).map(point).collect()
}

fn one_cluster(n: usize) -> Clouds {
    let mut set = LabelledSet::default();
    set.push(&cluster(0, n, StreamKey::new(1, "cluster", 0)), 0);
    Clouds { set, classes: ["car", "person"].map(str::to_owned).to_vec() }
}

fn metric() -> Recipe {
    let augment = Augment { drop: 0.0, scale: [1.0, 1.0], shift: 0.0, ..Augment::default() };
    let (sampling, normalization) = (Sampling::Random, Normalization::Metric);
    Recipe { points: 1000, sampling, normalization, augment, ..Recipe::default() }
}

/// 40 draws of one cluster of `n` points.
fn drawn(n: usize, recipe: &Recipe) -> Vec<TrainingCloud> {
    recipe.check().unwrap();
    let clouds = one_cluster(n);
    (0..40).map(|epoch| augment(&clouds, 0, (epoch, 0), recipe)).collect()
}

fn span(points: &[[f32; 3]], axis: usize) -> (f32, f32) {
    let along = points.iter().map(|point| point[axis]);
    along.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), x| (low.min(x), high.max(x)))
}

#[test]
fn a_cluster_keeps_its_size_and_stands_on_zero() {
    let before = one_cluster(300);
    for drawn in drawn(300, &metric()) {
        assert_eq!(drawn.points.len(), 300);
        for axis in 0..3 {
            let ((low, high), (before_low, before_high)) =
                (span(&drawn.points, axis), span(before.set.cloud(0), axis));
            // Coordinates of up to 32 m have steps of 2e-6 m.
            assert!((high - low - (before_high - before_low)).abs() < 1e-5, "{axis}");
            assert!(if axis == 2 { low == 0.0 } else { low < 0.0 && high > 0.0 });
        }
    }
}

#[test]
fn a_draw_has_a_density_of_its_own_and_the_network_its_own_number_of_points() {
    let clusters = ClusterVariation { density: Some([20, 200]), ..ClusterVariation::default() };
    let recipe = Recipe { points: 100, clusters, ..metric() };
    let sizes = |n| drawn(n, &recipe).iter().map(|drawn| drawn.points.len()).collect::<Vec<_>>();
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
    let noisy = Augment { sensor_noise: 0.05, ..metric().augment };
    let clouds = one_cluster(200);
    let plain = augment(&clouds, 0, (0, 0), &Recipe { sampling: Sampling::First, ..metric() });
    let mut squares = 0.0;
    for epoch in 0..40 {
        let recipe = Recipe { augment: noisy.clone(), sampling: Sampling::First, ..metric() };
        let drawn = augment(&clouds, 0, (epoch, 0), &recipe);
        let errors: Vec<[f64; 3]> = (0..200)
            .map(|i| [0, 1, 2].map(|k| f64::from(drawn.points[i][k] - plain.points[i][k])))
            .collect();
        // The centring moved all of them alike: what is left is along the rays, which lie within
        // some degrees, so that the height's share is small.
        let mean = [0, 1, 2].map(|k| errors.iter().map(|e| e[k]).sum::<f64>() / 200.0);
        let square = |e: &[f64; 3]| (0..3).map(|k| (e[k] - mean[k]).powi(2)).sum::<f64>();
        squares += errors.iter().map(square).sum::<f64>();
    }
    // 8000 squares of a deviation of 0.05 m: their mean is off by 1.6 %; five of those.
    let variance = squares / 8000.0;
    assert!((variance / 0.0025 - 1.0).abs() < 0.08, "{variance}");
}

#[test]
fn a_foot_is_cut_and_strays_are_added_as_the_recipe_says() {
    let clusters = ClusterVariation { cut: 0.3, ..ClusterVariation::default() };
    for drawn in drawn(300, &Recipe { clusters, ..metric() }) {
        // A fifth of a box 1.5 m high is cut at most.
        assert!((200..=300).contains(&drawn.points.len()), "{}", drawn.points.len());
        assert!(span(&drawn.points, 2).1 > 1.1);
    }
    let clusters = ClusterVariation {
        stray_share: 1.0,
        strays: 3,
        stray_reach: 2.0,
        ..ClusterVariation::default()
    };
    let drawn = drawn(100, &Recipe { clusters, ..metric() });
    assert!(drawn.iter().all(|drawn| (101..=103).contains(&drawn.points.len())));
    assert!(drawn.iter().any(|drawn| span(&drawn.points, 2).1 > 1.6));
    assert!(drawn.iter().all(|drawn| span(&drawn.points, 2).1 < 3.6));
}

/// The cluster begins 0.4 m above the ground, which is at 0.
#[test]
fn strips_of_ground_lie_on_the_ground_where_it_is_known() {
    let mut clouds = one_cluster(100);
    clouds.set.height_m = Some(vec![0.4]);
    let clusters =
        ClusterVariation { ground_share: 1.0, ground_reach: 1.0, ..ClusterVariation::default() };
    let recipe = Recipe { clusters, sampling: Sampling::First, ..metric() };
    for epoch in 0..20 {
        let drawn = augment(&clouds, 0, (epoch, 0), &recipe).points;
        let (cluster, strips) = drawn.split_at(100);
        assert!((span(cluster, 2).0 - 0.4).abs() < 1e-6);
        assert!(!strips.is_empty() && strips.iter().all(|point| point[2].abs() < 1e-6));
    }
}

#[test]
fn variations_are_refused_where_they_mean_nothing() {
    let clusters = ClusterVariation { cut: 0.1, ..ClusterVariation::default() };
    let error = |recipe: Recipe| recipe.check().unwrap_err().to_string();
    let unit_sphere = Recipe { clusters, ..Recipe::default() };
    assert!(error(unit_sphere).contains("`clusters`: expected `normalization` to be metric"));
    let clusters = ClusterVariation { density: Some([9, 3]), ..ClusterVariation::default() };
    assert!(error(Recipe { clusters, ..metric() }).contains("`clusters.density`"));
    let recipe = Recipe { keep_known: Some(0.95), validation: 0.0, ..metric() };
    assert!(error(recipe).contains("`validation`: expected more than 0"));
}
