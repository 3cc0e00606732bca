//! The samplers that `cargo xtask trade` measures, by their names in its record.

use infer_cpu::sampler::{FrontChoice, SamplerKind};

/// A sampler, by its name in `infer-cpu bench --sampler`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplerConfig {
    /// The name.
    pub name: &'static str,
    /// The kind of sampler.
    pub kind: SamplerKind,
    /// The layers that find critical points.
    pub front: FrontChoice,
}

impl SamplerConfig {
    /// Random points.
    pub const RANDOM: Self = Self::by("random", SamplerKind::Random, FrontChoice::Auto);
    /// Farthest point sampling.
    pub const FPS: Self = Self::by("fps", SamplerKind::Fps, FrontChoice::Auto);
    /// Critical points of the model's own front end.
    pub const CPL: Self = Self::by("cpl:own", SamplerKind::Cpl, FrontChoice::Own);
    /// Critical points of the trunk of the input T-Net.
    pub const CPL_STN: Self = Self::by("cpl:stn", SamplerKind::Cpl, FrontChoice::Stn);

    /// All samplers.
    pub const ALL: [Self; 6] = [
        Self::RANDOM,
        Self::FPS,
        Self::by("voxel", SamplerKind::Voxel, FrontChoice::Auto),
        Self::CPL,
        Self::CPL_STN,
        Self::by("cpl:trunk", SamplerKind::Cpl, FrontChoice::Trunk),
    ];

    const fn by(name: &'static str, kind: SamplerKind, front: FrontChoice) -> Self {
        Self { name, kind, front }
    }

    /// The sampler with this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|config| config.name == name)
    }

    /// The first sampler of this kind.
    pub fn of_kind(kind: SamplerKind) -> Self {
        Self::ALL.into_iter().find(|config| config.kind == kind).unwrap_or(Self::RANDOM)
    }
}
