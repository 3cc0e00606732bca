//! Cases of one cloud and one model, in every precision and on every kernel.

use infer_cpu::kernel::{self, KernelName};
use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use infer_cpu::{Classifier, Error, Options, Precision, Prediction};
use serde::Deserialize;

use crate::cloud::Cloud;
use crate::model::{Model, ModelFile};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Classify {
    model: Model,
    cloud: Cloud,
    /// Another cloud, for `expect.same`.
    other: Option<Cloud>,
    /// Samplers, by their names on the command line. If absent, the sampler of the training.
    samplers: Option<Vec<String>>,
    points: Option<usize>,
    /// Precisions, by their names on the command line. If absent, all precisions.
    precisions: Option<Vec<String>>,
    knob: Option<Knob>,
    expect: Expect,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Knob {
    Scale(Vec<f64>),
    Offset(Vec<[f64; 3]>),
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Expect {
    /// A part of the error, if the cloud is refused.
    refused: Option<String>,
    points: Option<usize>,
    used: Option<usize>,
    /// Largest number of selected points; the smallest is 1.
    used_at_most: Option<usize>,
    label: Option<String>,
    confidence: Option<f64>,
    clipped: Option<bool>,
    logits_above: Option<f64>,
    /// Largest difference between the logits of the cloud and those of the other cloud or of a
    /// value of the parameter, as a share of the largest logit. 0 requires equal bits.
    same: Option<f64>,
}

#[derive(Clone)]
struct Way {
    precision: Precision,
    kernel: KernelName,
    sampler: Option<SamplerKind>,
}

impl Classify {
    pub fn check(&self) {
        let model = self.model.file();
        let cloud = self.cloud.points();
        let turned = self.turned(&cloud);
        for way in self.ways() {
            let mut classifier = self.classifier(&way, &model);
            let what = way.name();
            let plain = self.expect.check(&what, classifier.classify_f64(&cloud));
            for (name, cloud) in &turned {
                let what = format!("{what}, {name}");
                let found = self.expect.check(&what, classifier.classify_f64(cloud));
                if let (Some(part), Some(plain), Some(found)) = (self.expect.same, &plain, &found) {
                    assert_same(&what, part, plain, found);
                }
            }
        }
    }

    /// The other cloud, and the cloud at each value of the parameter.
    fn turned(&self, cloud: &[[f64; 3]]) -> Vec<(String, Vec<[f64; 3]>)> {
        let mapped = |name: String, map: &dyn Fn([f64; 3]) -> [f64; 3]| {
            (name, cloud.iter().copied().map(map).collect())
        };
        let other = self.other.iter().map(|other| ("the other".to_owned(), other.points()));
        let by_knob: Vec<_> = match &self.knob {
            None => Vec::new(),
            Some(Knob::Scale(values)) => {
                let scaled = |s: &f64| mapped(format!("scale {s:e}"), &|p| p.map(|x| x * s));
                values.iter().map(scaled).collect()
            }
            Some(Knob::Offset(values)) => {
                let moved = |o: &[f64; 3]| {
                    mapped(format!("offset {o:?}"), &|p| [0, 1, 2].map(|k| p[k] + o[k]))
                };
                values.iter().map(moved).collect()
            }
        };
        other.chain(by_knob).collect()
    }

    fn ways(&self) -> Vec<Way> {
        let precisions: Vec<Precision> = match &self.precisions {
            None => Precision::ALL.to_vec(),
            Some(words) => words.iter().map(|word| parsed(word)).collect(),
        };
        let samplers: Vec<Option<SamplerKind>> = match &self.samplers {
            None => vec![None],
            Some(words) => words.iter().map(|word| Some(parsed(word))).collect(),
        };
        let mut ways = Vec::new();
        for precision in precisions {
            for kernels in kernel::available().filter(|kernels| precision.runs_on(kernels)) {
                let kernel = kernels.name;
                ways.extend(samplers.iter().map(|&sampler| Way { precision, kernel, sampler }));
            }
        }
        ways
    }

    fn classifier(&self, way: &Way, model: &ModelFile) -> Classifier {
        let points = self.points.unwrap_or(SamplerSpec::default().points);
        let spec = |kind| SamplerSpec { kind, points, ..SamplerSpec::default() };
        let options = Options {
            precision: way.precision,
            kernel: Some(way.kernel),
            sampler: way.sampler.map(spec),
            ..Options::default()
        };
        Classifier::load(&model.path, &options).unwrap_or_else(|error| panic!("{error}"))
    }
}

impl Expect {
    fn check(&self, what: &str, found: Result<&Prediction, Error>) -> Option<Vec<f32>> {
        if let Some(part) = &self.refused {
            let error = found.err().unwrap_or_else(|| panic!("{what}: not refused"));
            assert!(error.to_string().contains(part), "{what}: {error}");
            return None;
        }
        let found = found.unwrap_or_else(|error| panic!("{what}: {error}"));
        let largest = found.logits.iter().fold(0.0f32, |most, x| most.max(x.abs()));
        assert!(largest.is_finite(), "{what}: {:?}", found.logits);
        // The largest of n probabilities is 1 / n or more; their sum is rounded to n * 2^-53.
        let least = 1.0 / found.logits.len() as f64 - 1e-12;
        let confidence = found.confidence();
        assert!((least..=1.0).contains(&confidence), "{what}: {confidence}");
        let holds = |expected: Option<usize>, found: usize| {
            expected.is_none_or(|expected| expected == found)
        };
        assert!(holds(self.points, found.n_points), "{what}: {} points", found.n_points);
        assert!(holds(self.used, found.n_used), "{what}: {} used", found.n_used);
        let most = self.used_at_most.unwrap_or(usize::MAX);
        assert!((1..=most).contains(&found.n_used), "{what}: {} used", found.n_used);
        let label = self.label.as_deref().unwrap_or(&found.label);
        assert_eq!(label, &*found.label, "{what}");
        assert!(
            self.confidence.is_none_or(|expected| expected == confidence),
            "{what}: {confidence}"
        );
        let clipped = found.n_clipped > 0;
        assert!(
            self.clipped.is_none_or(|expected| expected == clipped),
            "{what}: {}",
            found.n_clipped
        );
        assert!(self.logits_above.is_none_or(|x| f64::from(largest) > x), "{what}: {largest}");
        Some(found.logits.clone())
    }
}

/// Asserts that logits differ by at most this share of the largest.
pub fn assert_same(what: &str, part: f64, one: &[f32], other: &[f32]) {
    let largest = one.iter().fold(0.0f32, |most, x| most.max(x.abs()));
    let error = |(a, b): (&f32, &f32)| (f64::from(*a) - f64::from(*b)).abs();
    let worst = one.iter().zip(other).map(error).fold(0.0, f64::max);
    assert!(worst <= part * f64::from(largest), "{what}: {worst:e} of {largest}");
}

impl Way {
    fn name(&self) -> String {
        let sampler = self.sampler.map_or("as trained", SamplerKind::name);
        format!("{} on {}, sampler {sampler}", self.precision, self.kernel)
    }
}

fn parsed<T: std::str::FromStr<Err: std::fmt::Display>>(word: &str) -> T {
    word.parse().unwrap_or_else(|error| panic!("{error}"))
}
