//! A stream of returns gives the hierarchies of whole sweeps, each as soon as it is complete.

use std::collections::BTreeSet;
use std::f32::consts::{PI, TAU};

use edgepuck_segment::{Dropped, Segmenter, Settings, Stream, StreamCluster, StreamNode, Sweep};
use test_support::{need, shared_data};

use crate::frames::{Frame, paths};
use crate::scanner::{Scan, VLP32C, block, flat, scan};

/// The offsets of a VLP-32C's beams from the encoder's azimuth, degrees.
const OFFSETS_DEG: [f32; 4] = [-4.2, -1.4, 1.4, 4.2];

/// Points of a sweep in the order in which a sensor that turns clockwise sends them, with the
/// encoder's azimuth at each.
struct Turn {
    points: Vec<[f32; 3]>,
    rings: Vec<u16>,
    encoder_rad: Vec<f32>,
}

/// The turn and index of each point of a cluster, and the encoder's azimuth, summed over turns, at
/// which the cluster was reported.
type HandedOut = (Vec<(u32, u32)>, f32);

impl Turn {
    fn new(points: &[[f32; 3]], rings: &[u16], start_rad: f32) -> Self {
        let encoder_rad = |i: usize| {
            let offset = OFFSETS_DEG[usize::from(rings[i]) % 4].to_radians();
            (offset - points[i][1].atan2(points[i][0]) - start_rad).rem_euclid(TAU)
        };
        let mut order: Vec<_> = (0..points.len()).map(|i| (encoder_rad(i), i)).collect();
        order.sort_by(|a, b| a.0.total_cmp(&b.0));
        Self {
            points: order.iter().map(|&(_, i)| points[i]).collect(),
            rings: order.iter().map(|&(_, i)| rings[i]).collect(),
            encoder_rad: order.iter().map(|&(angle, _)| angle + start_rad).collect(),
        }
    }

    /// The clusters of the whole sweep's hierarchy that are not too wide, by the places of their
    /// points.
    ///
    /// Within each cell of the range image, the returns are in the order of the stream, which may
    /// begin with the last ones of a turn: the order decides how sums are rounded.
    fn whole(&self, settings: &Settings) -> BTreeSet<Vec<u32>> {
        let n = self.points.len();
        let column_rad = settings.column_width_deg.to_radians();
        let first_rad = self.encoder_rad[0] - OFFSETS_DEG[3].to_radians() - 1e-4;
        let first_rad = (first_rad / column_rad).floor() * column_rad;
        let sent_rad = |i: usize| {
            let azimuth_rad = -self.points[i][1].atan2(self.points[i][0]);
            let along_rad = (azimuth_rad - first_rad).rem_euclid(TAU);
            along_rad + (self.encoder_rad[i] - azimuth_rad + PI).rem_euclid(TAU)
        };
        let mut order: Vec<_> = (0..n).collect();
        order.sort_by(|&a, &b| sent_rad(a).total_cmp(&sent_rad(b)));
        let place = |i: usize| order[i];
        let points: Vec<_> = (0..n).map(|i| self.points[place(i)]).collect();
        let rings: Vec<_> = (0..n).map(|i| self.rings[place(i)]).collect();
        let mut segmenter = Segmenter::new(settings.clone()).unwrap();
        let found = segmenter.hierarchy(&Sweep { points: &points, rings: Some(&rings) }).unwrap();
        let sorted = |points: &[u32]| {
            let mut points: Vec<_> = points.iter().map(|&i| place(i as usize) as u32).collect();
            points.sort_unstable();
            points
        };
        let nodes = found.nodes().filter(|node| node.diagonal_m <= settings.max_size_m);
        nodes.map(|node| sorted(node.points)).collect()
    }

    fn stream(&self, settings: &Settings, n_turns: u32) -> (Vec<HandedOut>, Dropped) {
        self.stream_some(settings, n_turns, |_| true)
    }

    /// Those nodes of the stream for which `is_asked` holds.
    fn stream_some(
        &self,
        settings: &Settings,
        n_turns: u32,
        is_asked: fn(&StreamNode) -> bool,
    ) -> (Vec<HandedOut>, Dropped) {
        let mut stream = Stream::new(settings.clone(), 300_000).unwrap();
        let mut found = Vec::new();
        let behind = OFFSETS_DEG[3].to_radians();
        for turn in 0..n_turns {
            for i in 0..self.points.len() {
                let at = self.encoder_rad[i] + turn as f32 * TAU;
                stream.advance(self.encoder_rad[i] - behind, |cluster| {
                    found.extend(nodes(&cluster, is_asked).map(|tags| (tags, at)));
                });
                stream.push(self.points[i], self.rings[i], (turn, i as u32));
            }
        }
        let at = n_turns as f32 * TAU;
        stream.end(|cluster| found.extend(nodes(&cluster, is_asked).map(|tags| (tags, at))));
        (found, stream.dropped())
    }
}

/// The tags of the points of each node, ascending. Each node lies within its parent, which comes
/// after it.
fn nodes<'a>(
    cluster: &'a StreamCluster<'_, (u32, u32)>,
    is_asked: fn(&StreamNode) -> bool,
) -> impl Iterator<Item = Vec<(u32, u32)>> + 'a {
    let asked = cluster.nodes.iter().enumerate().filter(move |(_, node)| is_asked(node));
    asked.map(|(number, node)| {
        if let Some(parent) = node.parent {
            let whole = &cluster.nodes[parent].points;
            assert!(parent > number && whole.len() > node.points.len());
            assert!(whole.start <= node.points.start && node.points.end <= whole.end);
        }
        let mut tags = cluster.tags[node.points.clone()].to_vec();
        tags.sort_unstable();
        tags
    })
}

fn settings(elevations_deg: impl Iterator<Item = f64>) -> Settings {
    let mut settings = Settings::default();
    settings.ring_elevations_deg = Some(elevations_deg.map(|degrees| degrees as f32).collect());
    settings
}

/// The stream reports each cluster of the sweep once a turn, with the same points, except for
/// clusters that the start or the end of the stream divides.
fn assert_same(turn: &Turn, settings: &Settings) {
    let expected = turn.whole(settings);
    assert!(!expected.is_empty());
    // The first turn lacks its first beams, so that the ground of the second turn differs.
    let (found, dropped) = turn.stream(settings, 5);
    for begun_in in 2..=3 {
        let begun: Vec<_> = found.iter().filter(|(tags, _)| tags[0].0 == begun_in).collect();
        let clusters: BTreeSet<Vec<u32>> = begun
            .iter()
            .map(|(tags, _)| {
                let mut points: Vec<_> = tags.iter().map(|&(_, point)| point).collect();
                points.sort_unstable();
                points
            })
            .collect();
        assert_eq!(begun.len(), clusters.len(), "a cluster was handed out twice");
        let (lost, new): (Vec<_>, Vec<_>) =
            (expected.difference(&clusters).collect(), clusters.difference(&expected).collect());
        assert!(
            clusters == expected,
            "turn {begun_in}: {} of {} clusters of the whole sweep are missing, and {} are new",
            lost.len(),
            expected.len(),
            new.len()
        );
    }
    assert_eq!(dropped, Dropped { late: dropped.late, overflow: 0 });
    assert!(dropped.late < 1000, "{dropped:?}: more than the first beams'");
}

/// A street of boxes all around; one of them lies across each of the four axes.
fn street() -> Scan {
    let mut surfaces = vec![flat()];
    for i in 0..16 {
        let (sin, cos) = (f64::from(i) * TAU as f64 / 16.0).sin_cos();
        let far = 5.0 + f64::from(i * 7 % 16) * 1.5;
        let size = [0.4 + f64::from(i % 4), 0.5 + f64::from(i % 3)];
        surfaces.push(block([far * cos, far * sin], size, 0.0, 1.0 + f64::from(i % 3) * 0.5));
    }
    scan(&VLP32C, &surfaces)
}

#[test]
fn clusters_are_those_of_the_whole_sweep_wherever_the_turn_begins() {
    let (scan, settings) = (street(), settings(VLP32C.into_iter()));
    for start_deg in [0.0f32, 77.7, 180.0, 359.9] {
        assert_same(&Turn::new(&scan.points, &scan.rings, start_deg.to_radians()), &settings);
    }
}

#[test]
fn clusters_of_real_sweeps_are_those_of_the_whole_sweep() {
    let folder = need!(shared_data("real_frames"));
    for path in paths(&folder) {
        let frame = Frame::read(&path);
        let Some(lasers) = &frame.lasers else { continue };
        let n_rings = usize::from(*lasers.iter().max().unwrap()) + 1;
        let mut sums = vec![[0.0f64; 2]; n_rings];
        for (&[x, y, z], &laser) in frame.points.iter().zip(lasers) {
            sums[usize::from(laser)][0] += f64::from(x.hypot(y));
            sums[usize::from(laser)][1] += f64::from(z);
        }
        let settings = settings(sums.iter().map(|[flat, z]| z.atan2(*flat).to_degrees()));
        assert_same(&Turn::new(&frame.points, lasers, 0.0), &settings);
    }
}

#[test]
fn a_cluster_is_handed_out_when_the_beams_have_passed_it() {
    let scan = scan(&VLP32C, &[flat(), block([0.0, -10.0], [1.0, 1.0], 0.0, 1.7)]);
    let turn = Turn::new(&scan.points, &scan.rings, 0.0);
    let (found, _) = turn.stream(&settings(VLP32C.into_iter()), 3);
    for (tags, at_rad) in found.iter().filter(|(tags, _)| tags[0].0 > 0) {
        let (turn_number, last) = *tags.last().unwrap();
        let last_rad = turn.encoder_rad[last as usize] + turn_number as f32 * TAU;
        // Twice the offset, which the last beam of the right edge may have, the columns that are
        // searched for steps, and a step of 0.8 m at 9.5 m with three columns.
        let waited_deg = (at_rad - last_rad).to_degrees();
        assert!((0.0..=4.2 + 4.2 + 8.0 + 4.9 + 0.6).contains(&waited_deg), "{waited_deg}");
    }
    // The cluster of the first turn waits for the ground.
    assert!(found[0].1 > TAU);
}

#[test]
fn walls_all_around_are_no_cluster_and_take_no_room() {
    let walls = [[0.0, 4.0], [0.0, -4.0], [4.0, 0.0], [-4.0, 0.0]];
    let wall = |at: [f64; 2]| {
        let size = if at[0] == 0.0 { [8.2, 0.2] } else { [0.2, 8.2] };
        block(at, size, 0.0, 3.0)
    };
    let mut surfaces = vec![flat(), block([1.8, -1.5], [0.4, 0.4], 0.0, 1.2)];
    surfaces.extend(walls.map(wall));
    let scan = scan(&VLP32C, &surfaces);
    let turn = Turn::new(&scan.points, &scan.rings, 0.0);
    let settings = settings(VLP32C.into_iter());
    let (found, dropped) = turn.stream_some(&settings, 12, |node| !node.is_part);
    assert_eq!(dropped.overflow, 0);
    for (tags, _) in found.iter().filter(|(tags, _)| (1..11).contains(&tags[0].0)) {
        let surfaces: BTreeSet<_> =
            tags.iter().map(|&(_, point)| turn.points[point as usize]).map(is_pillar).collect();
        assert_eq!(surfaces, BTreeSet::from([true]));
    }
    let pillars = found.iter().filter(|(tags, _)| is_pillar(turn.points[tags[0].1 as usize]));
    assert!(pillars.count() >= 12);
}

fn is_pillar([x, y, _]: [f32; 3]) -> bool {
    (1.5..2.1).contains(&x) && (-1.8..-1.2).contains(&y)
}

#[test]
fn a_stream_that_ends_within_the_first_turn_is_segmented() {
    let scan = scan(&VLP32C, &[flat(), block([0.0, -10.0], [1.0, 1.0], 0.0, 1.7)]);
    let mut turn = Turn::new(&scan.points, &scan.rings, 0.0);
    let expected = turn.whole(&settings(VLP32C.into_iter()));
    let half = turn.points.len() / 2;
    turn.points.truncate(half);
    let (found, _) = turn.stream(&settings(VLP32C.into_iter()), 1);
    let found: BTreeSet<Vec<_>> =
        found.iter().map(|(tags, _)| tags.iter().map(|tag| tag.1).collect()).collect();
    assert_eq!(found, expected);
}

#[test]
fn a_head_that_stands_still_fills_the_room_and_no_more() {
    let mut stream = Stream::new(settings(VLP32C.into_iter()), 10_000).unwrap();
    stream.advance(0.0, |_| ());
    for i in 0..100_000 {
        let ring = i as u16 % 32;
        stream.push([10.0, -1.0, f32::from(ring) / 10.0], ring, ());
        stream.advance(0.01, |_| ());
    }
    assert_eq!(stream.dropped(), Dropped { late: 0, overflow: 90_000 });
    let mut sizes = vec![];
    stream.end(|cluster| sizes.push(cluster.points.len()));
    let taken: usize = sizes.iter().sum();
    // A column holds as many as its cells compare: 16 of each ring.
    assert_eq!(taken, 16 * 32);
    let not_opened = 10_000 - 16 * 32;
    assert_eq!(stream.dropped(), Dropped { late: 0, overflow: 90_000 + not_opened });
    stream.advance(0.0, |_| ());
    (0..20).for_each(|ring| stream.push([10.0, -1.0, 1.0], ring, ()));
    stream.end(|cluster| sizes.push(cluster.points.len()));
    // No step reaches the lowest ring, which lies 9 degrees below the others.
    assert_eq!(sizes.last(), Some(&19));
}

#[test]
fn unusual_returns_are_passed_over() {
    let mut stream = Stream::new(settings(VLP32C.into_iter()), 1000).unwrap();
    stream.push([5.0, 0.0, 0.0], 0, ());
    assert_eq!(stream.dropped().late, 1);
    stream.advance(f32::NAN, |_| ());
    stream.advance(1.0, |_| ());
    let far = settings(VLP32C.into_iter()).max_range_m;
    for position in
        [[f32::NAN, 0.0, 0.0], [f32::INFINITY; 3], [0.0; 3], [1e30, 0.0, 0.0], [0.1, 0.1, -far]]
    {
        stream.push(position, 0, ());
    }
    stream.push([5.0, -5.0, 0.0], 99, ());
    assert_eq!(stream.dropped().late, 1);
    // The beams begin behind the sensor, and passed this point just before.
    stream.push([-5.0, -0.5, 0.0], 0, ());
    assert_eq!(stream.dropped().late, 2);
    stream.end(|_| unreachable!("there was no point"));
    assert_eq!(Dropped { late: 2, overflow: 3 }.total(), 5);
}

#[test]
fn a_stream_must_know_its_rings_and_takes_no_radius() {
    let error = Stream::<()>::new(Settings::default(), 100).err().unwrap();
    assert_eq!(error.name, "ring_elevations_deg");
    let mut with_radius = settings(VLP32C.into_iter());
    with_radius.radius_m = Some(0.5);
    let error = Stream::<()>::new(with_radius, 100).err().unwrap();
    assert_eq!(error.to_string(), "setting radius_m: expected none in a stream, found 0.5");
}
