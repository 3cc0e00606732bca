//! Tables of engines by jobs, and who is how many times as fast.

use super::candidate::{Arithmetic, Job};
use super::comparison::Entry;
use crate::render::table::{Table, digits, milliseconds};

/// Which of an entry's figures a table shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Figure {
    /// What a user waits.
    WallMedian,
    /// What a user of an idle machine would wait.
    WallLeast,
    /// What the work costs, whatever the neighbours do.
    CpuMedian,
}

impl Figure {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::WallMedian, Self::WallLeast, Self::CpuMedian];

    /// In words.
    pub fn name(self) -> &'static str {
        match self {
            Self::WallMedian => "median of the wall clock",
            Self::WallLeast => "least of the wall clock",
            Self::CpuMedian => "median of CPU time, all threads",
        }
    }

    /// In seconds.
    fn of(self, entry: &Entry) -> f64 {
        match self {
            Self::WallMedian => entry.costs.wall_s().median,
            Self::WallLeast => entry.costs.wall_s().min,
            Self::CpuMedian => entry.costs.cpu_s().median,
        }
    }
}

/// Entries in the order of their engines, and the jobs that make the columns.
pub struct SpeedTables<'a> {
    title: String,
    entries: &'a [Entry],
    jobs: Vec<Job>,
    /// How a job is headed.
    heading: fn(&Job) -> String,
}

impl<'a> SpeedTables<'a> {
    /// Of those of `entries` that did one of `jobs`.
    pub fn new(
        title: String,
        entries: &'a [Entry],
        jobs: Vec<Job>,
        heading: fn(&Job) -> String,
    ) -> Self {
        Self { title, entries, jobs, heading }
    }

    /// Prints all tables.
    pub fn show(&self) {
        for figure in Figure::ALL {
            print!("{}", self.milliseconds(figure));
        }
        for table in Figure::ALL.into_iter().filter_map(|figure| self.ratios(figure)) {
            print!("{table}");
        }
    }

    /// Milliseconds of every engine; a star marks the fastest rival of each
    /// arithmetic.
    pub fn milliseconds(&self, figure: Figure) -> Table {
        let mut table = self.table(
            format!("{}: ms, {}; * the fastest rival", self.title, figure.name()),
            &["engine", "arithmetic", "error"],
        );
        for engine in self.engines() {
            let error = engine.iter().map(|entry| entry.error).fold(0.0, f64::max);
            let Entry { engine: name, arithmetic, .. } = engine[0];
            let mut row = vec![name.clone(), arithmetic.to_string(), format!("{error:.0e}")];
            for &job in &self.jobs {
                row.push(engine.iter().find(|entry| entry.job == job).map_or(
                    "-".into(),
                    |entry| {
                        let best = self.fastest_rival(job, *arithmetic, figure);
                        let star = best.is_some_and(|best| best.engine == *name);
                        milliseconds(figure.of(entry)) + if star { "*" } else { "" }
                    },
                ));
            }
            table.push(row);
        }
        table
    }

    /// How many times as fast each engine of ours is as the fastest rival in
    /// f32, and as the fastest in its own arithmetic; `None` if none is ours.
    pub fn ratios(&self, figure: Figure) -> Option<Table> {
        let mut table = self.table(
            format!("{}: ours, times as fast, {}", self.title, figure.name()),
            &["engine", "as the fastest rival in"],
        );
        let mut any = false;
        for engine in self.engines().into_iter().filter(|engine| engine[0].ours) {
            any = true;
            let own = engine[0].arithmetic;
            let reduced = (own != Arithmetic::F32).then_some(own);
            for arithmetic in std::iter::once(Arithmetic::F32).chain(reduced) {
                let mut row = vec![engine[0].engine.clone(), arithmetic.to_string()];
                for &job in &self.jobs {
                    let ours = engine.iter().find(|entry| entry.job == job);
                    let pair = ours.zip(self.fastest_rival(job, arithmetic, figure));
                    let ratio = pair.map(|(ours, rival)| figure.of(rival) / figure.of(ours));
                    row.push(ratio.map_or("-".into(), digits));
                }
                table.push(row);
            }
        }
        any.then_some(table)
    }

    fn table(&self, title: String, first: &[&str]) -> Table {
        let jobs: Vec<String> = self.jobs.iter().map(self.heading).collect();
        let heading: Vec<&str> =
            first.iter().copied().chain(jobs.iter().map(String::as_str)).collect();
        Table::new(title, &heading)
    }

    fn fastest_rival(&self, job: Job, arithmetic: Arithmetic, figure: Figure) -> Option<&'a Entry> {
        let rivals = self
            .entries
            .iter()
            .filter(|entry| !entry.ours && entry.job == job && entry.arithmetic == arithmetic);
        rivals.min_by(|a, b| figure.of(a).total_cmp(&figure.of(b)))
    }

    /// The entries of each engine that did one of the jobs.
    fn engines(&self) -> Vec<Vec<&'a Entry>> {
        let mut engines: Vec<Vec<&Entry>> = Vec::new();
        for entry in self.entries.iter().filter(|entry| self.jobs.contains(&entry.job)) {
            match engines.iter_mut().find(|engine| engine[0].engine == entry.engine) {
                Some(engine) => engine.push(entry),
                None => engines.push(vec![entry]),
            }
        }
        engines.sort_by_key(|engine| engine[0].arithmetic);
        engines
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::clock::{Cost, Costs};

    fn entry(engine: &str, arithmetic: Arithmetic, points: usize, wall_ms: &[f64]) -> Entry {
        let cost = |ms: &f64| Cost { wall_s: ms * 1e-3, cpu_s: 2e-3 * ms };
        Entry {
            engine: engine.to_owned(),
            arithmetic,
            ours: engine.starts_with("ours"),
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

    fn grid(entries: &[Entry]) -> SpeedTables<'_> {
        let jobs = [16, 64].map(|points| Job { points, setting: 1 });
        SpeedTables::new("Speed".to_owned(), entries, jobs.into(), |job| job.points.to_string())
    }

    #[test]
    fn the_fastest_rival_of_each_arithmetic_has_a_star_by_the_figure_shown() {
        let entries = [
            entry("a-i8", Arithmetic::I8, 16, &[1.0]),
            entry("a", Arithmetic::F32, 16, &[4.0, 4.0, 1.0]),
            entry("b", Arithmetic::F32, 16, &[2.0, 3.0, 3.0]),
            entry("b", Arithmetic::F32, 64, &[2.0]),
        ];
        let shown = |figure| rows(&grid(&entries).milliseconds(figure));
        assert_eq!(
            shown(Figure::WallMedian),
            ["a f32 2e-7 4 -", "b f32 2e-7 3* 2*", "a-i8 i8 2e-7 1* -"]
        );
        assert_eq!(shown(Figure::WallLeast)[..2], ["a f32 2e-7 1* -", "b f32 2e-7 2 2*"]);
        assert_eq!(shown(Figure::CpuMedian)[1], "b f32 2e-7 6* 4*");
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
        let table = grid(&entries).ratios(Figure::WallMedian).unwrap();
        assert_eq!(rows(&table), ["ours-f32 f32 1.5 -", "ours-i8 f32 3 8", "ours-i8 i8 0.5 -"]);
    }

    #[test]
    fn without_ours_there_are_no_ratios() {
        assert!(
            grid(&[entry("a", Arithmetic::F32, 16, &[1.0])]).ratios(Figure::WallLeast).is_none()
        );
    }
}
