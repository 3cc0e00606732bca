//! The clusters of a sweep at several widths, and the choice among them.

use edgepuck_segment::{Label, Segmenter, Settings, Sweep};

use crate::scanner::{Scan, VLP32C, block, flat, ground, scan};

/// Two cars 0.5 m apart, and two persons 0.3 m apart.
fn street() -> Scan {
    scan(
        &VLP32C,
        &[
            flat(),
            block([5.0, 4.0], [4.2, 1.8], 0.2, 1.7),
            block([5.0, 6.3], [4.2, 1.8], 0.2, 1.7),
            block([-8.0, 0.0], [0.3, 0.5], 0.0, 1.8),
            block([-8.0, 0.8], [0.3, 0.5], 0.0, 1.8),
        ],
    )
}

/// The surfaces that the points lie on.
fn surfaces(scan: &Scan, points: &[u32]) -> Vec<usize> {
    let mut found: Vec<_> = points.iter().map(|&point| scan.surfaces[point as usize]).collect();
    found.sort_unstable();
    found.dedup();
    found
}

#[test]
fn each_object_and_each_group_is_a_node() {
    let scan = street();
    for rings in [Some(&scan.rings[..]), None] {
        let mut segmenter = Segmenter::new(Settings::default()).unwrap();
        let sweep = Sweep { points: &scan.points, rings };
        let hierarchy = segmenter.hierarchy(&sweep).unwrap();
        let nodes: Vec<_> = hierarchy.nodes().map(|node| surfaces(&scan, node.points)).collect();
        for expected in [&[1][..], &[2], &[1, 2], &[3], &[4], &[3, 4]] {
            assert!(nodes.iter().any(|node| node == expected), "{expected:?}: {nodes:?}");
        }
    }
}

/// On a street of 8 degrees, 1.8 m below the sensor at x = 0.
#[test]
fn a_node_has_the_height_of_the_ground_under_its_middle() {
    let slope = 8f64.to_radians().tan();
    let on_street = |x: f64, y: f64| block([x, y], [1.0, 1.0], x * slope, 2.0);
    let hill = ground(slope, 0.0, |_, _| true);
    let scan = scan(&VLP32C, &[hill, on_street(12.0, 0.0), on_street(-7.0, 3.0)]);
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    let sweep = Sweep { points: &scan.points, rings: Some(&scan.rings) };
    let nodes = segmenter.hierarchy(&sweep).unwrap().nodes();
    for (node, middle_x) in nodes.flat_map(|node| match surfaces(&scan, node.points)[..] {
        [1] => Some((node, 11.5)),
        [2] => Some((node, -6.75)),
        _ => None,
    }) {
        // It is up to half a metre from the middle of what is seen of a box.
        let off_m = f64::from(node.ground_z_m.unwrap()) - (slope * middle_x - 1.8);
        assert!(off_m.abs() < 0.5 * slope + 0.05, "{off_m} at {middle_x}");
    }
}

/// A point of one object is worth 1, and 0.9 in a group. A whole that may be worth 5 % less than its
/// parts holds an object's pieces together; at 15 % less, it holds groups together, too.
#[test]
fn the_best_cut_is_that_of_the_largest_worth() {
    let scan = street();
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    let sweep = Sweep { points: &scan.points, rings: Some(&scan.rings) };
    let hierarchy = segmenter.hierarchy(&sweep).unwrap();
    let worth = |points: &[u32]| match surfaces(&scan, points)[..] {
        [_] => points.len() as f64,
        _ => 0.9 * points.len() as f64,
    };
    let worths: Vec<f64> = hierarchy.nodes().map(|node| worth(node.points)).collect();
    let points: Vec<_> = hierarchy.nodes().map(|node| node.points.to_vec()).collect();
    for (margin, expected) in
        [(-0.05, &[&[1][..], &[2], &[3], &[4]][..]), (-0.15, &[&[1, 2], &[3, 4]])]
    {
        let (nodes, cut) = segmenter.cut(&worths, margin);
        let large: Vec<_> = cut.clusters().filter(|c| c.points.len() >= 40).collect();
        let mut found: Vec<_> = large.iter().map(|c| surfaces(&scan, c.points)).collect();
        found.sort();
        assert_eq!(found, expected, "{margin}");
        assert_eq!(nodes.len(), cut.clusters().len());
        for ((cluster, &node), number) in cut.clusters().zip(nodes).zip(0..) {
            let mut expected = points[node].clone();
            expected.sort_unstable();
            assert_eq!(cluster.points, expected);
            let mut labels = cluster.points.iter().map(|&point| cut.labels()[point as usize]);
            assert!(labels.all(|label| label == Label::Cluster(number)));
        }
        let firsts: Vec<_> = cut.clusters().map(|cluster| cluster.points[0]).collect();
        assert!(firsts.is_sorted());
    }
}

#[test]
fn few_points_or_none_have_no_nodes() {
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    for points in [&[][..], &[[5.0, 0.0, 0.0]], &[[f32::NAN; 3]; 30]] {
        let hierarchy = segmenter.hierarchy(&Sweep { points, rings: None }).unwrap();
        assert!(hierarchy.is_empty());
        let (nodes, cut) = segmenter.cut(&[], 0.0);
        assert!(nodes.is_empty());
        assert_eq!(cut.labels().len(), points.len());
    }
    // A hierarchy is that of its own sweep.
    let scan = street();
    let sweep = Sweep { points: &scan.points, rings: Some(&scan.rings) };
    assert!(!segmenter.hierarchy(&sweep).unwrap().is_empty());
    segmenter.segment(&Sweep { points: &[[5.0, 0.0, 0.0]], rings: None }).unwrap();
    assert_eq!(segmenter.cut(&[], 0.1).0.len(), 0);
    let wrong = Sweep { points: &[[1.0; 3]; 3], rings: Some(&[0, 1]) };
    assert!(segmenter.hierarchy(&wrong).is_err());
}
