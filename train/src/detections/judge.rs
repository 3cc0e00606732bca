//! Which detections are right: those whose centre is in the box of an object of their class.

use super::frames::{Frames, Thing};

/// Boxes are labelled by hand, and those of detections are a guess: how far outside a labelled box the
/// centre of a detection may be, metres.
const MARGIN_M: f64 = 0.5;

/// What became of a labelled object.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Asked {
    /// The index of its class.
    pub class: usize,
    /// The class by which it was found: its own, another one, or none.
    pub answer: Option<usize>,
    /// Its distance from the sensor, metres, if it is known.
    pub range_m: Option<f64>,
    pub n_points: Option<u64>,
}

/// The outcome of all frames.
#[derive(Debug, Default)]
pub struct Judged {
    pub asked: Vec<Asked>,
    /// The classes of detections of no object of theirs.
    pub wrong: Vec<usize>,
    pub n_frames: usize,
}

/// Judges the detections. Objects of fewer than `min_points`, and those that no class is known of, are
/// not asked for, and what is found there is not judged.
pub fn judge(frames: &Frames, min_points: u64) -> Judged {
    let mut judged = Judged { n_frames: frames.of.len(), ..Judged::default() };
    for [found, labelled] in &frames.of {
        let mut found: Vec<&Thing> = found.iter().collect();
        found.sort_by(|a, b| b.score.total_cmp(&a.score));
        let mut answers: Vec<Option<usize>> = vec![None; labelled.len()];
        for one in found {
            let Some(class) = one.class else { continue };
            let holds =
                |&at: &usize| labelled[at].place.contains(flat(one, &labelled[at]), MARGIN_M);
            let there: Vec<usize> = (0..labelled.len()).filter(holds).collect();
            let is_own = |&&at: &&usize| labelled[at].class == Some(class);
            let free = there.iter().filter(is_own).find(|&&at| answers[at] != Some(class));
            if let Some(&at) = free {
                answers[at] = Some(class);
            } else if there.iter().all(|&at| is_asked(&labelled[at], min_points)) {
                // Also the second one of the same object.
                if let Some(&at) = there.first() {
                    answers[at] = answers[at].or(Some(class));
                }
                judged.wrong.push(class);
            }
        }
        for (one, answer) in labelled.iter().zip(answers) {
            if let Some(class) = one.class.filter(|_| is_asked(one, min_points)) {
                let Thing { range_m, n_points, .. } = *one;
                judged.asked.push(Asked { class, answer, range_m, n_points });
            }
        }
    }
    judged
}

/// Whether an object is asked for: files without numbers of points ask for all.
fn is_asked(one: &Thing, min_points: u64) -> bool {
    one.class.is_some() && one.n_points.is_none_or(|n| n >= min_points)
}

/// The centre of a detection at the height of an object: heights do not count.
fn flat(found: &Thing, labelled: &Thing) -> [f64; 3] {
    let [x, y, _] = found.place.centre_m;
    [x, y, labelled.place.centre_m[2]]
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::geometry::OrientedBox;

    const CAR: usize = 0;
    const PERSON: usize = 1;

    fn thing(class: Option<usize>, x: f64, score: f64, n_points: u64) -> Thing {
        let size_m = if class == Some(CAR) { [4.0, 2.0, 1.5] } else { [0.6, 0.6, 1.8] };
        let place = OrientedBox { centre_m: [x, 0.0, score], size_m, yaw_rad: 0.0 };
        Thing { class, place, score, n_points: Some(n_points), track: None, range_m: None }
    }

    fn judged(found: Vec<Thing>, labelled: Vec<Thing>) -> Judged {
        let classes = ["car", "person"].map(str::to_owned).to_vec();
        judge(&Frames { classes, of: vec![[found, labelled]] }, 30)
    }

    #[test]
    fn a_detection_is_right_in_the_box_of_its_class_once() {
        let labelled = vec![thing(Some(CAR), 10.0, 1.0, 100), thing(Some(PERSON), 20.0, 1.0, 100)];
        // 2 m and half a metre ahead of the middle of the car, and beyond; a second one; a person.
        for (x, is_right) in [(12.49, true), (12.51, false)] {
            let found = judged(vec![thing(Some(CAR), x, 0.9, 50)], labelled.clone());
            assert_eq!(found.wrong.is_empty(), is_right, "{x}");
            assert_eq!(found.asked[0].answer, is_right.then_some(CAR));
        }
        let twice = vec![thing(Some(CAR), 10.0, 0.9, 50), thing(Some(CAR), 10.5, 0.8, 50)];
        assert_eq!(judged(twice, labelled.clone()).wrong, [CAR]);
        let confused = judged(vec![thing(Some(CAR), 20.0, 0.9, 50)], labelled);
        assert_eq!(confused.wrong, [CAR]);
        assert_eq!(confused.asked[1].answer, Some(CAR));
    }

    #[test]
    fn what_is_on_small_or_unknown_objects_is_not_judged() {
        for unasked in [thing(Some(CAR), 10.0, 1.0, 29), thing(None, 10.0, 1.0, 100)] {
            let found = judged(vec![thing(Some(PERSON), 10.0, 0.9, 50)], vec![unasked]);
            assert!(found.asked.is_empty() && found.wrong.is_empty());
        }
    }
}
