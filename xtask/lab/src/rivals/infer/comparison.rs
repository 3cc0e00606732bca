//! One job, done by all candidates in turns.

use super::candidate::{Arithmetic, Candidate, Job, Label};
use crate::measure::clock::{Cost, Costs, Spread};
use anyhow::{Result, ensure};
use serde::ser::SerializeMap as _;
use serde::{Serialize, Serializer};
use std::thread::sleep;
use std::time::Duration;

/// How long a turn should last: long against a scheduler's slice, short
/// against what disturbs a machine for a while.
const TURN_S: f64 = 0.04;

const REPEATS: [usize; 2] = [3, 40];

/// Threads of the pool that ran last may still spin; ncnn's do for 20 ms.
const PAUSE: Duration = Duration::from_millis(30);

#[derive(Clone, Debug, Serialize)]
pub struct Entry {
    #[serde(flatten)]
    pub engine: Label,
    #[serde(flatten)]
    pub job: Job,
    /// The difference of its answer from the reference's.
    pub error: f64,
    #[serde(flatten, serialize_with = "in_ns")]
    pub costs: Costs,
}

fn in_ns<S: Serializer>(costs: &Costs, serializer: S) -> Result<S::Ok, S::Error> {
    let ns = |of: fn(&Cost) -> f64| -> Vec<u64> {
        costs.0.iter().map(|cost| (of(cost) * 1e9).round() as u64).collect()
    };
    let mut map = serializer.serialize_map(Some(2))?;
    map.serialize_entry("wall_ns", &ns(|cost| cost.wall_s))?;
    map.serialize_entry("cpu_ns", &ns(|cost| cost.cpu_s))?;
    map.end()
}

/// Lets all `candidates` do `job` in `rounds` rounds of one turn each, their
/// order rotated from round to round. A candidate that fails, or whose answer's
/// `error_of` is above the `tolerance`, is left out with a message.
pub fn compare(
    candidates: &mut [Candidate],
    job: Job,
    rounds: usize,
    error_of: impl Fn(&[f64]) -> Result<f64>,
    tolerance: impl Fn(Arithmetic) -> f64,
) -> Vec<Entry> {
    let mut participants = Vec::new();
    for (place, candidate) in candidates.iter_mut().enumerate() {
        match enter(candidate, job, &error_of, &tolerance) {
            Ok((repeats, entry)) => participants.push((place, candidate, repeats, entry)),
            Err(cause) => refuse(&candidate.label.name, job, &cause),
        }
    }
    for _ in 0..rounds {
        participants.retain_mut(|(_, candidate, repeats, entry)| {
            sleep(PAUSE);
            let turn = candidate.engine.time(*repeats).map(|costs| entry.costs.0.extend(costs));
            turn.inspect_err(|cause| refuse(&entry.engine.name, job, cause)).is_ok()
        });
        if !participants.is_empty() {
            participants.rotate_left(1);
        }
    }
    participants.sort_by_key(|participant| participant.0);
    participants.into_iter().map(|(.., entry)| entry).collect()
}

fn refuse(name: &str, job: Job, cause: &anyhow::Error) {
    println!("left out {name} at {} points, {}: {cause:#}", job.points, job.setting);
}

/// Tries `job` with `candidate`: the repeats that fill a turn, and an entry without costs.
fn enter(
    candidate: &mut Candidate,
    job: Job,
    error_of: impl Fn(&[f64]) -> Result<f64>,
    tolerance: impl Fn(Arithmetic) -> f64,
) -> Result<(usize, Entry)> {
    let Candidate { label, engine, .. } = candidate;
    engine.load(job)?;
    let error = error_of(&engine.answer()?)?;
    let allowed = tolerance(label.arithmetic);
    ensure!(error <= allowed, "its answer is off by {error:.1e}, more than {allowed:.1e}");
    let trial = engine.time(REPEATS[0])?;
    let least_s = Spread::of(trial.iter().map(|cost| cost.wall_s)).min;
    let entry = Entry { engine: label.clone(), job, error, costs: Costs::default() };
    Ok((repeats(least_s), entry))
}

/// Repeats that fill a turn, of work that takes `each_s`.
fn repeats(each_s: f64) -> usize {
    let [least, most] = REPEATS;
    ((TURN_S / each_s) as usize).clamp(least, most)
}

#[cfg(test)]
mod tests {
    use super::super::candidate::Engine;
    use super::*;
    use anyhow::bail;
    use std::cell::RefCell;
    use std::rc::Rc;

    /// Answers `answer`, notes its turns and fails at the last of `turns`.
    struct Scripted {
        name: char,
        answer: f64,
        turns: usize,
        notes: Rc<RefCell<String>>,
    }

    impl Engine for Scripted {
        fn load(&mut self, _: Job) -> Result<()> {
            Ok(())
        }

        fn answer(&mut self) -> Result<Vec<f64>> {
            Ok(vec![self.answer])
        }

        fn time(&mut self, repeats: usize) -> Result<Vec<Cost>> {
            self.notes.borrow_mut().push(self.name);
            self.turns -= 1;
            if self.turns == 0 {
                bail!("gone");
            }
            Ok(vec![Cost { wall_s: 0.02, cpu_s: 0.01 }; repeats])
        }
    }

    fn play(rounds: usize, cast: &[(char, f64, usize)]) -> (String, Vec<Entry>) {
        let notes = Rc::new(RefCell::new(String::new()));
        let candidate = |&(name, answer, turns): &(char, f64, usize)| {
            let engine = Scripted { name, answer, turns, notes: Rc::clone(&notes) };
            Candidate::ours(name.to_string(), Arithmetic::F32, engine)
        };
        let mut candidates: Vec<Candidate> = cast.iter().map(candidate).collect();
        let job = Job { points: 16, setting: 1 };
        let entries = compare(&mut candidates, job, rounds, |a| Ok((a[0] - 1.0).abs()), |_| 0.1);
        (notes.take(), entries)
    }

    #[test]
    fn turns_go_round_and_everyone_begins_once() {
        let (notes, entries) = play(3, &[('a', 1.0, 99), ('b', 1.0, 99), ('c', 1.0, 99)]);
        // The trials, then three rounds.
        assert_eq!(notes, "abcabcbcacab");
        assert_eq!(entries[0].costs.0.len(), 9);
        assert_eq!(entries.iter().map(|e| &e.engine.name[..]).collect::<String>(), "abc");
    }

    #[test]
    fn a_wrong_answer_is_not_timed_and_a_failing_candidate_is_left_out() {
        let (notes, entries) = play(2, &[('a', 1.2, 99), ('b', 1.05, 99), ('c', f64::NAN, 99)]);
        assert_eq!(notes, "bbb");
        assert!((entries[0].error - 0.05).abs() < 1e-12);
        let record = serde_json::to_value(&entries[0]).unwrap();
        assert_eq!((&record["wall_ns"][0], &record["points"]), (&20_000_000.into(), &16.into()));
        let (notes, entries) = play(2, &[('a', 1.0, 99), ('b', 1.0, 2)]);
        assert_eq!(notes, "ababa");
        assert_eq!(entries.iter().map(|e| &e.engine.name[..]).collect::<String>(), "a");
        assert_eq!([0.004, 1.0, 0.0].map(repeats), [10, 3, 40]);
    }
}
