//! Tables of engines by jobs, with the ratios of speeds.

use super::candidate::{Arithmetic, Job};
use super::comparison::Entry;
use crate::measure::clock::Costs;
use crate::table::{Table, digits, milliseconds};

/// A measure of an entry: its name, and seconds.
type Figure = (&'static str, fn(&Costs) -> f64);

const FIGURES: [Figure; 3] = [
    ("median of the wall clock", |costs| costs.wall_s().median),
    ("least of the wall clock", |costs| costs.wall_s().min),
    ("median of CPU time, all threads", |costs| costs.cpu_s().median),
];

/// Prints all tables of those of `entries` that did one of `jobs`, each of which has a column
/// under its `heading`.
pub fn show(title: &str, entries: &[Entry], jobs: &[Job], heading: fn(&Job) -> String) {
    let tables = FIGURES.map(|figure| tables(title, entries, (jobs, heading), figure));
    let [times, ratios] = [0, 1].map(|i| tables.iter().map(move |tables| &tables[i]));
    times.chain(ratios.filter(|table| !table.rows.is_empty())).for_each(|table| print!("{table}"));
}

/// Milliseconds of every engine, with a star at the fastest rival of each arithmetic; and the
/// speed of each engine of ours over that of the fastest rival in f32 and in its own arithmetic.
fn tables(
    title: &str,
    entries: &[Entry],
    (jobs, heading): (&[Job], fn(&Job) -> String),
    (words, seconds): Figure,
) -> [Table; 2] {
    let fastest_rival = |job: Job, arithmetic: Arithmetic| {
        let is_rival = |entry: &&Entry| {
            !entry.engine.ours && entry.job == job && entry.engine.arithmetic == arithmetic
        };
        let rivals = entries.iter().filter(is_rival);
        rivals.min_by(|a, b| seconds(&a.costs).total_cmp(&seconds(&b.costs)))
    };
    let mut times = Table::new(
        format!("{title}: ms, {words}; * the fastest rival"),
        &["engine", "arithmetic", "error"],
    );
    let mut ratios = Table::new(
        format!("{title}: ours, times as fast, {words}"),
        &["engine", "as the fastest rival in"],
    );
    for table in [&mut times, &mut ratios] {
        table.heading.extend(jobs.iter().map(heading));
    }
    let row = |first: Vec<String>, cell: &dyn Fn(Job, &Entry) -> Option<String>, of: &[&Entry]| {
        let cells = jobs.iter().map(|&job| {
            let entry = of.iter().find(|entry| entry.job == job);
            entry.and_then(|entry| cell(job, entry)).unwrap_or_else(|| "-".to_owned())
        });
        first.into_iter().chain(cells).collect::<Vec<_>>()
    };
    for engine in engines(entries, jobs) {
        let own = &engine[0].engine;
        let error = engine.iter().map(|entry| entry.error).fold(0.0, f64::max);
        let time = |job: Job, entry: &Entry| {
            let best = fastest_rival(job, own.arithmetic);
            let is_best = best.is_some_and(|best| best.engine.name == own.name);
            Some(milliseconds(seconds(&entry.costs)) + if is_best { "*" } else { "" })
        };
        let first = [own.name.clone(), word(own.arithmetic), format!("{error:.0e}")];
        times.push(row(first.into(), &time, &engine));
        let reduced = (own.arithmetic != Arithmetic::F32).then_some(own.arithmetic);
        for arithmetic in std::iter::once(Arithmetic::F32).chain(reduced).filter(|_| own.ours) {
            let ratio = |job: Job, entry: &Entry| {
                let rival = fastest_rival(job, arithmetic)?;
                Some(digits(seconds(&rival.costs) / seconds(&entry.costs)))
            };
            ratios.push(row(vec![own.name.clone(), word(arithmetic)], &ratio, &engine));
        }
    }
    [times, ratios]
}

/// The entries of each engine that did one of the jobs.
fn engines<'a>(entries: &'a [Entry], jobs: &[Job]) -> Vec<Vec<&'a Entry>> {
    let mut engines: Vec<Vec<&Entry>> = Vec::new();
    for entry in entries.iter().filter(|entry| jobs.contains(&entry.job)) {
        match engines.iter_mut().find(|engine| engine[0].engine.name == entry.engine.name) {
            Some(engine) => engine.push(entry),
            None => engines.push(vec![entry]),
        }
    }
    engines.sort_by_key(|engine| engine[0].engine.arithmetic);
    engines
}

fn word(arithmetic: Arithmetic) -> String {
    format!("{arithmetic:?}").to_lowercase()
}

#[cfg(test)]
mod tests {
    use super::super::candidate::Label;
    use super::*;
    use crate::measure::clock::Cost;

    fn entry(engine: &str, arithmetic: Arithmetic, points: usize, wall_ms: &[f64]) -> Entry {
        let cost = |ms: &f64| Cost { wall_s: ms * 1e-3, cpu_s: 2e-3 * ms };
        let (name, ours) = (engine.to_owned(), engine.starts_with("ours"));
        Entry {
            engine: Label { name, arithmetic, ours },
            job: Job { points, setting: 1 },
            error: 2e-7,
            costs: Costs(wall_ms.iter().map(cost).collect()),
        }
    }

    #[test]
    fn the_fastest_rival_has_a_star_and_ours_are_compared_with_it() {
        let entries = [
            entry("ours-i8", Arithmetic::I8, 16, &[1.0]),
            entry("a-i8", Arithmetic::I8, 16, &[0.5]),
            entry("a", Arithmetic::F32, 16, &[4.0, 4.0, 1.0]),
            entry("b", Arithmetic::F32, 16, &[2.0, 3.0, 3.0]),
            entry("b", Arithmetic::F32, 64, &[2.0]),
        ];
        let jobs = [16, 64].map(|points| Job { points, setting: 1 });
        let shown = |figure| {
            let heading: fn(&Job) -> String = |job| job.points.to_string();
            tables("", &entries, (&jobs, heading), FIGURES[figure]).map(|table| {
                let csv = String::from_utf8(table.to_csv().unwrap()).unwrap();
                csv.lines().skip(1).map(str::to_owned).collect::<Vec<_>>()
            })
        };
        let [times, ratios] = shown(0);
        let expected =
            ["a,f32,2e-7,4,-", "b,f32,2e-7,3*,2*", "ours-i8,i8,2e-7,1,-", "a-i8,i8,2e-7,0.5*,-"];
        assert_eq!(times, expected);
        assert_eq!(ratios, ["ours-i8,f32,3,-", "ours-i8,i8,0.5,-"]);
        assert_eq!(shown(1)[0][..2], ["a,f32,2e-7,1*,-", "b,f32,2e-7,2,2*"]);
        assert_eq!(shown(2)[0][1], "b,f32,2e-7,6*,4*");
    }
}
