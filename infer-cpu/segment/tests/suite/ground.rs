//! Which points are ground, and the height of the ground.

use edgepuck_segment::{Label, Segmenter, Settings, Sweep, other_axis_up};

use crate::scanner::{HEIGHT, Surface, VLP32C, block, flat, ground, scan};

fn is_ground(label: Label) -> bool {
    label == Label::Ground
}

#[test]
fn a_flat_plane_is_all_ground_at_its_height() {
    let scan = scan(&VLP32C, &[flat()]);
    scan.check(|segmentation| {
        assert_eq!(scan.share(segmentation, 0, is_ground), 1.0);
        assert_eq!(segmentation.clusters().len(), 0);
        for [x, y] in [[5.0, 0.0], [-3.0, 20.0], [0.0, 0.0], [30.0, -20.0]] {
            let z_m = segmentation.ground_z_m(x, y).unwrap();
            assert!((f64::from(z_m) + HEIGHT).abs() < 1e-5, "{z_m} at {x} {y}");
        }
        assert_eq!(segmentation.ground_z_m(3000.0, 0.0), None);
        assert_eq!(segmentation.ground_z_m(f32::NAN, 0.0), None);
    });
}

#[test]
fn boxes_stand_on_the_ground() {
    let scan = scan(
        &VLP32C,
        &[
            flat(),
            block([10.0, 3.0], [2.0, 4.0], 0.0, 1.5),
            block([-8.0, 0.0], [0.5, 0.5], 0.0, 1.7),
        ],
    );
    scan.check(|segmentation| {
        assert_eq!(scan.share(segmentation, 0, is_ground), 1.0);
        assert_eq!(scan.surfaces_of_clusters(segmentation).len(), 2);
        for cluster in segmentation.clusters() {
            let z_m = f64::from(cluster.ground_z_m.unwrap());
            assert!((z_m + HEIGHT).abs() < 0.05, "{z_m}");
        }
        for (label, point) in segmentation.labels().iter().zip(&scan.points) {
            let height = f64::from(point[2]) + HEIGHT;
            assert!(height < 0.25 || matches!(label, Label::Cluster(_)), "{label:?} at {height}");
            assert!(height > 0.15 || is_ground(*label), "{label:?} at {height}");
        }
    });
}

#[test]
fn a_kerb_of_15_cm_and_the_pavement_behind_it_are_ground() {
    let kerb: Surface = block([0.0, 54.0], [200.0, 100.0], 0.0, 0.15);
    let scan = scan(&VLP32C, &[flat(), kerb]);
    scan.check(|segmentation| {
        assert_eq!(scan.share(segmentation, 0, is_ground), 1.0);
        assert!(scan.share(segmentation, 1, is_ground) > 0.99);
        let z_m = f64::from(segmentation.ground_z_m(0.0, 8.0).unwrap());
        assert!((z_m + HEIGHT - 0.15).abs() < 0.02, "{z_m}");
    });
}

#[test]
fn a_street_of_8_degrees_is_ground_and_carries_boxes() {
    let slope = 8f64.to_radians().tan();
    let hill = ground(slope, 0.0, |_, _| true);
    let scan = scan(&VLP32C, &[hill, block([12.0, 0.0], [1.0, 1.0], 12.0 * slope, 2.0)]);
    scan.check(|segmentation| {
        assert!(scan.share(segmentation, 0, is_ground) > 0.99);
        assert!(scan.share(segmentation, 1, is_ground) < 0.25);
        let z_m = f64::from(segmentation.ground_z_m(9.0, 0.0).unwrap());
        assert!((z_m - (9.0 * slope - HEIGHT)).abs() < 0.05, "{z_m}");
    });
}

/// A hill of up to 20 degrees is a plane of its own, as a tilt of the sensor is.
#[test]
fn a_hill_of_18_degrees_is_ground() {
    let scan = scan(&VLP32C, &[ground(18f64.to_radians().tan(), 0.0, |x, _| x.abs() < 40.0)]);
    scan.check(|segmentation| assert!(scan.share(segmentation, 0, is_ground) > 0.99));
}

/// Its floor lies 0.5 m below the street. The mean of a sector is of both at its sides.
#[test]
fn a_hole_has_a_floor_of_ground() {
    let is_hole = |x: f64, y: f64| (9.0..16.0).contains(&x) && y.abs() < 3.0;
    let street = ground(0.0, 0.0, move |x, y| !is_hole(x, y));
    let scan = scan(&VLP32C, &[street, ground(0.0, -0.5, is_hole)]);
    scan.check(|segmentation| {
        assert!(scan.share(segmentation, 0, is_ground) > 0.99);
        assert_eq!(scan.share(segmentation, 1, is_ground), 1.0);
        let z_m = f64::from(segmentation.ground_z_m(14.8, 0.0).unwrap());
        assert!((z_m + HEIGHT + 0.5).abs() < 0.05, "{z_m}");
    });
}

#[test]
fn a_ramp_that_begins_ahead_is_ground() {
    let slope = 7f64.to_radians().tan();
    let street = ground(0.0, 0.0, |x, _| x < 10.0);
    // Through (10, -HEIGHT): 10 m of slope below the sensor's foot at x = 0.
    let ramp = ground(slope, -10.0 * slope, |x, _| (10.0..40.0).contains(&x));
    let scan = scan(&VLP32C, &[street, ramp]);
    scan.check(|segmentation| {
        let shares = [0, 1].map(|surface| scan.share(segmentation, surface, is_ground));
        assert!(shares.iter().all(|&share| share > 0.99), "{shares:?}");
    });
}

#[test]
fn a_sensor_tilted_by_5_degrees_sees_the_same_ground() {
    let mut scan = scan(&VLP32C, &[flat(), block([10.0, 0.0], [1.0, 2.0], 0.0, 2.5)]);
    let (sin, cos) = 5f32.to_radians().sin_cos();
    scan.points
        .iter_mut()
        .for_each(|[x, _, z]| (*x, *z) = (cos * *x - sin * *z, sin * *x + cos * *z));
    scan.check(|segmentation| {
        assert!(scan.share(segmentation, 0, is_ground) > 0.99);
        assert!(scan.share(segmentation, 1, is_ground) < 0.2);
        assert_eq!(scan.surfaces_of_clusters(segmentation), [[1]]);
    });
}

#[test]
fn a_deck_above_the_street_is_not_ground() {
    let scan = scan(&VLP32C, &[flat(), block([20.0, 0.0], [8.0, 60.0], 4.0, 1.0)]);
    scan.check(|segmentation| {
        assert_eq!(scan.share(segmentation, 1, is_ground), 0.0);
        assert_eq!(scan.share(segmentation, 0, is_ground), 1.0);
    });
}

/// A sensor that a wrong frame puts below the ground finds none or all of it, and does not fail.
#[test]
fn a_sensor_below_the_ground_is_accepted() {
    let mut scan = scan(&VLP32C, &[flat()]);
    scan.points.iter_mut().for_each(|point| point[2] += 3.0);
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    let sweep = Sweep { points: &scan.points, rings: None };
    assert_eq!(segmenter.segment(&sweep).unwrap().labels().len(), scan.points.len());
}

/// Unseen, the ground climbs by a kerb of 0.12 m and a slope of 8 degrees over at most 4 m: 0.68 m.
#[test]
fn ground_behind_a_shadow_may_climb_as_a_street_does() {
    for (shadow_m, height_m, is_street) in [
        (6.0, 0.2, true),
        (6.0, 0.6, true),
        (6.0, 0.8, false),
        (8.0, 1.2, false),
        (10.0, 1.4, false),
    ] {
        let street = ground(0.0, 0.0, |x, _| x < 8.0);
        let is_behind = move |x: f64, y: f64| (8.0 + shadow_m..40.0).contains(&x) && y.abs() < 6.0;
        let scan = scan(&VLP32C, &[street, ground(0.0, height_m, is_behind)]);
        scan.check(|segmentation| {
            assert_eq!(scan.share(segmentation, 0, is_ground), 1.0);
            let share = scan.share(segmentation, 1, is_ground);
            assert_eq!(share, f64::from(u8::from(is_street)), "{height_m} m after {shadow_m} m");
        });
    }
}

/// Everywhere on a slope across the road, beside a kerb and in the shadow of a car.
#[test]
fn the_height_of_the_ground_is_known_between_the_beams() {
    let slope = 5f64.to_radians().tan();
    let car = block([14.0, 2.0], [4.2, 1.8], 12.0 * slope, 1.5 + 4.0 * slope);
    let scan = scan(&VLP32C, &[ground(slope, 0.0, |_, _| true), car]);
    scan.check(|segmentation| {
        for i in 0..400 {
            let (range_m, azimuth) = (4.0 + 0.06 * f64::from(i), f64::from(i) * 0.7);
            let [x, y] = [range_m * azimuth.cos(), range_m * azimuth.sin()];
            let z_m = f64::from(segmentation.ground_z_m(x as f32, y as f32).unwrap());
            // A sector of two degrees is up to 1 m wide, and its mean stands for all of it.
            let bound = 0.02 + slope * range_m * 1f64.to_radians();
            assert!((z_m + HEIGHT - slope * x).abs() < bound, "{x} {y}: {z_m}");
        }
    });
}

/// In a hollow, z = c r^2 - HEIGHT: no plane has these heights, so that they are those between the
/// means of cells, the largest of which are 3 m long. Between such means, a line is c (3 m / 2)^2, some
/// 1 cm, above the hollow.
#[test]
fn the_height_of_a_hollow_is_known_between_the_beams() {
    let c = 0.004;
    let hollow: Surface = Box::new(move |[x, y, z]| {
        let across = c * (x * x + y * y);
        Some((z + (z * z + 4.0 * across * HEIGHT).sqrt()) / (2.0 * across))
    });
    scan(&VLP32C[..20], &[hollow]).check(|segmentation| {
        for i in 0..300 {
            let (range_m, azimuth) = (5.0 + 0.05 * f64::from(i), f64::from(i) * 0.7);
            let [x, y] = [range_m * azimuth.cos(), range_m * azimuth.sin()];
            let z_m = f64::from(segmentation.ground_z_m(x as f32, y as f32).unwrap());
            assert!((z_m + HEIGHT - c * range_m * range_m).abs() < 0.03, "{range_m}: {z_m}");
        }
    });
}

/// A road beside a house, a wall alone, and a ceiling above a floor, in right and wrong axes.
#[test]
fn axes_are_reported_if_another_one_points_up() {
    // A floor and a ceiling are alike, and so are the sides of a post.
    let house = || block([30.0, 12.0], [60.0, 8.0], 0.0, 9.0);
    let wall = || block([5.0, 0.0], [0.2, 20.0], 0.0, 4.0);
    let ceiling = || block([0.0, 0.0], [30.0, 30.0], 2.6, 0.2);
    type Turn = fn([f32; 3]) -> [f32; 3];
    for (up, turn) in [
        (None, (|point| point) as Turn),
        (Some("if y does"), |[x, y, z]| [x, z, -y]),
        (Some("if -y does"), |[x, y, z]| [-y, -z, x]),
        (Some("if x does"), |[x, y, z]| [z, y, -x]),
        (Some("if -z does"), |[x, y, z]| [x, -y, -z]),
    ] {
        for (surfaces, has_ground) in [
            (vec![flat(), house()], true),
            (vec![flat(), wall()], true),
            (vec![wall()], false),
            (vec![block([4.0, 0.0], [0.2, 0.1], 0.0, 6.0)], false),
            (vec![flat(), ceiling()], true),
        ] {
            // Lost returns say nothing.
            let lost = [[0.0; 3], [f32::NAN; 3]].into_iter().cycle().take(100_000);
            let points = scan(&VLP32C, &surfaces).points.into_iter().map(turn).chain(lost);
            let said = other_axis_up(&points.collect::<Vec<_>>());
            let expected = up.filter(|_| has_ground);
            assert_eq!(said.is_some(), expected.is_some(), "{up:?}: {said:?}");
            let said = said.map(|warning| warning.to_string()).unwrap_or_default();
            assert!(said.contains(expected.unwrap_or_default()), "{said}");
        }
    }
    // A sensor that looks upwards, as a Livox Mid-360 does, sees the ceiling more than the floor.
    let upwards: Vec<f64> = (-7..=52).map(f64::from).collect();
    let wall = |x: f64, y: f64| block([x, y], [6.1 - x.abs() * 2.0, 6.1 - y.abs() * 2.0], 0.0, 2.6);
    let walls = [[3.0, 0.0], [-3.0, 0.0], [0.0, 3.0], [0.0, -3.0]].map(|[x, y]| wall(x, y));
    let room: Vec<_> = [flat(), ceiling()].into_iter().chain(walls).collect();
    assert_eq!(other_axis_up(&scan(&upwards, &room).points), None);
    // One that looks everywhere, in a corridor whose walls are nearer than its floor.
    let everywhere: Vec<f64> = (-20..=20).map(|step| f64::from(step) * 4.0).collect();
    let corridor = [wall(0.0, 1.0), wall(0.0, -1.0), flat(), ceiling()];
    assert_eq!(other_axis_up(&scan(&everywhere, &corridor).points), None);
}
