use infer_cpu::sampler::{SamplerKind, SamplerSpec};
use serde::Deserialize;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sample {
    points: Vec<[f64; 3]>,
    sampler: Kind,
    /// The edge of a voxel in the unit of the cloud.
    voxel_size: Option<f64>,
    m: Option<usize>,
    /// The expected indices, in the order of the sampler.
    kept: Vec<u32>,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Voxel,
    Fps,
}

impl Sample {
    pub fn check(&self) {
        let spec = SamplerSpec {
            kind: match self.sampler {
                Kind::Voxel => SamplerKind::Voxel,
                Kind::Fps => SamplerKind::Fps,
            },
            points: self.m.unwrap_or(SamplerSpec::default().points),
            voxel_size: self.voxel_size,
            ..SamplerSpec::default()
        };
        let kept = infer_cpu::choose(&self.points, &spec);
        assert_eq!(kept.unwrap_or_else(|error| panic!("{error}")), self.kept);
    }
}
