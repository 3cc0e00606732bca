use train::augment;
use train::recipe::{Augment, Recipe, Sampling};
use train::shape::Edge;

fn plain() -> Recipe {
    let augment = Augment { drop: 0.0, scale: [1.0, 1.0], shift: 0.0, ..Augment::default() };
    Recipe { points: 16, augment, ..Recipe::default() }
}

#[test]
fn without_augmentation_a_cloud_is_its_first_points() {
    let clouds = crate::clouds(4);
    let drawn = augment::augment(&clouds, 1, (0, 0), &plain());
    assert_eq!(drawn.points, clouds.set.cloud(1)[..16]);
    assert_eq!((drawn.first_weight, &drawn.target[..]), (1.0, &[0.0, 1.0, 0.0][..]));
}

#[test]
fn what_is_dropped_counts_with_the_first_point() {
    let clouds = crate::clouds(4);
    let recipe = Recipe { augment: Augment { drop: 0.875, ..plain().augment }, ..plain() };
    let mut dropped = 0;
    for epoch in 0..200 {
        let drawn = augment::augment(&clouds, 0, (epoch, 0), &recipe);
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
    let clouds = crate::clouds(6);
    for sampling in [Sampling::Random, Sampling::Fps] {
        let recipe = Recipe { points: 12, sampling, ..Recipe::default() };
        let drawn = augment::augment(&clouds, 3, (2, 0), &recipe);
        assert_eq!(drawn, augment::augment(&clouds, 3, (2, 0), &recipe));
        assert_ne!(drawn, augment::augment(&clouds, 3, (3, 0), &recipe));
        assert_ne!(
            drawn,
            augment::augment(&clouds, 3, (2, 0), &Recipe { seed: 1, ..recipe.clone() })
        );
    }
}

#[test]
fn a_turn_about_the_up_axis_keeps_heights_and_radii() {
    let clouds = crate::clouds(4);
    let augment = Augment { rotate_degrees: 180.0, ..plain().augment };
    let drawn = augment::augment(&clouds, 0, (0, 0), &Recipe { augment, ..plain() });
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
    let clouds = crate::clouds(3);
    let shaken = Augment { jitter: 0.01, jitter_clip: 0.015, ..plain().augment };
    let recipe = Recipe { points: 32, augment: shaken, ..plain() };
    let drawn = (0..100).flat_map(|epoch| augment::augment(&clouds, 0, (epoch, 0), &recipe).points);
    let off = drawn.zip(clouds.set.cloud(0).iter().cycle());
    let off: Vec<f32> = off.flat_map(|(a, b)| [0, 1, 2].map(|k| (a[k] - b[k]).abs())).collect();
    // Coordinates below 1 are rounded to 6e-8, twice.
    assert!(off.iter().all(|off| *off <= 0.015 + 2e-7));
    // 0.1336 of 9600 normal numbers are beyond 1.5 of their deviations, with five of 0.0035.
    let share = off.iter().filter(|off| **off > 0.015 - 2e-7).count() as f64 / off.len() as f64;
    assert!((share - 0.1336).abs() < 5.0 * 0.0035, "{share}");
}

#[test]
fn a_sensor_s_noise_is_along_its_rays() {
    let clouds = crate::clouds(3);
    let noisy = Augment { sensor_noise: 0.01, ..plain().augment };
    let recipe = Recipe { points: 32, augment: noisy, ..plain() };
    let (mut sum, mut across, mut n) = (0.0, 0.0, 0.0);
    for epoch in 0..200 {
        let drawn = augment::augment(&clouds, 0, (epoch, 0), &recipe).points;
        let errors: Vec<[f64; 3]> = drawn
            .iter()
            .zip(clouds.set.cloud(0))
            .map(|(moved, at)| [0, 1, 2].map(|k| f64::from(moved[k] - at[k])))
            .collect();
        for error in &errors {
            sum += error.iter().map(|x| x * x).sum::<f64>();
            n += 1.0;
        }
        // Rays to points within 1 of a place 3 away are within 20 degrees of each other, so that
        // two errors span an angle of 40 at most.
        let length = |e: &[f64; 3]| e.iter().map(|x| x * x).sum::<f64>().sqrt();
        let dot: f64 = errors[0].iter().zip(&errors[1]).map(|(a, b)| a * b).sum();
        across +=
            f64::from(u8::from(dot.abs() < 0.76 * length(&errors[0]) * length(&errors[1]) - 1e-9));
    }
    // A chi-squared of 6,400: its mean is off by 1.8 %; five of those.
    assert!((sum / n / 1e-4 - 1.0).abs() < 0.09, "{}", sum / n);
    assert_eq!(across, 0.0);
}

#[test]
fn a_chosen_point_is_in_its_neighborhood() {
    let clouds = crate::clouds(3);
    for sampling in [Sampling::First, Sampling::Random, Sampling::Fps] {
        let augment = Augment { jitter: 0.01, sensor_noise: 0.02, drop: 0.5, ..Augment::default() };
        let mut recipe = Recipe { points: 16, sampling, augment, ..Recipe::default() };
        recipe.network.edges = vec![Edge { radius: 0.3, channels: 4 }];
        for epoch in 0..5 {
            let drawn = augment::augment(&clouds, 1, (epoch, 0), &recipe);
            assert!(
                drawn.points.iter().all(|point| drawn.neighborhood.contains(point)),
                "{sampling:?}"
            );
            assert!(drawn.neighborhood.len() >= 16 && drawn.points.len() <= 16);
        }
    }
}

#[test]
fn a_ball_of_points_is_mixed_in() {
    let clouds = crate::clouds(6);
    let augment = Augment { cut_mix: 1.0, ..plain().augment };
    let mut recipe = Recipe { points: 32, augment, ..plain() };
    recipe.network.edges = vec![Edge { radius: 0.3, channels: 4 }];
    for epoch in 0..20 {
        let drawn = augment::augment(&clouds, 0, (epoch, 0), &recipe);
        assert_eq!(drawn.points, drawn.neighborhood, "the surroundings are the mixed cloud's");
        let whole = clouds.set.cloud(0);
        let (kept, gone): (Vec<_>, Vec<_>) = whole.iter().partition(|p| drawn.points.contains(p));
        assert!((drawn.target.iter().sum::<f32>() - 1.0).abs() < 1e-6);
        let share = drawn.target[1] + drawn.target[2];
        if share > 0.0 {
            // Points of another class.
            assert_eq!(gone.len() as f32 / 32.0, share);
            assert_eq!(drawn.points.iter().filter(|p| !whole.contains(p)).count(), gone.len());
        }
        // Some point is the centre of a ball that holds exactly what is gone, and of one that holds
        // what has come, of its own cloud.
        let come: Vec<_> = drawn.points.iter().filter(|p| !whole.contains(p)).collect();
        let other = (1..6).find(|&i| come.iter().any(|p| clouds.set.cloud(i).contains(p)));
        let (_, left): (Vec<_>, Vec<_>) =
            clouds.set.cloud(other.unwrap_or(0)).iter().partition(|p| come.contains(p));
        let is_centre = |c: &[f32; 3]| {
            let far = |p: &[f32; 3]| (0..3).map(|k| (p[k] - c[k]).powi(2)).sum::<f32>();
            let holds = |inner: &[&[f32; 3]], outer: &[&[f32; 3]]| {
                let nearest = outer.iter().map(|p| far(p)).fold(f32::MAX, f32::min);
                inner.iter().all(|p| far(p) <= nearest)
            };
            holds(&gone, &kept) && holds(&come, &left)
        };
        assert!(whole.iter().any(is_centre), "{epoch}");
    }
}
