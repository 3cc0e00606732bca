//! What happens to clouds on their way to the network.

use train::augment::draw;
use train::recipe::{Augment, Recipe, Sampling};

fn plain() -> Recipe {
    let augment = Augment { drop: 0.0, scale: [1.0, 1.0], shift: 0.0, ..Augment::default() };
    Recipe { points: 16, augment, ..Recipe::default() }
}

#[test]
fn without_augmentation_a_cloud_is_its_first_points() {
    let clouds = crate::clouds(4);
    let drawn = draw(&clouds, 1, 0, &plain());
    assert_eq!(drawn.points, clouds.set.cloud(1)[..16]);
    assert_eq!((drawn.first_weight, &drawn.target[..]), (1.0, &[0.0, 1.0, 0.0][..]));
}

#[test]
fn what_is_dropped_counts_with_the_first_point() {
    let clouds = crate::clouds(4);
    let recipe = Recipe { augment: Augment { drop: 0.875, ..plain().augment }, ..plain() };
    let mut dropped = 0;
    for epoch in 0..200 {
        let drawn = draw(&clouds, 0, epoch, &recipe);
        assert_eq!(drawn.points[0], clouds.set.cloud(0)[0]);
        let missing = 16 - drawn.points.len();
        assert_eq!(drawn.first_weight, 1.0 + missing as f32);
        dropped += missing;
    }
    // 15 points that can be dropped, each with a chance that is 0.4375 on
    // average; the chance's own spread of 0.253 makes a mean over 200 epochs
    // vary by 15 x 0.253 / √200 = 0.27 points.
    let mean = dropped as f64 / 200.0;
    assert!((mean - 15.0 * 0.4375).abs() < 4.0 * 0.27, "{mean}");
}

#[test]
fn a_draw_depends_on_cloud_epoch_and_seed_alone() {
    let clouds = crate::clouds(6);
    for sampling in [Sampling::Random, Sampling::Fps] {
        let recipe = Recipe { points: 12, sampling, ..Recipe::default() };
        let drawn = draw(&clouds, 3, 2, &recipe);
        assert_eq!(drawn, draw(&clouds, 3, 2, &recipe));
        assert_ne!(drawn, draw(&clouds, 3, 3, &recipe));
        assert_ne!(drawn, draw(&clouds, 3, 2, &Recipe { seed: 1, ..recipe.clone() }));
    }
}

#[test]
fn a_turn_about_the_up_axis_keeps_heights_and_radii() {
    let clouds = crate::clouds(4);
    let augment = Augment { rotate_degrees: 180.0, ..plain().augment };
    let drawn = draw(&clouds, 0, 0, &Recipe { augment, ..plain() });
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
fn a_mixed_cloud_has_a_mixed_target() {
    let clouds = crate::clouds(6);
    let augment = Augment { cut_mix: 1.0, ..plain().augment };
    let recipe = Recipe { augment, ..plain() };
    for epoch in 0..20 {
        let drawn = draw(&clouds, 0, epoch, &recipe);
        let own = drawn.points.iter().filter(|p| clouds.set.cloud(0).contains(p)).count();
        let share = drawn.target[0];
        assert!((drawn.target.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        // Of class 0 are its own points, and perhaps those mixed in.
        assert!(share >= own as f32 / 16.0 - 1e-6, "{share}, {own}");
    }
}
