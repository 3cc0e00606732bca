use serde::Deserialize;

#[derive(Clone, Deserialize)]
#[serde(tag = "rule", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Cloud {
    /// Listed points.
    Points { points: Vec<[f64; 3]> },
    /// One point, n times.
    Repeated { point: [f64; 3], n: usize },
    /// n points on a twisted strip, and optionally one far from it.
    Strip { n: usize, outlier: Option<[f64; 3]> },
    /// n points on the surface of an upright vase with a round foot, a belly and a neck.
    Vase { n: usize },
}

impl Cloud {
    pub fn points(&self) -> Vec<[f64; 3]> {
        match self {
            Self::Points { points } => points.clone(),
            Self::Repeated { point, n } => vec![*point; *n],
            Self::Strip { n, outlier } => (0..*n).map(|i| strip(i, *n)).chain(*outlier).collect(),
            Self::Vase { n } => (0..*n).map(|i| vase(i, *n)).collect(),
        }
    }
}

fn strip(i: usize, n: usize) -> [f64; 3] {
    let t = i as f64 / n as f64 * 6.0;
    [t.cos(), t.sin() * (i % 3) as f64, t / 6.0]
}

/// Equidistant heights, with angles by the golden section.
fn vase(i: usize, n: usize) -> [f64; 3] {
    let height = (i as f64 + 0.5) / n as f64;
    let radius = 0.18 + 0.12 * (5.0 * height + 0.4).sin();
    let angle = std::f64::consts::TAU * (i as f64 * 0.618_033_988_749_894_9).fract();
    [radius * angle.cos(), radius * angle.sin(), height]
}
