//! How well tracks follow objects: HOTA (Luiten et al., "HOTA: A Higher Order Metric for Evaluating
//! Multi-Object Tracking", IJCV 2021) and switches of identity.

use std::collections::BTreeMap;

use lsap::solve;

use super::frames::{Frames, Thing};

/// Objects and detections that are farther apart are not similar at all, metres: TrackEval's distance for points.
const FARTHEST_M: f64 = 2.0;
/// The similarity at which switches are counted.
const SWITCHED_AT: f64 = 0.5;
/// TrackEval's thresholds of similarity: 0.05 to 0.95.
const N_ALPHAS: usize = 19;

/// The metrics of the tracks of a class.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Followed {
    /// HOTA, and its parts for detection and association, 0 to 1.
    pub hota: f64,
    pub detection: f64,
    pub association: f64,
    /// How often an object goes on under another number.
    pub switches: usize,
}

/// How well the tracks of `class` follow its objects of `min_points` or more; `None` without numbers of
/// tracks and of objects, or without tracks.
pub fn followed(frames: &Frames, class: usize, min_points: u64) -> Option<Followed> {
    let turns: Vec<Turn> =
        frames.of.iter().map(|of| Turn::of(of, class, min_points)).collect::<Option<_>>()?;
    let mut counts = Counts::default();
    turns.iter().for_each(|turn| counts.add(turn));
    let mut matched = vec![Matched::default(); N_ALPHAS];
    for turn in &turns {
        let pairs =
            turn.assigned(|object, track, similar| counts.alignment(object, track) * similar);
        for (step, matched) in (1..).zip(&mut matched) {
            let alpha = f64::from(step) / (N_ALPHAS + 1) as f64;
            matched.add(
                turn,
                pairs.iter().filter(|&&(_, _, similar)| similar >= alpha - f64::EPSILON),
            );
        }
    }
    let of_alphas: Vec<[f64; 2]> = matched.iter().map(|one| one.accuracies(&counts)).collect();
    let mean =
        |of: &dyn Fn(&[f64; 2]) -> f64| of_alphas.iter().map(of).sum::<f64>() / N_ALPHAS as f64;
    let has_any = !counts.tracks.is_empty();
    has_any.then(|| Followed {
        hota: mean(&|[detection, association]| (detection * association).sqrt()),
        detection: mean(&|[detection, _]| *detection),
        association: mean(&|[_, association]| *association),
        switches: switches(&turns),
    })
}

/// How often an object goes on under another number, as CLEAR MOT counts (Bernardin and Stiefelhagen 2008):
/// an object keeps the track of the turn before, as long as both are similar enough.
fn switches(turns: &[Turn]) -> usize {
    /// More than any similarity.
    const KEPT: f64 = 1000.0;
    let (mut last, mut before) = (BTreeMap::new(), BTreeMap::new());
    let mut n = 0;
    for turn in turns.iter().filter(|turn| !turn.similar.is_empty()) {
        let pairs = turn.assigned(|object, track, similar| {
            let kept = if before.get(&object) == Some(&track) { KEPT } else { 0.0 };
            if similar < SWITCHED_AT - f64::EPSILON { 0.0 } else { kept + similar }
        });
        before.clear();
        for (object, track, similar) in pairs {
            if similar >= SWITCHED_AT - f64::EPSILON {
                before.insert(object, track);
                n += usize::from(last.insert(object, track).is_some_and(|other| other != track));
            }
        }
    }
    n
}

/// The number of a file, and of a track or of an object in it.
type Track = (usize, u64);

/// The objects and tracks of a turn, and how similar each two are.
struct Turn {
    objects: Vec<Track>,
    tracks: Vec<Track>,
    /// A row for each object.
    similar: Vec<f64>,
}

impl Turn {
    fn of([found, labelled]: &[Vec<Thing>; 2], class: usize, min_points: u64) -> Option<Self> {
        let of_class = |one: &&Thing| one.class == Some(class);
        let labelled: Vec<&Thing> = labelled
            .iter()
            .filter(of_class)
            .filter(|one| one.n_points.is_none_or(|n| n >= min_points))
            .collect();
        let found: Vec<&Thing> = found.iter().filter(of_class).collect();
        let similar = |a: &Thing, b: &Thing| {
            let off = |axis: usize| a.place.centre_m[axis] - b.place.centre_m[axis];
            (1.0 - libm::hypot(off(0), off(1)) / FARTHEST_M).max(0.0)
        };
        Some(Self {
            objects: labelled.iter().map(|one| one.track).collect::<Option<_>>()?,
            tracks: found.iter().map(|one| one.track).collect::<Option<_>>()?,
            similar: labelled
                .iter()
                .flat_map(|a| found.iter().map(move |b| similar(a, b)))
                .collect(),
        })
    }

    fn at(&self, row: usize, column: usize) -> f64 {
        self.similar[row * self.tracks.len() + column]
    }

    /// The pairs of objects and tracks whose worth is the greatest together, with their similarity.
    fn assigned(&self, worth: impl Fn(Track, Track, f64) -> f64) -> Vec<(Track, Track, f64)> {
        let (n_rows, n_columns) = (self.objects.len(), self.tracks.len());
        let cells = (0..n_rows).flat_map(|row| (0..n_columns).map(move |column| (row, column)));
        let worths: Vec<f64> = cells
            .map(|(row, column)| {
                worth(self.objects[row], self.tracks[column], self.at(row, column))
            })
            .collect();
        if worths.is_empty() {
            return Vec::new();
        }
        let (rows, columns) =
            solve(n_rows, n_columns, &worths, true).expect("invariant: worths are finite");
        let pairs = rows.into_iter().zip(columns);
        pairs.map(|(i, j)| (self.objects[i], self.tracks[j], self.at(i, j))).collect()
    }
}

/// How often each object and each track is there, and how often both are where the other is.
#[derive(Default)]
struct Counts {
    objects: BTreeMap<Track, f64>,
    tracks: BTreeMap<Track, f64>,
    together: BTreeMap<(Track, Track), f64>,
}

impl Counts {
    fn add(&mut self, turn: &Turn) {
        turn.objects.iter().for_each(|&object| *self.objects.entry(object).or_default() += 1.0);
        turn.tracks.iter().for_each(|&track| *self.tracks.entry(track).or_default() += 1.0);
        let n = turn.tracks.len();
        for (row, &object) in turn.objects.iter().enumerate() {
            for (column, &track) in turn.tracks.iter().enumerate() {
                let of_row: f64 = (0..n).map(|other| turn.at(row, other)).sum();
                let of_column: f64 =
                    (0..turn.objects.len()).map(|other| turn.at(other, column)).sum();
                let own = turn.at(row, column);
                let union = of_row + of_column - own;
                if union > f64::EPSILON {
                    *self.together.entry((object, track)).or_default() += own / union;
                }
            }
        }
    }

    /// The share of the time of either that both are together.
    fn alignment(&self, object: Track, track: Track) -> f64 {
        let together = self.together.get(&(object, track)).copied().unwrap_or(0.0);
        together / (self.objects[&object] + self.tracks[&track] - together)
    }
}

/// The matches at one threshold.
#[derive(Clone, Default)]
struct Matched {
    n: f64,
    n_objects: f64,
    n_tracks: f64,
    pairs: BTreeMap<(Track, Track), f64>,
}

impl Matched {
    fn add<'a>(&mut self, turn: &Turn, pairs: impl Iterator<Item = &'a (Track, Track, f64)>) {
        self.n_objects += turn.objects.len() as f64;
        self.n_tracks += turn.tracks.len() as f64;
        for &(object, track, _) in pairs {
            self.n += 1.0;
            *self.pairs.entry((object, track)).or_default() += 1.0;
        }
    }

    /// The accuracies of detection and of association.
    fn accuracies(&self, counts: &Counts) -> [f64; 2] {
        let union = |(object, track): &(Track, Track), n: f64| {
            counts.objects[object] + counts.tracks[track] - n
        };
        let of_pairs = self.pairs.iter().map(|(pair, &n)| n * n / union(pair, n).max(1.0));
        let association = of_pairs.fold(0.0, |sum, share| sum + share);
        let all = self.n_objects + self.n_tracks - self.n;
        [self.n / all.max(1.0), association / self.n.max(1.0)]
    }
}
