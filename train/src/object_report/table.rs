//! The share of right answers: by class, and within each class by label, range, number of points,
//! sensor and file.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use formats::interval::wilson;

use super::{Labels, Object};
use crate::accuracy_report::csv_of;

/// Edges of the bins of range, metres.
const RANGES: [usize; 7] = [0, 5, 10, 15, 20, 30, 40];
/// Edges of the bins of numbers of points.
const POINTS: [usize; 7] = [0, 20, 30, 60, 100, 200, 500];

/// The group of all objects of a class.
const ALL: &str = "all";
/// The name in the table of objects that the model should answer as `unknown`.
const NEGATIVES: &str = "negatives";

/// The shares of hits among all objects, by class and group.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    rows: Vec<Row>,
}

/// The share of hits in a group of objects of one class.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Row {
    /// The class, or `negatives`.
    class: String,
    group: String,
    hits: usize,
    n: usize,
}

impl Row {
    /// The share of hits, and its 95 % interval.
    fn shares(&self) -> [f64; 3] {
        let (low, high) = wilson(self.hits, self.n);
        [self.hits as f64 / self.n as f64, low, high]
    }
}

/// The group of an object, if it has one: a number that orders the groups, and the group's name.
type Grouping<'a> = dyn Fn(&Object) -> Option<(usize, String)> + 'a;

impl Table {
    /// Counts `objects`, whose labels `labels` explains. With `tracks`, all views of a track count
    /// once in each row: as a hit if more than half of them are hits.
    pub fn new(objects: &[Object], labels: &Labels, tracks: bool) -> Self {
        let mut by_class: BTreeMap<(bool, &str), Vec<&Object>> = BTreeMap::new();
        for object in objects {
            let class = object.truth.map_or(NEGATIVES, |class| &labels.classes[class]);
            by_class.entry((object.truth.is_none(), class)).or_default().push(object);
        }
        let rows = by_class.into_iter();
        let rows = rows.flat_map(|((_, class), objects)| of_class(class, &objects, labels, tracks));
        Self { rows: rows.collect() }
    }

    /// The mean share of right answers over all classes and the negatives.
    pub fn balanced(&self) -> f64 {
        let all = || self.rows.iter().filter(|row| row.group == ALL);
        all().map(|row| row.shares()[0]).sum::<f64>() / all().count() as f64
    }

    /// The rows as CSV.
    pub fn to_csv(&self) -> Vec<u8> {
        let header = ["class", "group", "hits", "of", "share", "low", "high"].map(str::to_owned);
        csv_of(std::iter::once(header).chain(self.rows.iter().map(|row| {
            let [share, low, high] = row.shares().map(|share| format!("{share:.4}"));
            let (hits, n) = (row.hits.to_string(), row.n.to_string());
            [row.class.clone(), row.group.clone(), hits, n, share, low, high]
        })))
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let class_width = self.rows.iter().map(|row| row.class.len()).max().unwrap_or(0);
        let group_width = self.rows.iter().map(|row| row.group.len()).max().unwrap_or(0);
        for row @ Row { class, group, hits, n } in &self.rows {
            let [share, low, high] = row.shares().map(|share| 100.0 * share);
            writeln!(
                f,
                "{class:class_width$}  {group:group_width$}  {hits:5} of {n:5}  {share:5.1} %  \
                 ({low:.1} to {high:.1})"
            )?;
        }
        Ok(())
    }
}

/// The rows of one class: right answers among all of its objects, each wrong answer, and right
/// answers by label, range, number of points, sensor and file.
fn of_class(class: &str, objects: &[&Object], labels: &Labels, tracks: bool) -> Vec<Row> {
    let row = |group: String, (hits, n)| Row { class: class.to_owned(), group, hits, n };
    let right =
        |objects: &[&Object]| count(objects, tracks, |object| object.answer == object.truth);
    let mut rows = vec![row(ALL.to_owned(), right(objects))];
    for answer in objects.iter().map(|object| object.answer).collect::<BTreeSet<_>>() {
        let name = answer.map_or(infer_cpu::UNKNOWN, |class| &labels.classes[class]);
        let is_wrong = |object: &Object| object.answer == answer && answer != object.truth;
        let counted = count(objects, tracks, is_wrong);
        if counted.0 > 0 {
            rows.push(row(format!("called {name}"), counted));
        }
    }
    let has_aliases = objects.iter().any(|object| object.label != class);
    let groupings: [&Grouping<'_>; 5] = [
        &|object| has_aliases.then(|| (0, format!("labelled {}", object.label))),
        &|object| Some(bin(f64::from(object.range_m.filter(|r| *r >= 0.0)?), &RANGES, "m")),
        &|object| Some(bin(object.n_points as f64, &POINTS, "points")),
        &|object| Some((0, object.sensor.clone()?)),
        &|object| Some((0, format!("from {}", object.data))),
    ];
    for grouping in groupings {
        let mut groups: BTreeMap<(usize, String), Vec<&Object>> = BTreeMap::new();
        for &object in objects {
            if let Some(group) = grouping(object) {
                groups.entry(group).or_default().push(object);
            }
        }
        rows.extend(groups.into_iter().map(|((_, group), some)| row(group, right(&some))));
    }
    rows
}

/// The group of a `value` of 0 or more between two of the ascending `edges`: `10 to 20 m`. A bin
/// includes its lower edge; the last bin has no upper edge.
fn bin(value: f64, edges: &[usize], unit: &str) -> (usize, String) {
    let next = edges.partition_point(|&edge| edge as f64 <= value);
    let low = edges[next - 1];
    let name = match edges.get(next) {
        Some(high) => format!("{low} to {high} {unit}"),
        None => format!("{low} {unit} or more"),
    };
    (next, name)
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
    use super::*;

    fn table(objects: &[(&str, Option<usize>, Option<usize>, &str)], tracks: bool) -> Table {
        let names = ["car", "person", "tree"].map(str::to_owned);
        let object = |&(label, truth, answer, track): &(&str, _, _, &str)| Object {
            data: "kitti".to_owned(),
            label: label.to_owned(),
            truth,
            answer,
            n_points: 30,
            range_m: Some(12.0),
            track: Some(track.to_owned()),
            ..Object::default()
        };
        let objects: Vec<Object> = objects.iter().map(object).collect();
        Table::new(&objects, &Labels::new(&names, &names[2..]), tracks)
    }

    fn found(table: &Table, class: &str, group: &str) -> Option<(usize, usize)> {
        let row = table.rows.iter().find(|row| row.class == class && row.group == group)?;
        Some((row.hits, row.n))
    }

    #[test]
    fn known_objects_and_negatives_are_counted_by_group() {
        let objects = [
            ("car", Some(0), Some(0), "1"),
            ("car", Some(0), None, "1"),
            ("car", Some(0), Some(0), "2"),
            ("van", Some(0), Some(1), "3"),
            ("bush", None, Some(0), "4"),
            ("tree", None, None, "5"),
        ];
        let table = table(&objects, false);
        for (class, group, expected) in [
            ("car", "all", Some((2, 4))),
            ("car", "called unknown", Some((1, 4))),
            ("car", "called person", Some((1, 4))),
            ("car", "called car", None),
            ("car", "labelled car", Some((2, 3))),
            ("car", "labelled van", Some((0, 1))),
            ("car", "10 to 15 m", Some((2, 4))),
            ("car", "30 to 60 points", Some((2, 4))),
            ("negatives", "all", Some((1, 2))),
            ("negatives", "called car", Some((1, 2))),
        ] {
            assert_eq!(found(&table, class, group), expected, "{class}, {group}");
        }
        assert_eq!(table.balanced(), 0.5);
        let csv = String::from_utf8(table.to_csv()).unwrap();
        assert!(csv.starts_with("class,group,hits,of,share,low,high\ncar,all,2,4,0.5000,0.15"));
        assert!(table.to_string().contains("negatives  labelled bush"), "{table}");
    }

    /// A track of two views, one of them right, is not right by more than half.
    #[test]
    fn a_track_counts_once() {
        let car = |answer, track| ("car", Some(0), answer, track);
        let table = table(&[car(Some(0), "1"), car(None, "1"), car(Some(0), "2")], true);
        assert_eq!(found(&table, "car", "all"), Some((1, 2)));
    }

    #[test]
    fn a_bin_includes_its_lower_edge_and_the_last_is_open() {
        let name = |value| bin(value, &[0, 5, 10], "m").1;
        assert_eq!([0.0, 5.0, 1e9].map(name), ["0 to 5 m", "5 to 10 m", "10 m or more"]);
    }
}
