//! The share of objects that are answered rightly: by class, and of each class by
//! range, number of points, sensor and file.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use formats::interval::wilson;

use super::{Labels, Object, Truth};

/// Where ranges are divided, metres.
const RANGES: [usize; 7] = [0, 5, 10, 15, 20, 30, 40];
/// Where numbers of points are divided.
const POINTS: [usize; 7] = [0, 20, 30, 60, 100, 200, 500];

/// What the objects are called that should be answered as unknown.
const NEGATIVES: &str = "negatives";

/// The group that an object is in, if it is in one: its name, after a number that
/// orders the rows.
type GroupOf<'a> = dyn Fn(&Object) -> Option<(usize, String)> + 'a;

/// One share.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// The class, or `negatives`.
    pub class: String,
    /// Which of its objects.
    pub group: String,
    /// How many of them are as the group says, or right.
    pub hits: usize,
    /// How many there are.
    pub n: usize,
}

/// All shares.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Table {
    /// In order.
    pub rows: Vec<Row>,
}

impl Table {
    /// Of `objects`, whose labels mean `labels`. With `tracks`, the views of a track
    /// count once in each row: as right if more than half of them are.
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
        let mut table = Self::default();
        for ((_, class), objects) in &by_class {
            table.add(class, objects, labels, tracks);
        }
        table
    }

    /// Adds the rows of `class`.
    fn add(&mut self, class: &str, objects: &[&Object], labels: &Labels, tracks: bool) {
        let mut add = |group: String, (hits, n): (usize, usize)| {
            self.rows.push(Row { class: class.to_owned(), group, hits, n });
        };
        add("all".to_owned(), count(objects, tracks, Object::is_right));
        for answer in objects.iter().map(|o| o.answer.class).collect::<BTreeSet<_>>() {
            let name = answer.map_or(infer_cpu::UNKNOWN, |class| &labels.classes()[class]);
            let wrong = |object: &Object| object.answer.class == answer && !object.is_right();
            let found = count(objects, tracks, wrong);
            if found.0 > 0 {
                add(format!("called {name}"), found);
            }
        }
        let has_aliases = objects.iter().any(|object| object.label != class);
        let groups: [&GroupOf<'_>; 5] = [
            &|o| has_aliases.then(|| (0, format!("labelled {}", o.label))),
            &|o| Some(bin(f64::from(o.range_m.filter(|r| *r >= 0.0)?), &RANGES, "m")),
            &|o| Some(bin(o.n_points as f64, &POINTS, "points")),
            &|o| Some((0, o.sensor.clone()?)),
            &|o| Some((0, format!("from {}", o.data))),
        ];
        for group_of in groups {
            let mut groups: BTreeMap<(usize, String), Vec<&Object>> = BTreeMap::new();
            for object in objects {
                if let Some(group) = group_of(object) {
                    groups.entry(group).or_default().push(object);
                }
            }
            for ((_, group), objects) in groups {
                add(group, count(&objects, tracks, Object::is_right));
            }
        }
    }

    /// The mean over all classes, negatives among them, of the share of right
    /// answers; `None` without objects.
    #[must_use]
    pub fn balanced(&self) -> Option<f64> {
        let all = || self.rows.iter().filter(|row| row.group == "all");
        let n = all().count();
        (n > 0).then(|| all().map(|row| row.hits as f64 / row.n as f64).sum::<f64>() / n as f64)
    }

    /// The rows as CSV.
    #[must_use]
    pub fn to_csv(&self) -> Vec<u8> {
        let mut csv = csv::Writer::from_writer(Vec::new());
        let mut write = |record: [String; 7]| {
            csv.write_record(record).expect("invariant: memory takes all, rows are equally long");
        };
        write(["class", "group", "hits", "of", "share", "low", "high"].map(str::to_owned));
        for Row { class, group, hits, n } in &self.rows {
            let (low, high) = wilson(*hits, *n);
            let [share, low, high] =
                [*hits as f64 / *n as f64, low, high].map(|share| format!("{share:.4}"));
            let [hits, n] = [hits, n].map(usize::to_string);
            write([class.clone(), group.clone(), hits, n, share, low, high]);
        }
        csv.into_inner().expect("invariant: memory takes all")
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let width = |of: fn(&Row) -> &str| self.rows.iter().map(|row| of(row).len()).max();
        let class_width = width(|row| row.class.as_str()).unwrap_or(0);
        let group_width = width(|row| row.group.as_str()).unwrap_or(0);
        for Row { class, group, hits, n } in &self.rows {
            let (low, high) = wilson(*hits, *n);
            let [share, low, high] = [*hits as f64 / *n as f64, low, high].map(|x| 100.0 * x);
            writeln!(
                f,
                "{class:class_width$}  {group:group_width$}  {hits:5} of {n:5}  {share:5.1} %  \
                 ({low:.1} to {high:.1})"
            )?;
        }
        Ok(())
    }
}

/// How many of `objects` are hits, and how many there are; a track counts once if
/// `tracks`.
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

/// The place and the name of the bin of `value` between `edges`, the last of which is
/// open.
fn bin(value: f64, edges: &[usize], unit: &str) -> (usize, String) {
    let next = edges.partition_point(|&edge| edge as f64 <= value);
    let low = edges[next - 1];
    let name = match edges.get(next) {
        Some(high) => format!("{low} to {high} {unit}"),
        None => format!("{low} {unit} or more"),
    };
    (next, name)
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
        let row = table.rows.iter().find(|row| row.class == class && row.group == group);
        row.map(|row| (row.hits, row.n))
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

    #[test]
    fn bins_are_closed_below_and_the_last_is_open() {
        assert_eq!(bin(0.0, &RANGES, "m").1, "0 to 5 m");
        assert_eq!(bin(5.0, &RANGES, "m").1, "5 to 10 m");
        assert_eq!(bin(1e9, &RANGES, "m").1, "40 m or more");
    }
}
