//! Objects that are made clusters of a sweep.

use edgepuck_segment::{Label, Segmenter, Settings, Sweep};

/// A post of `n` points at x.
fn post(x: f32, n: u16) -> impl Iterator<Item = [f32; 3]> {
    (0..n).map(move |i| [x, 0.0, 0.05 * f32::from(i) - 1.0])
}

/// Three posts of 30, 30 and 8 points; the first object takes 10 points of the first and the last, and
/// the second 20 of the second.
#[test]
fn objects_come_first_and_others_keep_half_of_their_points() {
    let points: Vec<_> = post(5.0, 30).chain(post(9.0, 30)).chain(post(13.0, 8)).collect();
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    // The last is too small for a cluster.
    let before = segmenter.segment(&Sweep { points: &points, rings: None }).unwrap();
    assert_eq!(before.clusters().map(|one| one.points.len()).collect::<Vec<_>>(), [30, 30]);
    let objects: [Vec<u32>; 2] =
        [[60, 61, 62, 63, 64].into_iter().chain(0..10).collect(), (30..50).collect()];
    segmenter.claim(objects.iter().zip([Some(-1.5), None]).map(|(own, z_m)| (&own[..], z_m)));
    let after = segmenter.segmentation();
    let clusters: Vec<_> = after.clusters().collect();
    assert_eq!(clusters.len(), 3);
    assert_eq!(clusters[0].points, (0..10).chain(60..65).collect::<Vec<u32>>());
    assert_eq!((clusters[0].ground_z_m, clusters[1].ground_z_m), (Some(-1.5), None));
    assert_eq!(clusters[1].points, (30..50).collect::<Vec<u32>>());
    assert_eq!(clusters[2].points, (10..30).collect::<Vec<u32>>());
    for (point, &label) in (0u32..).zip(after.labels()) {
        let own = clusters.iter().position(|one| one.points.contains(&point));
        assert_eq!(label, own.map_or(Label::Small, |number| Label::Cluster(number as u32)));
    }
}

/// The second of two posts loses 10 of its 30 points.
#[test]
fn a_later_cluster_keeps_half_of_its_own_points() {
    let points: Vec<_> = post(5.0, 30).chain(post(9.0, 30)).collect();
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    segmenter.segment(&Sweep { points: &points, rings: None }).unwrap();
    let object: Vec<u32> = (30..40).collect();
    segmenter.claim([(&object[..], None)].into_iter());
    let n_points = segmenter.segmentation().clusters().map(|one| one.points.len());
    assert_eq!(n_points.collect::<Vec<_>>(), [10, 30, 20]);
}
