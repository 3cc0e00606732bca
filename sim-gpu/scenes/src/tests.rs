mod world;

use std::collections::BTreeMap;
use std::path::Path;

use edgepuck_segment::{Segmenter, Settings, Sweep as Points};
use formats::Scan;
use glam::{DVec2, DVec3};
use sim_gpu::{Mesh, Pose, Scene};

use crate::{DrawnScene, Drive, OTHER, Packet, Recipe, Sightings, Stage, label_clusters};

const RECIPE: &str = include_str!("tests/street.toml");

fn stage(recipe: &str) -> Stage {
    let file = Path::new("test.toml");
    let recipe = Recipe::parse(recipe, file).unwrap();
    Stage::new(recipe, file, None, 5).unwrap()
}

#[test]
fn a_scene_is_a_function_of_recipe_seed_and_number() {
    let (one, other) = (stage(RECIPE), stage(RECIPE));
    // Another order of drawing builds the objects in another order.
    let later = DrawnScene::draw(&other, 8);
    let scenes = [DrawnScene::draw(&one, 7), DrawnScene::draw(&other, 7)];
    assert_eq!(scenes[0].objects, scenes[1].objects);
    assert_eq!(one.sweep(&scenes[0]).unwrap().scan, other.sweep(&scenes[1]).unwrap().scan);
    assert_ne!(scenes[0].objects, later.objects);
}

#[test]
fn every_point_lies_on_its_surface() {
    let moving = RECIPE.replace("off_road_m = [0, 3]", "off_road_m = [0, 3], speed_m_s = [20, 20]");
    for (stage, number) in [(stage(RECIPE), 0), (stage(RECIPE), 1), (stage(&moving), 1)] {
        let scene = DrawnScene::draw(&stage, number);
        let sweep = stage.sweep(&scene).unwrap();
        assert!(sweep.points().len() > 5_000, "{}", sweep.points().len());
        let times_s = sweep.scan.time_s.as_ref().unwrap();
        for ((point, &surface), &time_s) in sweep.points().iter().zip(sweep.surfaces()).zip(times_s)
        {
            let in_sensor = DVec3::from_array(point.map(f64::from));
            // Where the sensor was when the beam fired.
            let position_m = scene.pose.position_m + scene.velocity_m_s * f64::from(time_s);
            let point = position_m + scene.pose.rotation * in_sensor;
            let Some(i) = (surface as usize).checked_sub(1) else {
                // Roughness is 1 cm, uniform, so at most 1.8 cm; a kerb's face is
                // as high as the kerb.
                let off_m = point.z - scene.ground.height_m(DVec2::new(point.x, point.y));
                assert!(off_m.abs() < 0.12 + 0.02, "{point}: {off_m}");
                continue;
            };
            let object = &scene.objects[i];
            let in_object = object.world_from_object().inverse().transform_point3(point);
            let size_m = stage.size_m(&scene, i) / object.scale;
            let half = (size_m / 2.0).with_z(size_m.z) + 1e-3;
            assert!(in_object.abs().cmple(half).all() && in_object.z > -1e-3, "{in_object}");
        }
    }
}

/// The two may differ at silhouettes, because hierarchies hold their triangles in f32, each in a
/// frame of its own.
#[test]
fn a_sweep_of_the_objects_equals_a_sweep_of_one_mesh_of_all() {
    let opaque = RECIPE.replace("glass_returned = [0, 0]", "glass_returned = [1, 1]");
    let stage = stage(&opaque);
    for number in 0..3 {
        let scene = DrawnScene::draw(&stage, number);
        let mut whole = Scene::new();
        whole.add(Mesh::try_from(stage.mesh(&scene)).unwrap(), Pose::IDENTITY);
        let of_mesh = stage.sweep_in(&whole, &scene).unwrap().scan;
        let of_parts = stage.sweep(&scene).unwrap().scan;
        let ranges = |scan: &Scan| -> BTreeMap<u32, f32> {
            let beams = scan.beam.as_ref().unwrap().iter().copied();
            beams.zip(scan.range_m.as_ref().unwrap().iter().copied()).collect()
        };
        let (one, other) = (ranges(&of_mesh), ranges(&of_parts));
        let is_same = |(beam, range_m): (&u32, &f32)| {
            one.get(beam).is_some_and(|other_m| (other_m - range_m).abs() < 1e-3)
        };
        let n_same = other.iter().filter(|&pair| is_same(pair)).count();
        assert!(n_same > 5_000 && n_same * 1000 > other.len() * 999, "{n_same} of {}", other.len());
        assert!(one.len().abs_diff(other.len()) * 1000 < other.len());
    }
}

#[test]
fn objects_keep_apart_and_stay_within_their_distances() {
    let stage = stage(RECIPE);
    let footprints = |scene: &DrawnScene| -> Vec<crate::footprint::Footprint> {
        let of = |(i, object): (usize, &crate::PlacedObject)| crate::footprint::Footprint {
            centre: object.position.truncate(),
            half: stage.size_m(scene, i).truncate() / 2.0,
            yaw_rad: object.yaw_rad,
        };
        scene.objects.iter().enumerate().map(of).collect()
    };
    for number in 0..20 {
        let scene = DrawnScene::draw(&stage, number);
        let taken = footprints(&scene);
        for (i, one) in taken.iter().enumerate() {
            assert!(taken[..i].iter().all(|other| !one.meets(other)), "scene {number}");
            let most_m = stage.recipe().object[scene.objects[i].entry].distance_m.most;
            assert!(one.centre.x.abs() <= most_m + 6.0);
        }
    }
}

#[test]
fn glass_that_returns_nothing_leaves_holes_in_cars() {
    let with = |returned: &str| {
        let text = RECIPE.replace("glass_returned = [0, 0]", returned);
        let stage = stage(&text);
        let scene = DrawnScene::draw(&stage, 3);
        let driven = self::stage(&text.replace("vlp16", "vlp32c"));
        let packets = Drive::new(&driven, 5.0).unwrap().fire(0..150).unwrap();
        let of_drive = packets.iter().map(|packet| packet.scan.len()).sum::<usize>();
        [stage.sweep(&scene).unwrap().points().len(), of_drive]
    };
    let (dark, bright) = (with("glass_returned = [0, 0]"), with("glass_returned = [1, 1]"));
    assert!((0..2).all(|i| dark[i] < bright[i]), "{dark:?} points with dark glass, {bright:?}");
}

#[test]
fn dark_objects_are_detected_at_shorter_ranges() {
    let with = |effects: &str, reflectivity: &str| {
        let text = RECIPE.replacen("sigma_m = 0 }", &format!("sigma_m = 0 }}{effects}"), 1);
        let text = text.replace("kind = \"car\"", &format!("kind = \"car\"{reflectivity}"));
        let stage = stage(&text);
        let scene = DrawnScene::draw(&stage, 3);
        let scan = stage.sweep(&scene).unwrap().scan;
        let is_car = |object: u32| {
            let entry = (object as usize).checked_sub(1).map(|i| scene.objects[i].entry);
            entry == Some(0)
        };
        let ranges_m = scan.range_m.unwrap();
        let of_cars = ranges_m.iter().zip(scan.object.unwrap()).filter(|(_, o)| is_car(*o));
        (ranges_m.len(), of_cars.map(|(range_m, _)| *range_m).fold(0.0, f32::max))
    };
    let limit = ", detection = { reflectivity = 1, range_m = 20 }";
    let (all, farthest_m) = with("", "");
    let (near, white_m) = with(limit, "");
    let (_, dark_m) = with(limit, ", reflectivity = [0.09, 0.09]");
    assert!(near < all && farthest_m >= white_m && white_m <= 20.0, "{near} of {all}");
    // 0.09 / 6^2 is 1 / 20^2.
    assert!(0.0 < dark_m && dark_m <= 6.0 && dark_m < white_m, "{dark_m} m, {white_m} m");
}

#[test]
fn each_model_has_a_reflectivity_of_its_own() {
    let bright = RECIPE.replace("kind = \"pole\"", "kind = \"pole\", reflectivity = [0.2, 0.8]");
    let stage = stage(&bright);
    let mut all = BTreeMap::new();
    for scene in (0..9).map(|number| DrawnScene::draw(&stage, number)) {
        for (object, instance) in scene.objects.iter().zip(&stage.build(&scene).instances()[1..]) {
            let key = (object.entry, object.variant);
            assert_eq!(*all.entry(key).or_insert(instance.reflectivity), instance.reflectivity);
        }
    }
    let of_poles: Vec<f64> = (0..3).map(|variant| all[&(3, variant)]).collect();
    assert!(of_poles.iter().all(|x| (0.2..=0.8).contains(x)) && all[&(0, 0)] == 1.0, "{all:?}");
    assert!((0..3).all(|i| of_poles[i] != of_poles[(i + 1) % 3]), "{of_poles:?}");
}

#[test]
fn clusters_of_one_object_have_its_class_and_tell_their_place() {
    let stage = stage(RECIPE);
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    let mut seen = std::collections::BTreeSet::new();
    for number in 0..6 {
        let scene = DrawnScene::draw(&stage, number);
        let sweep = stage.sweep(&scene).unwrap();
        let points = Points { points: sweep.points(), rings: Some(sweep.rings()) };
        let found = segmenter.segment(&points).unwrap();
        let labelled = label_clusters(&stage, &scene, &sweep, found);
        for (cluster, of) in labelled.iter().zip(found.clusters()) {
            let own =
                || of.points.iter().map(|&i| DVec3::from(points.points[i as usize].map(f64::from)));
            let n = of.points.len() as f64;
            let range_m = own().map(|at| at.truncate().length()).sum::<f64>() / n;
            let on = |&&i: &&u32| sweep.surfaces()[i as usize] == cluster.surface;
            let share = of.points.iter().filter(on).count() as f64 / n;
            let off =
                [f64::from(cluster.range_m) - range_m, f64::from(cluster.truth_share) - share];
            // Means of f32, each within an ulp of up to 100 m.
            assert!(off.iter().all(|off| off.abs() < 1e-5), "{off:?}");
            let lowest_m = own().fold(f64::INFINITY, |lowest_m, at| at.z.min(lowest_m)) as f32;
            let height_m = of.ground_z_m.map(|ground_z_m| lowest_m - ground_z_m);
            assert_eq!(height_m, Some(cluster.height_m).filter(|height_m| !height_m.is_nan()));
            let class = &stage.classes()[cluster.label];
            if class != OTHER {
                let object = &scene.objects[cluster.surface as usize - 1];
                assert_eq!(*class, stage.recipe().object[object.entry].class);
                assert!(cluster.truth_share >= 0.7);
            }
            seen.insert(class.clone());
        }
    }
    for class in ["car", "person", "bush"] {
        assert!(seen.contains(class), "no cluster of a {class}");
    }
}

#[test]
fn an_invalid_recipe_gives_an_error_with_the_key_and_the_cause() {
    for row in include_str!("tests/bad_recipes.txt").lines() {
        let [from, to, expected] = row.split(" -> ").collect::<Vec<_>>()[..] else {
            panic!("{row}")
        };
        let recipe = RECIPE.replacen(from, &to.replace("\\n", "\n"), 1);
        let error = Recipe::parse(&recipe, Path::new("r.toml")).unwrap_err().to_string();
        assert!(error.starts_with("r.toml: ") && error.contains(expected), "{error}");
    }
    let empty = "sensor = []\nobject = []\nmount = { height_m = [1, 1] }";
    assert!(Recipe::parse(empty, Path::new("r.toml")).is_err());
}

/// The recipe with walking persons and moving cars.
fn drive_recipe() -> String {
    let walking =
        RECIPE.replace("distance_m = [2, 12]", "distance_m = [2, 12], speed_m_s = [1, 2]");
    let cars = "{ kind = \"car\", class = \"car\", count = [3, 5], place = \"road\", \
                distance_m = [3, 20], speed_m_s = [8, 10] }\n]\n[ground]";
    walking.replace("vlp16", "vlp32c").replace("]\n[ground]", cars)
}

/// The first `n` packets of a drive at 6 m/s, fired in batches of `batch`.
fn packets(stage: &Stage, n: u32, batch: u32) -> Vec<Packet> {
    let mut drive = Drive::new(stage, 6.0).unwrap();
    let batches = (0..n).step_by(batch as usize);
    batches.flat_map(|first| drive.fire(first..n.min(first + batch)).unwrap()).collect()
}

#[test]
fn a_drive_is_the_same_in_batches_and_threads_of_any_number() {
    let stage = stage(&drive_recipe());
    let expected = packets(&stage, 60, 60);
    let alone = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let found = alone.install(|| packets(&stage, 60, 7));
    for (expected, found) in expected.iter().zip(&found) {
        assert_eq!(expected.scan, found.scan);
    }
}

/// Object and sensor move while the head turns; the box is that at the time of each point.
#[test]
fn points_on_moving_objects_lie_in_their_boxes() {
    let stage = stage(&drive_recipe());
    let mut drive = Drive::new(&stage, 6.0).unwrap();
    let packets = drive.fire(0..452).unwrap();
    let (mut n_moving, mut farthest_m) = (0, 0.0f64);
    for (packet, number) in packets.iter().zip(0u32..) {
        let origin = DVec3::from_array(packet.scan.origin);
        let objects = packet.scan.object.iter().flatten();
        let beams = packet.scan.beam.iter().flatten();
        for ((position, &object), &beam) in packet.scan.positions.iter().zip(objects).zip(beams) {
            let Some(truth) = drive.object(object) else { continue };
            // A packet has 12 sequences of 55.296 us, in which two lasers of 32 fire at once.
            let time_s = f64::from(number * 12 + beam / 32) * 55.296e-6;
            let time_s = time_s + f64::from(beam % 32 / 2) * 2.304e-6;
            let at = DVec3::from_array(position.map(f64::from)) + origin;
            let from_centre = at - truth.centre_m(time_s);
            let in_box = glam::DQuat::from_rotation_z(-truth.placed.yaw_rad) * from_centre;
            // A mesh may stand out of its box by the rounding of its vertices.
            let margin_m = 1e-3;
            let outside = (in_box.abs() - truth.size_m / 2.0).max_element();
            assert!(outside < margin_m, "object {object} of packet {number}: {outside} m outside");
            n_moving += usize::from(truth.velocity_m_s != DVec3::ZERO);
            farthest_m = farthest_m.max(truth.centre_m(time_s).length());
        }
    }
    // The ground, and with it the sight, ends at 80 m. The drive is 2 m long.
    assert!((70.0..83.0).contains(&farthest_m), "{farthest_m}");
    assert!(n_moving > 200, "{n_moving} points on moving objects");
}

/// A flat world without objects, so that the range of a beam is what it is in all scenes.
fn flat(noise_m: f64) -> String {
    let object = RECIPE.find("object = [").unwrap();
    let sensor = RECIPE[..object].replace("tilt_deg = [1, 1]", "tilt_deg = [0, 0]");
    let sensor = sensor.replace("off_road_m = [0, 3]", "off_road_m = [0, 0]");
    let sensor = sensor.replace("vlp16", "vlp32c");
    let pole = "kind = \"pole\", class = \"pole\", count = [0, 0], place = \"anywhere\"";
    format!(
        "{}object = [{{ {pole}, distance_m = [3, 15] }}]\n\
         ground = {{ slope_deg = [0, 0], roughness_m = [0, 0], kerb_m = [0, 0] }}",
        sensor.replace("sigma_m = 0", &format!("sigma_m = {noise_m}")),
    )
}

/// How far each range is off, by beam.
fn errors(noisy: &Scan, clean: &Scan) -> BTreeMap<u32, f64> {
    let ranges = |scan: &Scan| -> BTreeMap<u32, f64> {
        let ranges = scan.range_m.as_ref().unwrap().iter().map(|&range_m| range_m.into());
        scan.beam.as_ref().unwrap().iter().copied().zip(ranges).collect()
    };
    let clean = ranges(clean);
    ranges(noisy).into_iter().map(|(beam, range_m)| (beam, range_m - clean[&beam])).collect()
}

/// That the numbers of no two of these, by key, correlate.
fn assert_independent(all: &[BTreeMap<u32, f64>]) {
    for (i, one) in all.iter().enumerate() {
        for (j, other) in all.iter().enumerate().skip(i + 1) {
            let both: Vec<[f64; 2]> =
                one.iter().filter_map(|(key, a)| Some([*a, *other.get(key)?])).collect();
            assert!(both.len() > 1000, "{}", both.len());
            test_support::assert_uncorrelated(&format!("{i} and {j}"), &both);
        }
    }
}

#[test]
fn scenes_and_packets_of_other_numbers_and_seeds_have_other_noise() {
    let stage = |noise_m, seed| {
        let file = Path::new("test.toml");
        Stage::new(Recipe::parse(&flat(noise_m), file).unwrap(), file, None, seed).unwrap()
    };
    let sweep = |noise_m, seed, number| {
        let stage = stage(noise_m, seed);
        stage.sweep(&DrawnScene::draw(&stage, number)).unwrap().scan
    };
    let of = |(seed, number)| errors(&sweep(0.02, seed, number), &sweep(0.0, seed, number));
    assert_independent(&[(5, 0), (5, 1), (5, 2), (6, 0), (6, 1)].map(of));

    // All beams of packets 0 to 59, of packets 60 to 119, and of packets of another seed.
    let packets = |noise_m, seed| {
        let stage = stage(noise_m, seed);
        Drive::new(&stage, 0.0).unwrap().fire(0..120).unwrap()
    };
    let of = |seed| {
        let (noisy, clean) = (packets(0.02, seed), packets(0.0, seed));
        let errors: Vec<_> =
            noisy.iter().zip(&clean).map(|(a, b)| errors(&a.scan, &b.scan)).collect();
        [&errors[..60], &errors[60..]].map(|half| {
            let numbered = half.iter().zip(0u32..);
            let keyed = numbered.flat_map(|(errors, packet)| {
                errors.iter().map(move |(beam, error)| (packet * 1000 + beam, *error))
            });
            keyed.collect::<BTreeMap<u32, f64>>()
        })
    };
    let [a, b] = of(5);
    let [c, d] = of(6);
    // Neighbouring packets: those of even and of odd numbers.
    let [even, odd] = [0, 1].map(|odd| {
        let own = a.iter().filter(|(key, _)| **key / 1000 % 2 == odd);
        own.map(|(key, error)| (key - odd * 1000, *error)).collect::<BTreeMap<u32, f64>>()
    });
    assert_independent(&[a, b, c, d]);
    assert_independent(&[even, odd]);
}

#[test]
fn sightings_count_every_point_once_in_its_revolution() {
    let stage = stage(&drive_recipe());
    let mut drive = Drive::new(&stage, 6.0).unwrap();
    let packets = drive.fire(0..452).unwrap();
    let mut sightings = Sightings::default();
    let mut found: Vec<_> =
        packets.chunks(100).flat_map(|packets| sightings.add(&drive, packets)).collect();
    found.extend(sightings.finish(&drive));
    let on_objects =
        |packet: &Packet| packet.scan.object.iter().flatten().filter(|&&object| object > 0).count();
    let n_points: u32 = found.iter().map(|sighting| sighting.points).sum();
    assert_eq!(n_points as usize, packets.iter().map(on_objects).sum::<usize>());
    let keys: Vec<_> = found.iter().map(|sighting| (sighting.turn, sighting.object)).collect();
    assert!(keys.is_sorted_by(|a, b| a < b), "expected each once, in order");
    // 452 packets of 0.66 ms at 10 turns a second.
    assert_eq!(keys.last().unwrap().0, 2);
    for sighting in &found {
        let since_s = sighting.time_s - f64::from(drive.start_s());
        let turn = f64::from(sighting.turn);
        assert!((turn..turn + 1.0).contains(&(since_s * 10.0)), "{sighting:?}");
        let seen = drive.object(sighting.object).unwrap();
        let base_m = seen.placed.position + seen.velocity_m_s * since_s;
        let centre_m = base_m + 0.5 * seen.size_m.z * DVec3::Z;
        // In 0.12 us, to which f64 rounds Unix time, it moves by a micrometre.
        assert!(centre_m.distance(sighting.centre_m.into()) < 2e-6, "{sighting:?}: {centre_m}");
    }
}

#[test]
fn the_built_in_recipes_are_valid() {
    for (name, text) in edgepuck_assets::SCENE_RECIPES {
        let file = Path::new(name);
        let recipe = Recipe::parse(text, file).unwrap();
        assert!(recipe.sensors(file).is_ok());
        assert!(recipe.classes().len() > 4);
    }
}
