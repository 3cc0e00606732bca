//! Which points form one cluster, and which form two.

use edgepuck_segment::{Label, Segmenter, Settings, Sweep};

use crate::scanner::{HEIGHT, Scan, Surface, VLP32C, block, flat, scan};

/// A body with a roof on pillars; between them is glass, which returns nothing. All vehicles here
/// are as high as the sensor: its beams hit a lower level roof in lines that are too far apart to
/// be linked.
fn car(x: f64, y: f64) -> [Surface; 4] {
    [
        block([x, y], [4.2, 1.8], 0.2, 0.7),
        block([x - 0.4, y], [1.9, 1.3], 1.35, 0.55),
        block([x - 1.3, y - 0.6], [0.1, 0.1], 0.9, 0.45),
        block([x - 1.3, y + 0.6], [0.1, 0.1], 0.9, 0.45),
    ]
}

/// All clusters are made of exactly these groups of surfaces.
fn assert_clusters(scan: &Scan, expected: &[&[usize]]) {
    scan.check(|segmentation| {
        let mut found = scan.surfaces_of_clusters(segmentation);
        found.sort();
        assert_eq!(found, expected);
    });
}

#[test]
fn two_cars_half_a_metre_apart_are_two() {
    for near in [5.0, 8.0] {
        let beside = [4.0, 6.3].map(|y| block([near, y], [4.2, 1.8], 0.2, 1.7));
        let [first, second] = beside;
        assert_clusters(&scan(&VLP32C, &[flat(), first, second]), &[&[1], &[2]]);
        let in_a_row = [4.0, 8.7].map(|x| block([x, near], [4.2, 1.8], 0.2, 1.7));
        let [first, second] = in_a_row;
        assert_clusters(&scan(&VLP32C, &[flat(), first, second]), &[&[1], &[2]]);
    }
}

#[test]
fn body_and_roof_are_one_car_though_windows_return_nothing() {
    for distance in [5.0, 8.0, 16.0] {
        let mut surfaces = vec![flat()];
        surfaces.extend(car(0.0, -distance));
        let scan = scan(&VLP32C, &surfaces);
        // Lines on the level top of the body may be clusters of their own.
        scan.check(|segmentation| {
            let largest = segmentation.clusters().max_by_key(|cluster| cluster.points.len());
            let number = segmentation.labels()[largest.unwrap().points[0] as usize];
            let shares = [1, 2].map(|part| scan.share(segmentation, part, |label| label == number));
            assert!(shares[0] > 0.6 && shares[1] == 1.0, "{distance} m: {shares:?}");
        });
    }
}

/// Without pillars, only the search from the belt line finds the roof.
#[test]
fn a_roof_without_pillars_belongs_to_its_body() {
    for y in [-8.0, -12.0] {
        let [body, roof, ..] = car(0.0, y);
        let branch = block([-0.4, y], [1.9, 1.3], 2.42, 0.3);
        // A wall, which is too large for a cluster, so that every ring has returns.
        let wall = block([50.0, 0.0], [0.3, 60.0], 0.0, 16.0);
        let scan = scan(&VLP32C, &[flat(), body, roof, branch, wall]);
        scan.check(|segmentation| {
            let largest = segmentation.clusters().max_by_key(|cluster| cluster.points.len());
            let number = segmentation.labels()[largest.unwrap().points[0] as usize];
            let share = |part| scan.share(segmentation, part, |label| label == number);
            let shares = [1, 2, 3].map(share);
            assert!(shares[0] > 0.6 && shares[1..] == [1.0, 0.0], "{y} m: {shares:?}");
        });
    }
}

/// At 80 m, beams are 0.28 m apart, more than neighbours of a near sensor may be. One ring meets the
/// bar.
#[test]
fn distant_objects_stay_whole() {
    assert_clusters(&scan(&VLP32C, &[flat(), block([80.0, 0.0], [1.0, 5.0], 1.6, 0.5)]), &[&[1]]);
}

#[test]
fn a_person_beside_a_car_is_another_cluster() {
    for x in [5.0, 10.0, 20.0] {
        let person = block([x, 1.4 + 0.6], [0.3, 0.5], 0.0, 1.75);
        let vehicle = block([x, 0.0], [4.2, 1.8], 0.2, 1.7);
        assert_clusters(&scan(&VLP32C, &[flat(), vehicle, person]), &[&[1], &[2]]);
    }
}

#[test]
fn thin_legs_belong_to_their_body_and_a_pole_is_whole() {
    let legs = [-0.15, 0.15].map(|y| block([6.0, y], [0.1, 0.08], 0.0, 0.85));
    let body = block([6.0, 0.0], [0.25, 0.45], 0.85, 0.85);
    let pole = block([-9.0, 0.0], [0.06, 0.06], 0.0, 3.5);
    let mut surfaces = vec![flat(), body, pole];
    surfaces.extend(legs);
    assert_clusters(&scan(&VLP32C, &surfaces), &[&[1, 3, 4], &[2]]);
}

#[test]
fn missing_rings_and_dropped_returns_do_not_cut_a_cluster() {
    let mut scan = scan(&VLP32C, &[flat(), block([10.0, 0.0], [1.0, 2.0], 0.0, 1.6)]);
    // Each third ring is dead, and of the other returns on the box two in five.
    let is_kept =
        |i: usize| !scan.rings[i].is_multiple_of(3) && (scan.surfaces[i] == 0 || i * 7 % 5 < 3);
    let kept: Vec<_> = (0..scan.points.len()).filter(|&i| is_kept(i)).collect();
    scan = Scan {
        points: kept.iter().map(|&i| scan.points[i]).collect(),
        rings: kept.iter().map(|&i| scan.rings[i]).collect(),
        surfaces: kept.iter().map(|&i| scan.surfaces[i]).collect(),
    };
    assert_clusters(&scan, &[&[1]]);
}

/// The second sensor hangs upside down 8 cm below the first; its lasers have the numbers 32 to 63.
#[test]
fn two_stacked_sensors_make_one_sweep() {
    let surfaces = [flat(), block([10.0, 3.0], [2.0, 4.0], 0.0, 1.5)];
    let mut both = scan(&VLP32C, &surfaces);
    let lower =
        [crate::scanner::ground(0.0, 0.08, |_, _| true), block([10.0, 3.0], [2.0, 4.0], 0.08, 1.5)];
    let second = scan(&VLP32C.map(|elevation| -elevation), &lower);
    both.points.extend(second.points.iter().map(|[x, y, z]| [*x, *y, z - 0.08]));
    both.rings.extend(second.rings.iter().map(|ring| ring + 32));
    both.surfaces.extend(second.surfaces);
    assert_clusters(&both, &[&[1]]);
}

#[test]
fn limits_make_clusters_small() {
    let wall = block([0.0, 15.0], [60.0, 0.3], 0.0, 4.0);
    let scan = scan(&VLP32C, &[flat(), wall, block([-8.0, 0.0], [0.5, 0.5], 0.0, 1.7)]);
    assert_clusters(&scan, &[&[2]]);
    let sweep = Sweep { points: &scan.points, rings: Some(&scan.rings) };
    let count = |change: fn(&mut Settings)| {
        let mut settings = Settings::default();
        change(&mut settings);
        let mut segmenter = Segmenter::new(settings).unwrap();
        segmenter.segment(&sweep).unwrap().clusters().len()
    };
    assert_eq!(count(|settings| settings.max_size_m = f32::INFINITY), 2);
    assert_eq!(count(|settings| settings.max_points = 100), 0);
    assert_eq!(count(|settings| settings.max_range_m = 7.0), 0);
    assert_eq!(count(|settings| settings.min_range_m = 9.0), 0);
}

#[test]
fn points_of_clusters_are_ascending_and_agree_with_the_labels() {
    let scan = scan(
        &VLP32C,
        &[
            flat(),
            block([9.0, 4.0], [1.0, 1.0], 0.0, 2.0),
            block([7.0, -4.0], [1.0, 1.0], 0.0, 2.0),
        ],
    );
    scan.check(|segmentation| {
        let mut firsts = Vec::new();
        let mut n_members = 0;
        for (number, cluster) in segmentation.clusters().enumerate() {
            assert!(cluster.points.is_sorted());
            for &point in cluster.points {
                assert_eq!(segmentation.labels()[point as usize], Label::Cluster(number as u32));
            }
            firsts.push(cluster.points[0]);
            n_members += cluster.points.len();
        }
        assert!(firsts.is_sorted());
        let is_member = |label: &&Label| matches!(label, Label::Cluster(_));
        assert_eq!(segmentation.labels().iter().filter(is_member).count(), n_members);
        assert_eq!(firsts.len(), 2);
    });
}

#[test]
fn a_sweep_may_be_one_cluster() {
    let cage: Vec<_> = (-20..20)
        .flat_map(|ring| (0..1800).map(move |step| (f64::from(ring), f64::from(step) * 0.2)))
        .map(|(elevation, azimuth): (f64, f64)| {
            let (sin, cos) = azimuth.to_radians().sin_cos();
            [4.0 * cos, 4.0 * sin, 4.0 * elevation.to_radians().tan()].map(|x| x as f32)
        })
        .collect();
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    let segmentation = segmenter.segment(&Sweep { points: &cage, rings: None }).unwrap();
    let cluster = segmentation.clusters().next().unwrap();
    assert_eq!(segmentation.clusters().len(), 1);
    let bottom = 4.0 * (-20f32).to_radians().tan();
    let is_high = |point: &&[f32; 3]| point[2] > bottom + 0.25;
    assert!(cluster.points.len() >= cage.iter().filter(is_high).count());
    assert!(f64::from(bottom) > -HEIGHT);
}

/// A cable that rises by a ring at each step of azimuth, to the left or to the right: no row and no
/// column has two of its returns.
#[test]
fn sloping_surfaces_are_linked_to_both_sides() {
    let elevations: Vec<f64> = (-36..12).map(|thirds| f64::from(thirds) / 3.0).collect();
    for aside in [1, -1] {
        let cable = move |[x, y, z]: [f64; 3]| {
            let step = (y.atan2(x).to_degrees() / 0.2).floor() as i32;
            let ring = (z.asin().to_degrees() * 3.0).round() as i32;
            (ring > -8 && step == 300 + aside * ring).then_some(12.0)
        };
        assert_clusters(&scan(&elevations, &[flat(), Box::new(cable)]), &[&[1]]);
    }
}
