//! What a plain scene pays for effects that it does not ask for: its rays are
//! cast by this program, and by a build of the same sources from which the
//! effects' code was deleted, in turns.

mod pairs;
#[path = "../../../peers/plain/src/turn.rs"]
mod turn;
mod twin;

use super::table::{Table, digits};
use crate::workspace;
use anyhow::{Context, Result, bail};
use pairs::Interval;
use serde::Serialize;
use std::path::{Path, PathBuf};
use turn::{Plain, fingerprint};
use twin::Twin;

/// Flags of `bench plain`.
#[derive(clap::Args, Debug)]
pub struct PlainArgs {
    /// The mesh [default: a chair of assets/meshes]
    mesh: Option<PathBuf>,
    /// Rounds of one turn each
    #[arg(long, default_value_t = 101, value_parser = clap::value_parser!(u16).range(6..))]
    rounds: u16,
    /// Write everything measured to this file
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// CPU seconds of each turn, by round.
#[derive(Default, Serialize)]
struct Turns {
    rays: usize,
    product: Vec<f64>,
    /// This program once more in each round: how much chance does.
    product_again: Vec<f64>,
    twin: Vec<f64>,
}

/// Builds the twin, lets both take turns and prints how they compare.
///
/// # Errors
/// If the twin cannot be built, or scans otherwise than this program.
pub fn run(args: &PlainArgs) -> Result<()> {
    let (plain, mut twin) = both(&args.mesh.clone().unwrap_or_else(chair))?;
    let turns = take_turns(&plain, &mut twin, args.rounds.into())?;
    print!("{}", table(&turns));
    println!("{}", verdict(Interval::of_ratios(&turns.both(), &turns.twin)));
    if let Some(file) = &args.json {
        let text = serde_json::to_string_pretty(&turns)?;
        std::fs::write(file, text + "\n").with_context(|| format!("writing {}", file.display()))?;
    }
    Ok(())
}

fn chair() -> PathBuf {
    workspace::root().join("assets/meshes/chair/chair_0046.obj")
}

/// This program's scan of `mesh` and the twin's, which must be the same.
fn both(mesh: &Path) -> Result<(Plain, Twin)> {
    let plain = Plain::new(mesh)?;
    let twin = Twin::start(&twin::build()?, mesh)?;
    if twin.fingerprint != fingerprint(&plain.scan()) {
        bail!("without the effects' code the scan is another: there is nothing to compare");
    }
    Ok((plain, twin))
}

impl Turns {
    /// The mean of this program's turns of each round. They stand on either
    /// side of the twin's, so that a machine that slows down or speeds up
    /// evenly has no say.
    fn both(&self) -> Vec<f64> {
        let pairs = self.product.iter().zip(&self.product_again);
        pairs.map(|(first, again)| 0.5 * (first + again)).collect()
    }
}

/// One uncounted round, then `rounds`; each second one in the other order.
fn take_turns(plain: &Plain, twin: &mut Twin, rounds: usize) -> Result<Turns> {
    let mut turns = Turns { rays: plain.rays(), ..Turns::default() };
    for round in 0..=rounds {
        let (product, twins, again);
        if round % 2 == 0 {
            product = plain.turn();
            twins = twin.turn()?;
            again = plain.turn();
        } else {
            again = plain.turn();
            twins = twin.turn()?;
            product = plain.turn();
        }
        if round > 0 {
            turns.product.push(product);
            turns.twin.push(twins);
            turns.product_again.push(again);
        }
    }
    Ok(turns)
}

fn table(turns: &Turns) -> Table {
    let title = format!(
        "A plain scene on the CPU, {} rays a turn, {} rounds: CPU time, and ratios of turns of \
         one round with the 95 % interval of their median",
        turns.rays,
        turns.product.len()
    );
    let mut table = Table::new(title, &["build", "ns/ray", "ratio", "from", "to"]);
    let mut push = |name: &str, seconds: &[f64], ratio: Option<Interval>| {
        let median = pairs::median(seconds.to_vec());
        let mut row = vec![name.to_owned(), digits(median / turns.rays as f64 * 1e9)];
        row.extend(match ratio {
            None => ["1", "", ""].map(str::to_owned),
            Some(Interval { low, median, high }) => [median, low, high].map(|x| format!("{x:.4}")),
        });
        table.push(row);
    };
    let against = |product: &[f64]| Some(Interval::of_ratios(product, &turns.twin));
    push("effects' code deleted", &turns.twin, None);
    let both = turns.both();
    push("this program, mean of two turns", &both, against(&both));
    let chance = Interval::of_ratios(&turns.product, &turns.product_again);
    push("its one turn against its other", &turns.product, Some(chance));
    table
}

fn verdict(Interval { low, median, high }: Interval) -> String {
    let interval = format!("{low:.4} to {high:.4}");
    if low <= 1.0 && 1.0 <= high {
        return format!("Equal within noise: 1 lies in {interval}.");
    }
    let percent = 100.0 * (median - 1.0);
    if high < 1.0 {
        return format!("Nothing is paid: this program takes {percent:+.2} % ({interval}).");
    }
    format!("Effects are paid for: this program takes {percent:+.2} % ({interval}).")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_without_the_effects_builds_and_scans_the_same() {
        let (_, mut twin) = both(&chair()).unwrap();
        assert!(twin.turn().unwrap() > 0.0);
    }
}
