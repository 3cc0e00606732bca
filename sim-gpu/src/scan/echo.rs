//! What comes back of one beam: the echoes of the surfaces that its rays meet, those that the
//! receiver cannot tell apart as one, and the returns that the sensor tells of them.

use crate::effects::ReturnMode;
use crate::weather::Medium;

/// Light that comes back from one distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Echo {
    /// Where it comes from, metres: the mean of its surfaces, weighed by power.
    pub range_m: f64,
    /// How strong it is, where anything asks for it.
    pub signal: Signal,
    /// What most of it comes from.
    pub source: Source,
}

/// What an echo comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// A surface: the object, and the hit of it, as places in lists.
    Surface { object: u32, hit: u32 },
    /// The air along a ray: which of the beam's returns from the air.
    Air { ray: u32, medium: Medium, draw: u32 },
}

/// How strong an echo is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Signal {
    /// Relative to what a white surface returns that faces the sensor 1 m away.
    pub power: f64,
    /// Relative to a white surface that faces the sensor and is as wide as the beam.
    pub brightness: f64,
    /// Of the surface that most of it comes from.
    pub retroreflection: f64,
}

impl Source {
    /// Whether both are of one object, or of one medium.
    fn is_of_the_same(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Surface { object: a, .. }, Self::Surface { object: b, .. }) => a == b,
            (Self::Air { medium: a, .. }, Self::Air { medium: b, .. }) => a == b,
            _ => false,
        }
    }
}

impl Echo {
    /// These parts, in the order of their ranges, as one. It is told to be of the object or
    /// medium that most of its light comes from, and there of the strongest part.
    fn of(parts: &[Self]) -> Self {
        let mut one = parts[0];
        parts[1..].iter().for_each(|farther| one.join(farther));
        let power_of = |source: &Source| -> f64 {
            let same = parts.iter().filter(|part| part.source.is_of_the_same(source));
            same.map(|part| part.signal.power).sum()
        };
        let weight = |part: &Self| (power_of(&part.source), part.signal.power);
        let mut most = weight(&parts[0]);
        for part in &parts[1..] {
            // Of equals the nearest.
            let found = weight(part);
            if found > most {
                most = found;
                (one.source, one.signal.retroreflection) =
                    (part.source, part.signal.retroreflection);
            }
        }
        one
    }

    /// Adds what comes back from farther away.
    fn join(&mut self, farther: &Self) {
        let power = self.signal.power + farther.signal.power;
        let share = farther.signal.power / power;
        // Black surfaces have no power to weigh by; one that the sensor touches has all of it.
        if share.is_finite() {
            self.range_m += (farther.range_m - self.range_m) * share;
        }
        self.signal.power = power;
        self.signal.brightness += farther.signal.brightness;
    }
}

/// Makes one echo of those that lie nearer than `separation_m` behind one another, and puts
/// them in the order of their ranges.
///
/// A slope that leads away is one echo however long it is: its pulse has no gap in it.
pub(super) fn merge(echoes: &mut Vec<Echo>, separation_m: f64) {
    echoes.sort_by(|a, b| a.range_m.total_cmp(&b.range_m));
    let (mut count, mut first) = (0, 0);
    for i in 0..echoes.len() {
        let goes_on =
            echoes.get(i + 1).is_some_and(|next| next.range_m - echoes[i].range_m < separation_m);
        if !goes_on {
            echoes[count] = if first == i { echoes[i] } else { Echo::of(&echoes[first..=i]) };
            (count, first) = (count + 1, i + 1);
        }
    }
    echoes.truncate(count);
}

/// Which of `echoes`, at least one, in the order of their ranges, a sensor tells in this mode:
/// one or two, in the same order.
pub(super) fn told(echoes: &[Echo], mode: ReturnMode) -> (usize, Option<usize>) {
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

/// The strongest of `echoes` besides this one; of equals the nearest.
fn strongest_but(echoes: &[Echo], other: Option<usize>) -> Option<usize> {
    let power = |i: usize| echoes[i].signal.power;
    let all = (0..echoes.len()).filter(|&i| Some(i) != other);
    all.reduce(|best, i| if power(i) > power(best) { i } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn echoes(of: &[(f64, f64)]) -> Vec<Echo> {
        let echo = |(hit, &(range_m, power)): (u32, &(f64, f64))| {
            let signal = Signal { power, brightness: power, retroreflection: 0.0 };
            Echo { range_m, signal, source: Source::Surface { object: 0, hit } }
        };
        (0..).zip(of).map(echo).collect()
    }

    fn hit(echo: &Echo) -> u32 {
        let Source::Surface { hit, .. } = echo.source else { panic!("expected a surface") };
        hit
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
        // Fog takes all of a beam, and a wall behind it 19 rays of it, each of which is weaker.
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
    fn each_mode_tells_its_returns() {
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
            let found = [&middle, &at_end, &equal, &one].map(|echoes| told(echoes, mode));
            assert_eq!(found, expected, "{mode}");
        }
    }
}
