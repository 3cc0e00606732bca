use crate::augment::augment;
use crate::recipe::{Augment, Edge, Recipe, Sampling};

fn plain() -> Recipe {
    let by = Augment { drop: 0.0, scale: [1.0, 1.0], shift: 0.0, ..Augment::default() };
    Recipe { points: 16, augment: by, ..Recipe::default() }
}

#[test]
fn without_augmentation_a_cloud_is_its_first_points() {
    let clouds = super::clouds(4);
    let drawn = augment(&clouds, 1, (0, 0), &plain());
    assert_eq!(drawn.points, clouds.set.cloud(1)[..16]);
    assert_eq!((drawn.first_weight, &drawn.target[..]), (1.0, &[0.0, 1.0, 0.0][..]));
}

#[test]
fn dropped_points_count_with_the_first_point() {
    let clouds = super::clouds(4);
    let recipe = Recipe { augment: Augment { drop: 0.875, ..plain().augment }, ..plain() };
    let mut dropped = 0;
    for epoch in 0..200 {
        let drawn = augment(&clouds, 0, (epoch, 0), &recipe);
        assert_eq!(drawn.points[0], clouds.set.cloud(0)[0]);
        let missing = 16 - drawn.points.len();
        assert_eq!(drawn.first_weight, 1.0 + missing as f32);
        dropped += missing;
    }
    // 15 points that can be dropped, each with a chance that is 0.4375 on average; the chance's own
    // spread of 0.253 makes a mean over 200 epochs vary by 15 x 0.253 / √200 = 0.27 points.
    let mean = dropped as f64 / 200.0;
    assert!((mean - 15.0 * 0.4375).abs() < 4.0 * 0.27, "{mean}");
}

#[test]
fn a_draw_depends_on_cloud_epoch_and_seed_alone() {
    let clouds = super::clouds(6);
    for sampling in [Sampling::Random, Sampling::Fps] {
        let recipe = Recipe { points: 12, sampling, ..Recipe::default() };
        let drawn = augment(&clouds, 3, (2, 0), &recipe);
        assert_eq!(drawn, augment(&clouds, 3, (2, 0), &recipe));
        assert_ne!(drawn, augment(&clouds, 3, (3, 0), &recipe));
        assert_ne!(drawn, augment(&clouds, 3, (2, 0), &Recipe { seed: 1, ..recipe.clone() }));
    }
}

#[test]
fn a_rotation_about_z_keeps_heights_and_radii() {
    let clouds = super::clouds(4);
    let by = Augment { rotate_degrees: 180.0, ..plain().augment };
    let drawn = augment(&clouds, 0, (0, 0), &Recipe { augment: by, ..plain() });
    let mut turned = false;
    for (point, before) in drawn.points.iter().zip(clouds.set.cloud(0)) {
        assert_eq!(point[2], before[2]);
        let radius = |p: &[f32; 3]| p[0].hypot(p[1]);
        // Rounding of coordinates below 1.
        assert!((radius(point) - radius(before)).abs() < 1e-6);
        turned |= (point[0] - before[0]).abs() > 1e-3;
    }
    assert!(turned);
}

#[test]
fn jitter_is_normal_up_to_its_clip() {
    let clouds = super::clouds(3);
    let shaken = Augment { jitter: 1.0 / 30.0, ..plain().augment };
    let recipe = Recipe { points: 32, augment: shaken, ..plain() };
    let drawn = (0..100).flat_map(|epoch| augment(&clouds, 0, (epoch, 0), &recipe).points);
    let off = drawn.zip(clouds.set.cloud(0).iter().cycle());
    let off: Vec<f32> = off.flat_map(|(a, b)| [0, 1, 2].map(|k| (a[k] - b[k]).abs())).collect();
    // Coordinates below 1 are rounded to 6e-8, twice.
    assert!(off.iter().all(|off| *off <= 0.05 + 2e-7));
    // 0.1336 of 9600 normal numbers are beyond 1.5 of their deviations, with five of 0.0035.
    let share = off.iter().filter(|off| **off > 0.05 - 2e-7).count() as f64 / off.len() as f64;
    assert!((share - 0.1336).abs() < 5.0 * 0.0035, "{share}");
}

#[test]
fn a_chosen_point_is_in_its_neighborhood() {
    let clouds = super::clouds(3);
    for sampling in [Sampling::First, Sampling::Random, Sampling::Fps] {
        let by = Augment { jitter: 0.01, drop: 0.5, ..Augment::default() };
        let mut recipe = Recipe { points: 16, sampling, augment: by, ..Recipe::default() };
        recipe.network.edges = vec![Edge { radius: 0.3, channels: 4 }];
        for epoch in 0..5 {
            let drawn = augment(&clouds, 1, (epoch, 0), &recipe);
            assert!(
                drawn.points.iter().all(|point| drawn.neighborhood.contains(point)),
                "{sampling:?}"
            );
            assert!(drawn.neighborhood.len() >= 16 && drawn.points.len() <= 16);
        }
    }
}
