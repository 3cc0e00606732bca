//! Weighted F1, and how sure it is.

use formats::rng::StreamKey;

/// An object's class, and the class that it was given.
pub type Answer = (usize, usize);

/// F1 of `class`, and how many objects it has.
pub fn f1(answers: &[Answer], class: usize) -> (f64, usize) {
    let count = |is: &dyn Fn(&Answer) -> bool| answers.iter().filter(|answer| is(answer)).count();
    let right = count(&|answer| *answer == (class, class));
    let (support, given) = (count(&|answer| answer.0 == class), count(&|answer| answer.1 == class));
    (2.0 * right as f64 / (support + given).max(1) as f64, support)
}

/// The mean of F1 over classes, each weighted by its objects.
pub fn weighted_f1(answers: &[Answer]) -> f64 {
    let most = answers.iter().map(|answer| answer.0).max().unwrap_or(0);
    let weighted = (0..=most).map(|class| f1(answers, class));
    weighted.map(|(f1, n)| f1 * n as f64).sum::<f64>() / answers.len().max(1) as f64
}

/// The mean over folds of the mean over seeds of the weighted F1: `[seed][fold]`.
pub fn mean(answers: &[Vec<Vec<Answer>>]) -> f64 {
    let all: Vec<f64> = answers.iter().flatten().map(|answers| weighted_f1(answers)).collect();
    all.iter().sum::<f64>() / all.len().max(1) as f64
}

/// How often objects are drawn anew for an interval.
const DRAWS: u32 = 1000;

/// The 95 % interval of `statistic` over objects that are drawn anew from each fold, the
/// same ones for all networks (Efron's bootstrap, percentiles).
pub fn interval<const N: usize>(
    networks: [&[Vec<Vec<Answer>>]; N],
    statistic: impl Fn([f64; N]) -> f64,
) -> [f64; 2] {
    let draw = |number| {
        statistic(networks.map(|answers| {
            let seeds = answers.iter().map(|folds| {
                let drawn = folds.iter().enumerate().map(|(fold, answers)| {
                    let key = StreamKey::new(0, &format!("fold {fold}"), number);
                    let n = answers.len() as u64;
                    (0..n).map(|i| answers[key.below(n, i) as usize]).collect()
                });
                drawn.collect()
            });
            mean(&seeds.collect::<Vec<Vec<Vec<Answer>>>>())
        }))
    };
    let mut found: Vec<f64> = (0..DRAWS).map(draw).collect();
    found.sort_by(f64::total_cmp);
    [0.025, 0.975].map(|share| found[(share * f64::from(DRAWS)) as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Class 0: precision 2/3, recall 2/2, F1 4/5; class 1: 1/1, 1/2, 2/3.
    #[test]
    fn f1_is_weighted_by_the_objects_of_a_class() {
        let answers = [(0, 0), (0, 0), (1, 0), (1, 1)];
        let (found, n) = f1(&answers, 1);
        assert_eq!(n, 2);
        assert!((found - 2.0 / 3.0).abs() < 1e-12);
        let expected = (2.0 * 0.8 + 2.0 * 2.0 / 3.0) / 4.0;
        assert!((weighted_f1(&answers) - expected).abs() < 1e-12);
        assert_eq!(f1(&answers, 2), (0.0, 0));
        let [low, high] = interval([&[vec![answers.to_vec()]]], |[mean]| mean);
        assert!(low < expected && high > expected && high <= 1.0, "{low} {high}");
    }
}
