//! The classes of clusters, and how much each cluster is worth.

use super::rule::Rule;
use crate::classify::classifier::Classifier;
use crate::classify::prediction::Prediction;
use crate::classify::team::ClassifierTeam;
use crate::error::Error;

/// Classifies clusters, and weighs each by the answer of the network.
pub struct ClusterClassifier {
    team: ClassifierTeam,
    rule: Rule,
}

impl ClusterClassifier {
    /// With as many threads as `classifier` has.
    ///
    /// # Errors
    /// A model of whole objects, which cannot tell clusters apart; threads that cannot be started.
    pub fn new(classifier: Classifier) -> Result<Self, Error> {
        classifier
            .unsuited_to_clusters()
            .map_or(Ok(()), |cause| Err(Error::WholeObjects(cause)))?;
        let rule = Rule::new(&classifier);
        Ok(Self { team: ClassifierTeam::new(classifier)?, rule })
    }

    /// Classifies clusters, given the points of each and the height of the ground under it, and
    /// passes the worth of each and the answer to `each`, in order.
    pub fn classify<'a>(
        &mut self,
        clusters: impl Iterator<Item = (&'a [[f32; 3]], Option<f32>)> + Clone,
        mut each: impl FnMut(f64, Result<&Prediction, &Error>),
    ) {
        let Self { team, rule } = self;
        let mut sizes = clusters.clone().map(|(points, _)| points.len());
        team.classify_many(clusters, |answer| {
            let n_points = sizes.next().unwrap_or(0);
            each(rule.worth(n_points, answer.ok()), answer);
        });
    }

    /// The worth of a cluster of `n_points` that is not classified.
    pub fn worth_of_unknown(&self, n_points: usize) -> f64 {
        self.rule.worth(n_points, None)
    }
}
