//! Connected components, against a comparison of all pairs.

use edgepuck_segment::{Label, Segmenter, Settings, Sweep};
use formats::rng::StreamKey;

fn components(points: &[[f32; 3]], radius_m: f32) -> Vec<Label> {
    let mut settings = Settings::default();
    settings.radius_m = Some(radius_m);
    settings.min_points = 1;
    settings.max_size_m = f32::INFINITY;
    let mut segmenter = Segmenter::new(settings).unwrap();
    segmenter.segment(&Sweep { points, rings: None }).unwrap().labels().to_vec()
}

/// Numbers components in the order of their first points, by comparing all pairs.
fn reference(points: &[[f32; 3]], radius_m: f32) -> Vec<Label> {
    let wide: Vec<_> = points.iter().map(|point| point.map(f64::from)).collect();
    let mut numbers = vec![None; points.len()];
    let mut n = 0;
    for first in 0..points.len() {
        if numbers[first].is_some() {
            continue;
        }
        let mut open = vec![first];
        numbers[first] = Some(n);
        while let Some(this) = open.pop() {
            for other in 0..points.len() {
                let square: f64 =
                    (0..3).map(|axis| (wide[this][axis] - wide[other][axis]).powi(2)).sum();
                if numbers[other].is_none() && square <= f64::from(radius_m).powi(2) {
                    numbers[other] = Some(n);
                    open.push(other);
                }
            }
        }
        n += 1;
    }
    numbers.into_iter().map(|number| Label::Cluster(number.unwrap())).collect()
}

#[test]
fn components_are_those_of_all_pairs() {
    for (index, (n, size)) in
        [(1, 1.0), (2, 0.2), (300, 1.0), (800, 3.0), (800, 8.0), (500, 1e4)].into_iter().enumerate()
    {
        let key = StreamKey::new(7, "components", index as u32);
        let coordinate = |i: usize| (size * (key.unit(i as u64) - 0.5)) as f32;
        let points: Vec<_> =
            (0..n).map(|i| [0, 1, 2].map(|axis| coordinate(3 * i + axis))).collect();
        for radius_m in [0.05, 0.3, 1.0] {
            assert_eq!(components(&points, radius_m), reference(&points, radius_m));
        }
    }
}

/// Steps of a power of two are exact: points a radius apart are linked, and points the next float
/// farther are not.
#[test]
fn the_radius_itself_links() {
    let line: Vec<_> = (0..50).map(|i| [0.25 * i as f32 - 5.0, -0.0, 0.0]).collect();
    assert_eq!(components(&line, 0.25), vec![Label::Cluster(0); 50]);
    let numbered: Vec<_> = (0..50).map(Label::Cluster).collect();
    assert_eq!(components(&line, 0.25f32.next_down()), numbered);
}

#[test]
fn far_and_broken_points_are_components_or_invalid() {
    let points =
        [[f32::MAX; 3], [f32::MAX, f32::MAX, -f32::MAX], [f32::NAN; 3], [0.0; 3], [0.0; 3]];
    let clusters = [0, 1, 2].map(Label::Cluster);
    let expected = [clusters[0], clusters[1], Label::Invalid, clusters[2], clusters[2]];
    assert_eq!(components(&points, 1e-6), expected);
}
