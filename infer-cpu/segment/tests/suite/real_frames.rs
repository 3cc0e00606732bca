//! Real sweeps with labelled cars and persons: how many are clusters of their own.

use edgepuck_segment::{Label, Segmenter, Settings, Sweep, other_axis_up};
use test_support::{need, shared_data};

use crate::frames::{Frame, paths, range_m};

/// At least 85 % of the cars and persons come out as one cluster that holds 80 % of their points
/// and at most 20 % of others, and their points are not ground.
#[test]
fn cars_and_persons_are_clusters_of_their_own() {
    let folder = need!(shared_data("real_frames"));
    let mut segmenter = Segmenter::new(Settings::default()).unwrap();
    let (mut n, mut n_whole, mut n_points, mut n_ground) = (0, 0, 0, 0);
    for path in paths(&folder) {
        let frame = Frame::read(&path);
        let sweep = Sweep { points: &frame.points, rings: frame.lasers.as_deref() };
        assert_eq!(other_axis_up(&frame.points), None, "{}", frame.name);
        let found = segmenter.segment(&sweep).unwrap();
        for (object, inside) in frame.objects() {
            let (held, others) = frame.shares(object, &inside, found);
            let is_whole = held >= 0.8 && others <= 0.2;
            n += 1;
            n_whole += usize::from(is_whole);
            n_points += inside.len();
            let is_ground = |point: &&usize| found.labels()[**point] == Label::Ground;
            n_ground += inside.iter().filter(is_ground).count();
            println!(
                "{} {:15} {:5.1} m, {:4} points: {:3.0} % held, {:3.0} % others{}",
                frame.name,
                object.class,
                range_m(object),
                inside.len(),
                100.0 * held,
                100.0 * others,
                if is_whole { "" } else { "  <--" }
            );
        }
    }
    println!("{n_whole} of {n} objects; {n_ground} of {n_points} points are called ground");
    assert!(n_whole as f64 >= 0.85 * n as f64);
    assert!(n_ground as f64 <= 0.02 * n_points as f64);
}
