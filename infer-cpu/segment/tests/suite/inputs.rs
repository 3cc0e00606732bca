//! Unusual input gives a result or an error, never a panic.

use edgepuck_segment::{Label, SegmentError, Segmenter, Settings, Sweep};

use crate::scanner::{VLP32C, block, flat, scan};

fn labels(points: &[[f32; 3]]) -> Vec<Label> {
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    segmenter.segment(&Sweep { points, rings: None }).unwrap().labels().to_vec()
}

#[test]
fn few_points_or_none_have_labels() {
    assert_eq!(labels(&[]), []);
    assert_eq!(labels(&[[5.0, 0.0, 0.0]]).len(), 1);
    assert_eq!(labels(&[[0.0, 0.0, 5.0]; 20]).len(), 20);
    assert_eq!(labels(&[[500.0, 0.0, 0.0]]), [Label::Small]);
    assert_eq!(labels(&[[1e30, 1e30, 1e30]]), [Label::Small]);
}

#[test]
fn invalid_points_change_no_cluster() {
    let scan = scan(&VLP32C, &[flat(), block([10.0, 3.0], [2.0, 4.0], 0.0, 1.5)]);
    let expected = labels(&scan.points);
    let broken = [
        [f32::NAN, 0.0, 0.0],
        [1.0, f32::INFINITY, 0.0],
        [5.0, 5.0, f32::NEG_INFINITY],
        [0.0; 3],
        [-0.0; 3],
    ];
    let mut points = broken.to_vec();
    points.extend(&scan.points);
    let found = labels(&points);
    assert_eq!(found[..5], [Label::Invalid; 5]);
    assert_eq!(found[5..], expected);
}

#[test]
fn rings_must_be_as_many_as_points() {
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    let sweep = Sweep { points: &[[1.0; 3]; 3], rings: Some(&[0, 1]) };
    let error = segmenter.segment(&sweep).err().unwrap();
    assert_eq!(error.to_string(), "expected 3 rings, one for each point, found 2");
}

#[test]
fn too_many_rings_are_refused() {
    let points: Vec<_> = (0..5000).map(|i| [10.0, 0.0, i as f32 / 1000.0]).collect();
    let rings: Vec<_> = (0..5000).collect();
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    let error = segmenter.segment(&Sweep { points: &points, rings: Some(&rings) }).err();
    assert_eq!(error, Some(SegmentError::TooManyRings { most: 2048, found: 5000 }));
}

#[test]
fn a_ring_without_an_elevation_is_refused() {
    let mut settings = Settings::default();
    settings.ring_elevations_deg = Some(vec![-1.0, 0.0, 1.0]);
    let mut segmenter = Segmenter::new(settings).unwrap();
    let points = [[10.0, 0.0, 0.0]; 2];
    let rings = |ring| [0, ring];
    assert!(segmenter.segment(&Sweep { points: &points, rings: Some(&rings(2)) }).is_ok());
    let error = segmenter.segment(&Sweep { points: &points, rings: Some(&rings(3)) }).err();
    assert_eq!(error, Some(SegmentError::UnknownRing { expected: 3, found: 3 }));
}

#[test]
fn any_numbers_of_the_lasers_give_the_same_clusters() {
    let scan = scan(&VLP32C, &[flat(), block([10.0, 3.0], [2.0, 4.0], 0.0, 1.5)]);
    let laser: Vec<_> = scan.rings.iter().map(|ring| (ring * 7 + 3) % 32 + 1000).collect();
    let labels = |rings| {
        let mut segmenter = Segmenter::new(Settings::default()).unwrap();
        let sweep = Sweep { points: &scan.points, rings: Some(rings) };
        segmenter.segment(&sweep).unwrap().labels().to_vec()
    };
    assert_eq!(labels(&laser), labels(&scan.rings));
}

#[test]
fn a_sweep_leaves_no_trace_in_the_next() {
    let scene = scan(&VLP32C, &[flat(), block([10.0, 3.0], [2.0, 4.0], 0.0, 1.5)]);
    let other = scan(&VLP32C, &[flat(), block([7.0, -3.0], [2.0, 4.0], 0.0, 2.5)]);
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    for points in [&other.points[..], &[], &scene.points[..100], &scene.points] {
        let segmentation = segmenter.segment(&Sweep { points, rings: None }).unwrap();
        assert_eq!(segmentation.labels(), labels(points));
    }
}

/// The time for a million points in one direction does not grow with their square.
#[test]
fn all_points_may_lie_in_one_cell() {
    let points: Vec<_> = (0..1_000_000).map(|i| [1.5 + i as f32 * 9e-5, 1e-3, 0.0]).collect();
    assert_eq!(labels(&points).len(), points.len());
}
