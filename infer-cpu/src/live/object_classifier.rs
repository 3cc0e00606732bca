//! The classes of clusters and tracks.

use std::ops::Range;
use std::sync::Arc;

use edgepuck_segment::BestCut;

use super::waiting::{Node, Tag, USUAL_NODES, Waiting};
use crate::classify::classifier::Classifier;
use crate::classify::prediction::{UNKNOWN, unknown_classes};
use crate::classify::usual_size::usual_size_m;
use crate::detect::MARGIN_OF_WHOLES;
use crate::detect::cluster_classifier::ClusterClassifier;
use crate::error::Error;

/// Classifies trees of clusters, chooses the best cut, and names tracks.
pub struct ObjectClassifier {
    clusters: ClusterClassifier,
    /// The names of the network's classes.
    pub classes: Vec<Arc<str>>,
    /// For each class, whether its objects are unknown.
    is_unknown: Vec<bool>,
    unknown_name: Arc<str>,
    best: BestCut,
    /// The log-probabilities of all classes for each classified node.
    log_probabilities: Vec<f64>,
    /// For each node, where those are.
    views: Vec<Option<Range<usize>>>,
    worths: Vec<f64>,
    is_known: Vec<bool>,
    /// The nodes of the best cut, in the order in which the beams passed them.
    pub chosen: Vec<Chosen>,
}

/// A node of the best cut.
pub struct Chosen {
    pub node: usize,
    /// Its first and its last point.
    pub span: [Tag; 2],
}

/// The class and probability of a track.
pub struct Fused {
    pub class: usize,
    /// The name of the class, or `unknown`.
    pub answer: Arc<str>,
    /// The name of the class, even if the track is unknown.
    pub resembles: Arc<str>,
    pub probability: f64,
}

impl ObjectClassifier {
    /// With as many threads as `classifier` has.
    pub fn new(classifier: Classifier) -> Result<Self, Error> {
        let n_classes = classifier.classes().len();
        Ok(Self {
            classes: classifier.classes().to_vec(),
            is_unknown: unknown_classes(classifier.card(), classifier.classes()),
            unknown_name: UNKNOWN.into(),
            clusters: ClusterClassifier::new(classifier)?,
            best: BestCut::with_capacity(USUAL_NODES),
            log_probabilities: Vec::with_capacity(USUAL_NODES * n_classes),
            views: Vec::with_capacity(USUAL_NODES),
            worths: Vec::with_capacity(USUAL_NODES),
            is_known: Vec::with_capacity(USUAL_NODES),
            chosen: Vec::with_capacity(USUAL_NODES),
        })
    }

    /// Classifies the nodes that have enough points, and chooses the best cut.
    pub fn classify(&mut self, waiting: &Waiting, min_points: usize) {
        let Self { clusters, best, log_probabilities, views, worths, is_known, chosen, .. } = self;
        let nodes = &waiting.nodes;
        log_probabilities.clear();
        views.clear();
        views.resize(nodes.len(), None);
        worths.clear();
        worths.resize(nodes.len(), 0.0);
        is_known.clear();
        is_known.resize(nodes.len(), false);
        // A single ring shows no shape: it belongs to what is next to it.
        let is_asked = |&node: &usize| {
            nodes[node].points.len() >= min_points
                && (nodes[node].parent.is_none() || waiting.has_rings(node))
        };
        let mut asked = (0..nodes.len()).filter(is_asked);
        let clouds = asked.clone().map(|node| {
            let Node { points, ground_z_m, .. } = &nodes[node];
            (&waiting.points[points.clone()], *ground_z_m)
        });
        clusters.classify(clouds, |worth, answer| {
            let Some(node) = asked.next() else { return };
            worths[node] = worth;
            // A cluster has no view if the network overflows on it.
            let answer = answer.ok();
            is_known[node] = answer.is_some_and(|answer| !answer.is_unknown);
            views[node] = answer.map(|answer| {
                let start = log_probabilities.len();
                let n_classes = answer.logits.len();
                let all = (0..n_classes).map(|class| answer.log_probability(class));
                log_probabilities.extend(all);
                start..start + n_classes
            });
        });
        chosen.clear();
        // Neither an unknown piece of a wall or a hedge is an object, nor one that shows no shape.
        let is_object = |&&node: &&usize| {
            let Node { is_part, parent, .. } = &nodes[node];
            is_known[node] || !*is_part && (parent.is_none() || views[node].is_some())
        };
        let cut = best.find(worths, |node| nodes[node].parent, MARGIN_OF_WHOLES);
        let with_span = |&node: &usize| Chosen { node, span: waiting.span(node) };
        chosen.extend(cut.iter().filter(is_object).map(with_span));
        chosen.sort_unstable_by(|a, b| {
            let [[_, a_last], [_, b_last]] = [a.span, b.span];
            a_last.time_s.total_cmp(&b_last.time_s).then(a.node.cmp(&b.node))
        });
    }

    /// The log-probabilities of all classes for a node, if it was classified.
    pub fn view(&self, node: usize) -> Option<&[f64]> {
        self.views[node].clone().map(|range| &self.log_probabilities[range])
    }

    /// The usual length and width of what a node is recognised as by itself, metres.
    pub fn usual_size_m(&self, node: usize) -> Option<[f32; 2]> {
        let view = self.view(node).filter(|_| self.is_known[node])?;
        let (class, _) = view.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        usual_size_m(&self.classes[class])
    }

    /// The class of a track with these mean log-probabilities; `None` without a view.
    pub fn fused(&self, means: &[f64]) -> Option<Fused> {
        let (class, largest) = means.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
        let sum: f64 = means.iter().map(|mean| libm::exp(mean - largest)).sum();
        let answer = match self.is_unknown[class] {
            true => Arc::clone(&self.unknown_name),
            false => Arc::clone(&self.classes[class]),
        };
        let resembles = Arc::clone(&self.classes[class]);
        Some(Fused { class, answer, resembles, probability: 1.0 / sum })
    }
}
