//! Tables of engines by jobs, and who is how many times as fast.

use super::candidate::{Arithmetic, Job};
use super::comparison::Entry;
use crate::measure::clock::Costs;
use crate::render::table::{Table, digits, milliseconds};

/// What a table shows of an entry, in words and in seconds.
type Figure = (&'static str, fn(&Costs) -> f64);

/// What a user waits, what a user of an idle machine would wait, and what the work costs
/// whatever the neighbours do.
const FIGURES: [Figure; 3] = [
    ("median of the wall clock", |costs| costs.wall_s().median),
    ("least of the wall clock", |costs| costs.wall_s().min),
    ("median of CPU time, all threads", |costs| costs.cpu_s().median),
];

/// Prints all tables of those of `entries` that did one of `jobs`, each of which has a
/// column under its `heading`.
pub fn show(title: &str, entries: &[Entry], jobs: &[Job], heading: fn(&Job) -> String) {
    let tables = SpeedTables { title, entries, jobs, heading };
    for figure in FIGURES {
        print!("{}", tables.milliseconds(figure));
    }
    for table in FIGURES.into_iter().filter_map(|figure| tables.ratios(figure)) {
        print!("{table}");
    }
}

struct SpeedTables<'a> {
    title: &'a str,
    entries: &'a [Entry],
    jobs: &'a [Job],
    heading: fn(&Job) -> String,
}

impl<'a> SpeedTables<'a> {
    /// Milliseconds of every engine; a star marks the fastest rival of each
    /// arithmetic.
    fn milliseconds(&self, figure: Figure) -> Table {
        let (words, seconds) = figure;
        let title = format!("{}: ms, {words}; * the fastest rival", self.title);
        let mut table = self.table(title, &["engine", "arithmetic", "error"]);
        for engine in self.engines() {
            let error = engine.iter().map(|entry| entry.error).fold(0.0, f64::max);
            let own = &engine[0].engine;
            let first = [own.name.clone(), word(own.arithmetic), format!("{error:.0e}")];
            let cell = |&job: &Job| {
                let entry = engine.iter().find(|entry| entry.job == job)?;
                let best = self.fastest_rival(job, own.arithmetic, figure);
                let star =
                    if best.is_some_and(|best| best.engine.name == own.name) { "*" } else { "" };
                Some(milliseconds(seconds(&entry.costs)) + star)
            };
            table.push(self.row(first.into(), cell));
        }
        table
    }

    /// How many times as fast each engine of ours is as the fastest rival in
    /// f32, and as the fastest in its own arithmetic; `None` if none is ours.
    fn ratios(&self, figure: Figure) -> Option<Table> {
        let (words, seconds) = figure;
        let title = format!("{}: ours, times as fast, {words}", self.title);
        let mut table = self.table(title, &["engine", "as the fastest rival in"]);
        for engine in self.engines().into_iter().filter(|engine| engine[0].engine.ours) {
            let own = &engine[0].engine;
            let reduced = (own.arithmetic != Arithmetic::F32).then_some(own.arithmetic);
            for arithmetic in std::iter::once(Arithmetic::F32).chain(reduced) {
                let ratio = |&job: &Job| {
                    let ours = engine.iter().find(|entry| entry.job == job)?;
                    let rival = self.fastest_rival(job, arithmetic, figure)?;
                    Some(digits(seconds(&rival.costs) / seconds(&ours.costs)))
                };
                table.push(self.row(vec![own.name.clone(), word(arithmetic)], ratio));
            }
        }
        (table.len() > 0).then_some(table)
    }

    /// A table of these columns and one for each job.
    fn table(&self, title: String, first: &[&str]) -> Table {
        let jobs: Vec<String> = self.jobs.iter().map(self.heading).collect();
        let heading: Vec<&str> =
            first.iter().copied().chain(jobs.iter().map(String::as_str)).collect();
        Table::new(title, &heading)
    }

    /// A row that begins with `first` and says of each job what `cell` does.
    fn row(&self, first: Vec<String>, cell: impl Fn(&Job) -> Option<String>) -> Vec<String> {
        let cells = self.jobs.iter().map(|job| cell(job).unwrap_or_else(|| "-".to_owned()));
        first.into_iter().chain(cells).collect()
    }

    fn fastest_rival(
        &self,
        job: Job,
        arithmetic: Arithmetic,
        (_, seconds): Figure,
    ) -> Option<&'a Entry> {
        let is_rival = |entry: &&Entry| {
            !entry.engine.ours && entry.job == job && entry.engine.arithmetic == arithmetic
        };
        let rivals = self.entries.iter().filter(is_rival);
        rivals.min_by(|a, b| seconds(&a.costs).total_cmp(&seconds(&b.costs)))
    }

    /// The entries of each engine that did one of the jobs.
    fn engines(&self) -> Vec<Vec<&'a Entry>> {
        let mut engines: Vec<Vec<&Entry>> = Vec::new();
        for entry in self.entries.iter().filter(|entry| self.jobs.contains(&entry.job)) {
            match engines.iter_mut().find(|engine| engine[0].engine.name == entry.engine.name) {
                Some(engine) => engine.push(entry),
                None => engines.push(vec![entry]),
            }
        }
        engines.sort_by_key(|engine| engine[0].engine.arithmetic);
        engines
    }
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

    fn rows(table: &Table) -> Vec<String> {
        let text = table.to_string();
        let words = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
        text.lines().skip(3).map(words).collect()
    }

    const JOBS: [Job; 2] = [Job { points: 16, setting: 1 }, Job { points: 64, setting: 1 }];

    fn tables(entries: &[Entry]) -> SpeedTables<'_> {
        SpeedTables { title: "Speed", entries, jobs: &JOBS, heading: |job| job.points.to_string() }
    }

    #[test]
    fn the_fastest_rival_of_each_arithmetic_has_a_star_by_the_figure_shown() {
        let entries = [
            entry("a-i8", Arithmetic::I8, 16, &[1.0]),
            entry("a", Arithmetic::F32, 16, &[4.0, 4.0, 1.0]),
            entry("b", Arithmetic::F32, 16, &[2.0, 3.0, 3.0]),
            entry("b", Arithmetic::F32, 64, &[2.0]),
        ];
        let shown = |figure| rows(&tables(&entries).milliseconds(FIGURES[figure]));
        assert_eq!(shown(0), ["a f32 2e-7 4 -", "b f32 2e-7 3* 2*", "a-i8 i8 2e-7 1* -"]);
        assert_eq!(shown(1)[..2], ["a f32 2e-7 1* -", "b f32 2e-7 2 2*"]);
        assert_eq!(shown(2)[1], "b f32 2e-7 6* 4*");
    }

    #[test]
    fn ours_are_compared_with_f32_and_with_their_own_arithmetic() {
        let entries = [
            entry("ours-f32", Arithmetic::F32, 16, &[2.0]),
            entry("ours-i8", Arithmetic::I8, 16, &[1.0]),
            entry("ours-i8", Arithmetic::I8, 64, &[1.0]),
            entry("a", Arithmetic::F32, 16, &[3.0]),
            entry("b", Arithmetic::F32, 64, &[8.0]),
            entry("b-i8", Arithmetic::I8, 16, &[0.5]),
        ];
        let table = tables(&entries).ratios(FIGURES[0]).unwrap();
        assert_eq!(rows(&table), ["ours-f32 f32 1.5 -", "ours-i8 f32 3 8", "ours-i8 i8 0.5 -"]);
    }

    #[test]
    fn without_ours_there_are_no_ratios() {
        let entries = [entry("a", Arithmetic::F32, 16, &[1.0])];
        assert!(tables(&entries).ratios(FIGURES[1]).is_none());
    }
}
