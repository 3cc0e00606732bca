//! The part of a dataset that a task of a job array makes.

use std::ops::Range;
use std::str::FromStr;

/// The environment variables that hold the number of a task: of Slurm, of Kubernetes' Indexed Jobs
/// and of HyperQueue.
const NUMBERS: [&str; 3] = ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX", "HQ_TASK_ID"];

/// Part `number` (from 0) of `of` parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    pub number: u32,
    pub of: u32,
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::parse(text, |name| std::env::var(name).ok())
    }
}

impl Shard {
    /// This part of `count` things in order.
    pub fn part_of(&self, count: u32) -> Range<u32> {
        let [start, end] = [self.number, self.number + 1]
            .map(|n| (u64::from(count) * u64::from(n) / u64::from(self.of)) as u32);
        start..end
    }

    /// The part that `text` names. `variable` looks up an environment variable.
    fn parse(text: &str, variable: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        match text.split_once('/') {
            Some(("auto", of)) => {
                let of = of.parse().ok().filter(|of| *of > 0);
                let of = of.ok_or("expected auto/N with a whole N of at least 1")?;
                Self::of_array(of, variable)
            }
            Some((number, of)) => match (number.parse::<u32>(), of.parse::<u32>()) {
                (Ok(number), Ok(of)) if 1 <= number && number <= of => {
                    Ok(Self { number: number - 1, of })
                }
                _ => Err("expected I/N with whole I from 1 to N".to_owned()),
            },
            None => Err("expected I/N, such as 1/4, or auto/N".to_owned()),
        }
    }

    /// The part of this task of an array of `of` tasks.
    fn of_array(of: u32, variable: impl Fn(&str) -> Option<String>) -> Result<Self, String> {
        let found = NUMBERS.iter().find_map(|name| Some((name, variable(name)?)));
        let (name, number) = found.ok_or_else(|| {
            format!(
                "auto: expected one of the variables {}, found none; outside a job array, give the \
                 part, such as 1/{of}",
                NUMBERS.join(", ")
            )
        })?;
        match number.parse() {
            Ok(number) if number < of => Ok(Self { number, of }),
            _ => Err(format!("auto: expected {name} from 0 to {}, found {number}", of - 1)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str, variables: &[(&str, &str)]) -> Result<(u32, u32), String> {
        let variable = |name: &str| {
            variables.iter().find(|(known, _)| *known == name).map(|(_, value)| (*value).to_owned())
        };
        Shard::parse(text, variable).map(|Shard { number, of }| (number, of))
    }

    #[test]
    fn the_part_comes_from_the_variables_of_each_scheduler() {
        assert_eq!(parsed("2/4", &[]), Ok((1, 4)));
        for name in NUMBERS {
            assert_eq!(parsed("auto/8", &[(name, "7")]), Ok((7, 8)), "{name}");
            assert!(parsed("auto/8", &[(name, "8")]).unwrap_err().contains("from 0 to 7"));
        }
    }

    #[test]
    fn parts_are_all_once() {
        for (count, of) in [(1, 1), (7, 3), (10_000_000, u32::MAX), (u32::MAX, 7)] {
            let part = |number| Shard { number, of }.part_of(count);
            assert_eq!((part(0).start, part(of - 1).end), (0, count));
            (1..of.min(100)).for_each(|n| assert_eq!(part(n - 1).end, part(n).start));
        }
    }
}
