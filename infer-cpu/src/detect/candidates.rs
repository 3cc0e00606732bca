//! What may be an object: boxes that the bird's-eye network sees, and clusters where it sees at least
//! something.
//!
//! A box may hold points of what is beside an object, which mislead the model that is asked. What stands apart is a
//! cluster, and a person who touches something is often one by a narrower gap.

use edgepuck_segment::{Extent, Label, Segmenter, Settings, SettingsError, Sweep};

use super::confidence::Confidence;
use crate::birdseye::{BirdsEye, Heights, PERSON, Scores, Seen, Standing};

/// The network's least score of a box, and of a cluster's place: what is less likely is not asked about. On labelled
/// sweeps, lower ones find nothing more (assets/reports/reality/by-class.md).
const LEAST_OF_BOX: f32 = 0.05;
const LEAST_OF_CLUSTER: f32 = 0.03;
/// The widest clusters of each class of the network, metres along the diagonal, and how far about their
/// middles the network's score counts, cells of 0.2 m. Trucks are cut into several.
const CLUSTERS: [(usize, f32, usize); 3] = [(0, 7.0, 4), (PERSON, 2.0, 2), (2, 2.8, 2)];
/// The widest gap between points of a part, metres: a part of a cluster may be a person.
const GAP_M: f32 = 0.12;
/// The points of parts that may be persons are within these cells of a place that may be a person's: their middle
/// is within two, they are within 1 m of it, and so is what a gap parts from them, rounded up.
const PART_REACH: usize = 9;

/// The points of what may be an object.
pub struct Candidate {
    pub points: Vec<u32>,
    /// The height of the ground under it, metres in the sensor's frame.
    pub ground_z_m: f32,
    /// What the network sees there: a box, or for a cluster the best of each class.
    pub seen: Vec<Seen>,
    pub is_cluster: bool,
}

/// Finds candidates in sweeps.
pub struct Candidates {
    birdseye: BirdsEye,
    parts: Segmenter,
    min_points: usize,
}

impl Candidates {
    /// Candidates of at least `min_points` points.
    ///
    /// # Errors
    /// An invalid number.
    pub fn new(birdseye: BirdsEye, min_points: usize) -> Result<Self, SettingsError> {
        let mut settings = Settings::default();
        (settings.min_points, settings.radius_m) = (min_points, Some(GAP_M));
        Ok(Self { birdseye, parts: Segmenter::new(settings)?, min_points })
    }

    /// The candidates of a sweep of these labels and clusters.
    pub fn of(
        &mut self,
        points: &[[f32; 3]],
        labels: &[Label],
        clusters: impl Iterator<Item = Vec<u32>>,
        ground: &Heights,
        joint: &Confidence,
    ) -> Vec<Candidate> {
        let scores = self.birdseye.look(points, labels, ground);
        let standing = Standing::new(points, labels, ground);
        let mut found: Vec<_> = scores
            .objects(LEAST_OF_BOX)
            .into_iter()
            .map(|seen| Candidate {
                points: standing.of(&seen),
                ground_z_m: ground.z_m(seen.centre_m),
                seen: vec![seen],
                is_cluster: false,
            })
            .collect();
        let mut add = |own: Vec<u32>, is_part: bool| {
            let extent = Extent::of(own.iter().map(|&i| points[i as usize]));
            let middle_m = extent.middle();
            let seen = seen_near(&scores, joint, middle_m, extent.diagonal_m(), is_part);
            if !seen.is_empty() {
                let ground_z_m = ground.z_m(middle_m);
                found.push(Candidate { points: own, ground_z_m, seen, is_cluster: true });
            }
        };
        clusters.for_each(|own| add(own, false));
        let near = standing.about(&scores.about(PERSON, LEAST_OF_CLUSTER, PART_REACH));
        let positions: Vec<_> = near.iter().map(|&i| points[i as usize]).collect();
        let sweep = Sweep { points: &positions, rings: None };
        // There are fewer points than in the whole sweep.
        if let Ok(parts) = self.parts.segment(&sweep) {
            for part in parts.clusters() {
                add(part.points.iter().map(|&i| near[i as usize]).collect(), true);
            }
        }
        found.retain(|one| one.points.len() >= self.min_points);
        found
    }
}

/// What the network sees about the middle of a cluster, or of a part of one, of each class that is as large.
fn seen_near(
    scores: &Scores,
    joint: &Confidence,
    middle_m: [f32; 2],
    diagonal_m: f32,
    is_part: bool,
) -> Vec<Seen> {
    let is_asked = |&&(class, widest_m, _): &&(usize, f32, usize)| {
        diagonal_m <= widest_m && (!is_part || class == PERSON) && joint.takes_clusters(class)
    };
    let near = |&(class, _, reach): &(usize, f32, usize)| {
        scores.near(class, middle_m, reach).filter(|seen| seen.score >= LEAST_OF_CLUSTER)
    };
    CLUSTERS.iter().filter(is_asked).filter_map(near).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::birdseye::testing::Told;

    /// Cells of 0.2 m: (10.1, 0.1) m is the middle of row 250 and column 200. Of a logit of -2, the score is
    /// 0.12, and of -4 it is 0.02.
    #[test]
    fn a_cluster_is_what_the_network_sees_near_it_if_it_is_as_large() {
        let joint = Confidence::of_clusters(&[true, true, true, false]);
        let [low, high] = [-4.0, -2.0];
        let scores = Told::scores(&[
            ([254, 200], 0, high),
            ([252, 198], 1, high),
            ([250, 200], 2, low),
            ([250, 200], 3, high),
        ]);
        let near = |diagonal_m, is_part| {
            let seen = seen_near(&scores, &joint, [10.1, 0.1], diagonal_m, is_part);
            seen.iter().map(|seen| seen.class).collect::<Vec<_>>()
        };
        assert_eq!(near(1.9, false), [0, 1]);
        assert_eq!((near(2.1, false), near(7.1, false)), (vec![0], vec![]));
        // A part of a cluster is a person at most.
        assert_eq!((near(1.9, true), near(2.1, true)), (vec![1], vec![]));
        let beyond = seen_near(&scores, &joint, [10.1, 0.5], 1.0, false);
        assert_eq!(beyond.iter().map(|seen| seen.class).collect::<Vec<_>>(), [0]);
        let none = Confidence::of_clusters(&[false; 4]);
        assert!(seen_near(&scores, &none, [10.1, 0.1], 1.0, false).is_empty());
    }

    /// Two persons 0.2 m apart are one cluster by a gap of 0.3 m, and two parts.
    #[test]
    fn parts_of_a_cluster_are_candidates() {
        let column = |x: f32| (0..30).map(move |i| [x, 0.02 * i as f32, -0.5]);
        let ground = (0..40).map(|i| [0.3 * i as f32 - 2.0, 0.0, -1.6]);
        let points: Vec<_> = column(8.0).chain(column(8.2)).chain(ground).collect();
        let labels: Vec<_> =
            (0..100).map(|i| if i < 60 { Label::Cluster(0) } else { Label::Ground }).collect();
        let told = [([240, 201], 1, 2.0), ([241, 201], 1, 2.0)];
        let told = told.map(|(at, class, logit)| (at, class, logit, [0.0; 7])).to_vec();
        let birdseye = BirdsEye { network: Box::new(Told(told)) };
        let mut candidates = Candidates::new(birdseye, 20).unwrap();
        let heights = Heights::of(&points, &labels).unwrap();
        let joint = Confidence::of_clusters(&[true; 4]);
        let all =
            candidates.of(&points, &labels, [(0..60).collect()].into_iter(), &heights, &joint);
        let clusters = all.iter().filter(|one| one.is_cluster);
        let mut clusters: Vec<_> =
            clusters.map(|one| (one.points[0], one.points.len(), one.ground_z_m)).collect();
        clusters.sort_by_key(|one| (one.0, one.1));
        assert_eq!(clusters, [(0, 30, -1.6), (0, 60, -1.6), (30, 30, -1.6)]);
        let boxes: Vec<_> = all.iter().filter(|one| !one.is_cluster).collect();
        assert!(!boxes.is_empty() && boxes.iter().all(|one| one.seen.len() == 1));
    }

    #[test]
    fn a_cluster_needs_less_of_a_score_than_a_box() {
        let joint = Confidence::of_clusters(&[true; 4]);
        for (score, n) in [(0.029f32, 0), (0.031, 1)] {
            let scores = Told::scores(&[([250, 200], 0, (score / (1.0 - score)).ln())]);
            assert_eq!(seen_near(&scores, &joint, [10.1, 0.1], 5.0, false).len(), n, "{score}");
        }
    }

    /// Two persons of 30 points behind 40 points of ground: parts have the numbers of the sweep.
    #[test]
    fn candidates_have_the_least_number_of_points_or_more() {
        let ground = (0..40).map(|i| [0.3 * i as f32 - 2.0, 0.0, -1.6]);
        let column = |x: f32| (0..30).map(move |i| [x, 0.02 * i as f32, -0.5]);
        let points: Vec<_> = ground.chain(column(8.0)).chain(column(8.2)).collect();
        let labels: Vec<_> =
            (0..100).map(|i| if i < 40 { Label::Ground } else { Label::Cluster(0) }).collect();
        let heights = Heights::of(&points, &labels).unwrap();
        let joint = Confidence::of_clusters(&[true; 4]);
        for (min_points, expected) in [(30, &[(40, 30), (40, 60), (70, 30)][..]), (31, &[(40, 60)])]
        {
            let told = [[240, 201], [241, 201]].map(|at| (at, 1, 2.0, [0.0; 7])).to_vec();
            let birdseye = BirdsEye { network: Box::new(Told(told)) };
            let mut candidates = Candidates::new(birdseye, min_points).unwrap();
            let cluster = [(40..100).collect()].into_iter();
            let all = candidates.of(&points, &labels, cluster, &heights, &joint);
            let clusters = all.iter().filter(|one| one.is_cluster);
            let mut found: Vec<_> = clusters.map(|one| (one.points[0], one.points.len())).collect();
            found.sort();
            assert_eq!(found, expected, "{min_points}");
        }
    }
}
