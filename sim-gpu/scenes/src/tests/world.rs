//! Where objects stand and move, and what scenes tell of them.

use glam::{DVec2, DVec3};

use super::{RECIPE, drive_recipe, stage};
use crate::{DrawnScene, Drive};

/// On flat ground, which hides nothing. A box is that at the mean time of its points, of which motion
/// moves each by its own time.
#[test]
fn boxes_hold_their_points_and_tell_how_many_are_hidden() {
    let text = RECIPE.replace("off_road_m = [0, 3]", "off_road_m = [0, 3], speed_m_s = [20, 20]");
    let stage = stage(&text[..text.find("slope_deg").unwrap()]);
    let mut n_hidden = 0;
    for number in 0..3 {
        let scene = DrawnScene::draw(&stage, number);
        let sweep = stage.sweep(&scene).unwrap();
        let times_s: Vec<f64> = sweep.scan.time_s.iter().flatten().map(|&t| t.into()).collect();
        let level = scene.level_from_sensor();
        let level_from_world = level * scene.pose.rotation.inverse();
        for of in stage.boxes(&scene, &sweep).unwrap() {
            let is_own = |&i: &usize| sweep.surfaces()[i] as usize == of.object + 1;
            let own: Vec<usize> = (0..times_s.len()).filter(is_own).collect();
            let mean_s = own.iter().map(|&i| times_s[i]).sum::<f64>() / own.len() as f64;
            for &i in &own {
                let moved_m = scene.velocity_m_s * (times_s[i] - mean_s);
                let at = level * DVec3::from(sweep.points()[i].map(f64::from))
                    + level_from_world * moved_m;
                // Vertices and points are rounded to f32.
                assert!(of.place.contains(at.to_array(), 1e-3), "object {}: {at}", of.object);
            }
            let objects = vec![scene.objects[of.object].clone()];
            let alone = stage.sweep(&DrawnScene { objects, ..scene.clone() }).unwrap();
            let n_alone = alone.surfaces().iter().filter(|surface| **surface == 1).count();
            assert_eq!(of.visible, own.len() as f64 / n_alone as f64, "object {}", of.object);
            n_hidden += usize::from(of.visible < 1.0);
        }
    }
    assert!(n_hidden > 3, "{n_hidden}");
}

/// 1000 s after the start: by then, walkers have gone 1 to 2 km, beside 10 km of the street. A block of
/// 40 m has 4 to 8 of them, each in one of the four lanes by chance: the number in a lane is binomial,
/// of a number N with the mean 6 and the variance 2, and a chance p of 1/4.
#[test]
fn traffic_keeps_to_the_right_and_is_as_dense_as_the_recipe_says() {
    let stage = stage(&drive_recipe());
    let mut drive = Drive::new(&stage, 6.0).unwrap();
    let [from_m, to_m, time_s] = [6_000.0, 16_000.0, 1_000.0];
    drive.street.draw_around([(from_m, time_s), (to_m, time_s)]);
    let (mut n_walkers, mut n_cars) = (0.0, 0);
    for object in &drive.street.objects {
        let ahead = object.velocity_m_s.x;
        let is_there = (from_m..to_m).contains(&object.centre_m(time_s).x);
        match &*stage.recipe().object[object.placed.entry].class {
            _ if !is_there || object.velocity_m_s == DVec3::ZERO => {}
            "person" => n_walkers += 1.0,
            _ => {
                n_cars += 1;
                let left_m = object.placed.position.y - drive.street.ground.road_y_m;
                assert!(left_m * ahead < 0.0, "{left_m} m to the left at {ahead} m/s");
            }
        }
    }
    let n_blocks = (to_m - from_m) / 40.0;
    let variance = 4.0 * (6.0 * 0.25 * 0.75 + 2.0 * 0.25f64.powi(2));
    let bound = 6.0 * (variance / n_blocks).sqrt();
    assert!((n_walkers / n_blocks - 6.0f64).abs() < bound, "{n_walkers} in {n_blocks} blocks");
    assert!(n_cars > 100, "{n_cars}");
}

/// Their directions are off by up to sqrt(3) times 0.04.
#[test]
fn houses_face_the_road() {
    let hedge = "kind = \"hedge\", class = \"bush\", count = [2, 4], place = \"line\"";
    let house = "kind = \"house-front\", class = \"house\", count = [6, 6], place = \"front\"";
    let stage = stage(&RECIPE.replace(hedge, house));
    let mut n = 0;
    for number in 0..10 {
        let scene = DrawnScene::draw(&stage, number);
        for house in scene.objects.iter().filter(|of| of.entry == 2) {
            let beside_m = house.position.y - scene.ground.road_y_m;
            let to_road = DVec2::new(0.0, -beside_m.signum());
            let off_rad = DVec2::from_angle(house.yaw_rad).angle_to(to_road);
            assert!(off_rad.abs() <= 0.04 * 3f64.sqrt() + 1e-12, "{off_rad}");
            n += 1;
        }
    }
    assert!(n > 20, "{n}");
}
