//! The echoes of one beam, merged where the receiver cannot resolve them, and the returns that
//! the sensor reports of them.

use super::object_hits::HitId;
use crate::effects::ReturnMode;
use crate::weather::Medium;

/// Light that returns from one distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Echo {
    /// Its distance, metres: the mean of its surfaces, weighted by power.
    pub range_m: f64,
    /// Its strength; all 0 unless an effect or attribute needs it.
    pub signal: Signal,
    /// The source of most of its light.
    pub source: Source,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// A surface.
    Surface(HitId),
    /// The air along a ray; `draw` counts the echoes of the air along its beam.
    Air { ray: u32, medium: Medium, draw: u32 },
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Signal {
    /// Relative to the power of a white surface that faces the sensor at 1 m.
    pub power: f64,
    /// Relative to a white surface that faces the sensor and fills the beam.
    pub brightness: f64,
    /// That of the surface that returns most of the light.
    pub retroreflection: f64,
}

impl Source {
    /// Whether both are the same object or the same medium.
    fn is_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Surface(a), Self::Surface(b)) => a.object == b.object,
            (Self::Air { medium: a, .. }, Self::Air { medium: b, .. }) => a == b,
            _ => false,
        }
    }
}

impl Echo {
    /// Merges `parts`, which are sorted by range. The source is the strongest part of the object
    /// or medium that returns most of the light.
    fn merged(parts: &[Self]) -> Self {
        let mut merged = parts[0];
        parts[1..].iter().for_each(|farther| merged.add(farther));
        let power_of = |source: &Source| -> f64 {
            let same = parts.iter().filter(|part| part.source.is_same(source));
            same.map(|part| part.signal.power).sum()
        };
        let weight = |part: &Self| (power_of(&part.source), part.signal.power);
        let mut most = weight(&parts[0]);
        for part in &parts[1..] {
            // Strictly more: the nearest of equals wins.
            if weight(part) > most {
                most = weight(part);
                (merged.source, merged.signal.retroreflection) =
                    (part.source, part.signal.retroreflection);
            }
        }
        merged
    }

    fn add(&mut self, farther: &Self) {
        let power = self.signal.power + farther.signal.power;
        let share = farther.signal.power / power;
        // Not finite for two black surfaces, and for one at range 0, whose power is infinite.
        if share.is_finite() {
            self.range_m += (farther.range_m - self.range_m) * share;
        }
        self.signal.power = power;
        self.signal.brightness += farther.signal.brightness;
    }
}

/// Sorts echoes by range, and merges each with the next if they lie less than `separation_m` apart.
///
/// A receding slope is thus one echo however long it is: its pulse has no gap.
pub(super) fn merge(echoes: &mut Vec<Echo>, separation_m: f64) {
    echoes.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
    let (mut count, mut first) = (0, 0);
    for i in 0..echoes.len() {
        let goes_on =
            echoes.get(i + 1).is_some_and(|next| next.range_m - echoes[i].range_m < separation_m);
        if !goes_on {
            echoes[count] = if first == i { echoes[i] } else { Echo::merged(&echoes[first..=i]) };
            (count, first) = (count + 1, i + 1);
        }
    }
    echoes.truncate(count);
}

/// The indices of the one or two `echoes` that a sensor reports in this mode, ascending. There
/// is at least one echo, and they are sorted by range.
pub(super) fn select_returns(echoes: &[Echo], mode: ReturnMode) -> (usize, Option<usize>) {
    let last = echoes.len() - 1;
    let strongest = strongest_but(echoes, None).unwrap_or(last);
    let second = || strongest_but(echoes, Some(strongest)).unwrap_or(strongest);
    match mode {
        ReturnMode::Strongest => (strongest, None),
        ReturnMode::SecondStrongest => (second(), None),
        ReturnMode::First => (0, None),
        ReturnMode::Last => (last, None),
        ReturnMode::Dual if last == 0 => (0, None),
        ReturnMode::Dual if strongest == last => (second(), Some(last)),
        ReturnMode::Dual => (strongest, Some(last)),
    }
}

/// The strongest of `echoes`, except for one; the nearest of equals.
fn strongest_but(echoes: &[Echo], excluded: Option<usize>) -> Option<usize> {
    let power = |i: usize| echoes[i].signal.power;
    let all = (0..echoes.len()).filter(|&i| Some(i) != excluded);
    all.reduce(|best, i| if power(i) > power(best) { i } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn echoes(of: &[(f64, f64)]) -> Vec<Echo> {
        let echo = |(hit, &(range_m, power)): (u32, &(f64, f64))| {
            let signal = Signal { power, brightness: power, retroreflection: 0.0 };
            Echo { range_m, signal, source: Source::Surface(HitId { object: 0, hit }) }
        };
        (0..).zip(of).map(echo).collect()
    }

    fn hit(echo: &Echo) -> u32 {
        let Source::Surface(id) = echo.source else { panic!("expected a surface") };
        id.hit
    }

    fn merged(of: &[(f64, f64)], separation_m: f64) -> Vec<Echo> {
        let mut echoes = echoes(of);
        merge(&mut echoes, separation_m);
        echoes
    }

    #[test]
    fn echoes_that_lie_apart_stay_as_they_are() {
        let kept = merged(&[(11.0, 1.0), (10.0, 3.0)], 1.0);
        assert_eq!(
            kept.iter().map(|e| (e.range_m, hit(e))).collect::<Vec<_>>(),
            [(10.0, 1), (11.0, 0)]
        );
    }

    #[test]
    fn echoes_that_lie_together_are_one_at_their_mean_and_of_the_strongest() {
        let [one] = merged(&[(10.0, 1.0), (10.8, 3.0)], 1.0)[..] else { panic!("expected one") };
        assert!((one.range_m - 10.6).abs() < 1e-14);
        assert_eq!((hit(&one), one.signal.power, one.signal.brightness), (1, 4.0, 4.0));
        let slope: Vec<_> = (0..30).map(|i| (10.0 + 0.5 * f64::from(i), 1.0)).collect();
        assert_eq!(merged(&slope, 1.0).len(), 1);
    }

    #[test]
    fn echoes_without_power_or_without_bound_stay_finite_in_range() {
        for powers in [[0.0; 2], [f64::INFINITY; 2], [f64::INFINITY, 1.0]] {
            let one = merged(&[(2.0, powers[0]), (2.5, powers[1])], 1.0);
            assert_eq!((one.len(), one[0].range_m), (1, 2.0), "{powers:?}");
        }
    }

    #[test]
    fn an_echo_is_of_what_most_of_its_light_comes_from() {
        // Fog returns one echo of all of a beam, and the wall behind it 19 weaker ones.
        let medium = Medium::Fog;
        let mut echoes = echoes(&[(5.0, 5.8e-4); 19]);
        let signal = Signal { power: 1.65e-3, brightness: 0.0, retroreflection: 0.0 };
        let source = Source::Air { ray: 0, medium, draw: 0 };
        echoes.push(Echo { range_m: 4.65, signal, source });
        let mut thick = echoes.clone();
        thick[19].signal.power = 1.2e-2;
        merge(&mut echoes, 1.0);
        assert_eq!((echoes.len(), hit(&echoes[0])), (1, 0));
        merge(&mut thick, 1.0);
        assert_eq!(thick[0].source, source);
    }

    #[test]
    fn a_separation_of_zero_keeps_all_echoes() {
        assert_eq!(merged(&[(2.0, 1.0), (2.0, 1.0), (2.5, 1.0)], 0.0).len(), 3);
    }

    #[test]
    fn each_mode_selects_its_returns() {
        use ReturnMode::{Dual, First, Last, SecondStrongest, Strongest};
        let middle = echoes(&[(1.0, 2.0), (2.0, 3.0), (3.0, 1.0)]);
        let at_end = echoes(&[(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]);
        let equal = echoes(&[(1.0, 1.0), (2.0, 1.0)]);
        let one = echoes(&[(1.0, 1.0)]);
        for (mode, expected) in [
            (Strongest, [(1, None), (2, None), (0, None), (0, None)]),
            (SecondStrongest, [(0, None), (1, None), (1, None), (0, None)]),
            (First, [(0, None), (0, None), (0, None), (0, None)]),
            (Last, [(2, None), (2, None), (1, None), (0, None)]),
            (Dual, [(1, Some(2)), (1, Some(2)), (0, Some(1)), (0, None)]),
        ] {
            let found = [&middle, &at_end, &equal, &one].map(|echoes| select_returns(echoes, mode));
            assert_eq!(found, expected, "{mode}");
        }
    }
}
