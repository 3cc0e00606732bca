//! The share of right answers: by class, and within each class by label, range, number of points,
//! sensor and file.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use super::share::{Grouping, Share, bin, shares};
use super::{Labels, Object, Truth};

/// Edges of the bins of range, metres.
const RANGES: [usize; 7] = [0, 5, 10, 15, 20, 30, 40];
/// Edges of the bins of numbers of points.
const POINTS: [usize; 7] = [0, 20, 30, 60, 100, 200, 500];

/// The row of a class for all of its objects.
const ALL: &str = "all";
/// The name in the table of objects that the model should answer as `unknown`.
const NEGATIVES: &str = "negatives";

/// The shares of hits among all objects, by class and group.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// The name of a class, or `negatives`, with the share of one group of its objects.
    pub rows: Vec<(String, Share)>,
}

impl Table {
    /// Counts `objects`, whose labels `labels` explains. With `tracks`, all views of a track count
    /// once in each row: as a hit if more than half of them are hits.
    #[must_use]
    pub fn new(objects: &[Object], labels: &Labels, tracks: bool) -> Self {
        let mut by_class: BTreeMap<(bool, String), Vec<&Object>> = BTreeMap::new();
        for object in objects {
            let class = match object.truth {
                Truth::Known(class) => (false, labels.classes()[class].clone()),
                Truth::Negative => (true, NEGATIVES.to_owned()),
            };
            by_class.entry(class).or_default().push(object);
        }
        let rows = by_class.into_iter().flat_map(|((_, class), objects)| {
            let shares = class_shares(&class, &objects, labels, tracks);
            shares.into_iter().map(move |share| (class.clone(), share))
        });
        Self { rows: rows.collect() }
    }

    /// The mean share of right answers over all classes and the negatives. `None` without objects.
    #[must_use]
    pub fn balanced(&self) -> Option<f64> {
        let all = || self.rows.iter().filter(|(_, share)| share.group == ALL);
        let n = all().count();
        (n > 0).then(|| all().map(|(_, share)| share.ratio()).sum::<f64>() / n as f64)
    }

    /// The rows as CSV.
    #[must_use]
    pub fn to_csv(&self) -> Vec<u8> {
        let mut csv = csv::Writer::from_writer(Vec::new());
        let mut write = |record: [String; 7]| {
            csv.write_record(record).expect("invariant: memory takes all, rows are equally long");
        };
        write(["class", "group", "hits", "of", "share", "low", "high"].map(str::to_owned));
        for (class, share) in &self.rows {
            let (low, high) = share.interval();
            let [ratio, low, high] = [share.ratio(), low, high].map(|ratio| format!("{ratio:.4}"));
            let [hits, n] = [share.hits, share.n].map(|count| count.to_string());
            write([class.clone(), share.group.clone(), hits, n, ratio, low, high]);
        }
        csv.into_inner().expect("invariant: memory takes all")
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let class_width = self.rows.iter().map(|(class, _)| class.len()).max().unwrap_or(0);
        let group_width = self.rows.iter().map(|(_, share)| share.group.len()).max().unwrap_or(0);
        for (class, share) in &self.rows {
            let (Share { group, hits, n }, (low, high)) = (share, share.interval());
            let [ratio, low, high] = [share.ratio(), low, high].map(|ratio| 100.0 * ratio);
            writeln!(
                f,
                "{class:class_width$}  {group:group_width$}  {hits:5} of {n:5}  {ratio:5.1} %  \
                 ({low:.1} to {high:.1})"
            )?;
        }
        Ok(())
    }
}

/// The rows of one class: right answers among all of its objects, each wrong answer, and right
/// answers by label, range, number of points, sensor and file.
fn class_shares(class: &str, objects: &[&Object], labels: &Labels, tracks: bool) -> Vec<Share> {
    let right = |objects: &[&Object]| count(objects, tracks, Object::is_right);
    let named = |group: String, (hits, n): (usize, usize)| Share { group, hits, n };
    let mut found = vec![named(ALL.to_owned(), right(objects))];
    for answer in objects.iter().map(|object| object.answer.class).collect::<BTreeSet<_>>() {
        let name = answer.map_or(infer_cpu::UNKNOWN, |class| &labels.classes()[class]);
        let wrong = |object: &Object| object.answer.class == answer && !object.is_right();
        let counted = count(objects, tracks, wrong);
        if counted.0 > 0 {
            found.push(named(format!("called {name}"), counted));
        }
    }
    let has_aliases = objects.iter().any(|object| object.label != class);
    let groupings: [&Grouping<'_, Object>; 5] = [
        &|object| has_aliases.then(|| (0, format!("labelled {}", object.label))),
        &|object| Some(bin(f64::from(object.range_m.filter(|r| *r >= 0.0)?), &RANGES, "m")),
        &|object| Some(bin(object.n_points as f64, &POINTS, "points")),
        &|object| Some((0, object.sensor.clone()?)),
        &|object| Some((0, format!("from {}", object.data))),
    ];
    found.extend(groupings.into_iter().flat_map(|grouping| shares(objects, grouping, right)));
    found
}

/// The number of hits among `objects`, and the number of objects. With `tracks`, a track counts
/// once.
fn count(objects: &[&Object], tracks: bool, is_hit: impl Fn(&Object) -> bool) -> (usize, usize) {
    let mut things: BTreeMap<(&str, &str, usize), (usize, usize)> = BTreeMap::new();
    for (number, object) in objects.iter().enumerate() {
        let key = match &object.track {
            Some(track) if tracks => (&*object.data, &**track, 0),
            _ => ("", "", number),
        };
        let (hits, n) = things.entry(key).or_default();
        *hits += usize::from(is_hit(object));
        *n += 1;
    }
    (things.values().filter(|(hits, n)| 2 * hits > *n).count(), things.len())
}

#[cfg(test)]
mod tests {
    use super::super::Answer;
    use super::*;

    fn object(label: &str, truth: Truth, class: Option<usize>, track: &str) -> Object {
        let answer = Answer { class, confidence: 1.0, fine: 0, energy: 0.0, margin: None };
        Object {
            index: 0,
            data: "kitti".to_owned(),
            label: label.to_owned(),
            truth,
            n_points: 30,
            range_m: Some(12.0),
            sensor: None,
            track: Some(track.to_owned()),
            answer,
        }
    }

    fn labels() -> Labels {
        let names = ["car", "person", "tree"].map(str::to_owned);
        Labels::new(&names, &names[2..])
    }

    fn found(table: &Table, class: &str, group: &str) -> Option<(usize, usize)> {
        let mut rows = table.rows.iter().filter(|(name, _)| name == class);
        let (_, share) = rows.find(|(_, share)| share.group == group)?;
        Some((share.hits, share.n))
    }

    #[test]
    fn known_objects_and_negatives_are_counted_by_group() {
        let car = |class, track| object("car", Truth::Known(0), class, track);
        let objects = [
            car(Some(0), "1"),
            car(None, "1"),
            car(Some(0), "2"),
            object("van", Truth::Known(0), Some(1), "3"),
            object("bush", Truth::Negative, Some(0), "4"),
            object("tree", Truth::Negative, None, "5"),
        ];
        let table = Table::new(&objects, &labels(), false);
        assert_eq!(found(&table, "car", "all"), Some((2, 4)));
        assert_eq!(found(&table, "car", "called unknown"), Some((1, 4)));
        assert_eq!(found(&table, "car", "called person"), Some((1, 4)));
        assert_eq!(found(&table, "car", "called car"), None);
        assert_eq!(found(&table, "car", "labelled car"), Some((2, 3)));
        assert_eq!(found(&table, "car", "labelled van"), Some((0, 1)));
        assert_eq!(found(&table, "car", "10 to 15 m"), Some((2, 4)));
        assert_eq!(found(&table, "car", "30 to 60 points"), Some((2, 4)));
        assert_eq!(found(&table, "negatives", "all"), Some((1, 2)));
        assert_eq!(found(&table, "negatives", "called car"), Some((1, 2)));
        assert_eq!(table.balanced(), Some(0.5));
        let csv = String::from_utf8(table.to_csv()).unwrap();
        assert!(csv.starts_with("class,group,hits,of,share,low,high\ncar,all,2,4,0.5000,0.15"));
        assert!(table.to_string().contains("negatives  labelled bush"), "{table}");
    }

    /// A track of two views, one of them right, is not right by more than half.
    #[test]
    fn a_track_counts_once_if_asked() {
        let car = |class, track| object("car", Truth::Known(0), class, track);
        let objects = [car(Some(0), "1"), car(None, "1"), car(Some(0), "2")];
        let table = Table::new(&objects, &labels(), true);
        assert_eq!(found(&table, "car", "all"), Some((1, 2)));
    }
}
