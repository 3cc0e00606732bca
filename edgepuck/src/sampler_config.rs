//! The samplers that `cargo xtask trade` measures, by the names that its record has.

use infer_cpu::sampler::{FrontChoice, SamplerKind};

/// A way to choose points, as `infer-cpu bench --sampler` names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SamplerConfig {
    /// Its name.
    pub name: &'static str,
    /// What infer-cpu is asked for.
    pub kind: SamplerKind,
    /// Which layers find critical points.
    pub front: FrontChoice,
}

impl SamplerConfig {
    /// Points drawn at random.
    pub const RANDOM: Self = Self::by("random", SamplerKind::Random, FrontChoice::Auto);
    /// Farthest point sampling.
    pub const FPS: Self = Self::by("fps", SamplerKind::Fps, FrontChoice::Auto);
    /// One point a cell of a grid.
    pub const VOXEL: Self = Self::by("voxel", SamplerKind::Voxel, FrontChoice::Auto);
    /// Critical points by a front end of the model's own.
    pub const CPL: Self = Self::by("cpl:own", SamplerKind::Cpl, FrontChoice::Own);
    /// Critical points of the trunk of the coordinates' T-Net.
    pub const CPL_STN: Self = Self::by("cpl:stn", SamplerKind::Cpl, FrontChoice::Stn);
    /// Critical points of the network's own trunk.
    pub const CPL_TRUNK: Self = Self::by("cpl:trunk", SamplerKind::Cpl, FrontChoice::Trunk);

    /// All of them.
    pub const ALL: [Self; 6] =
        [Self::RANDOM, Self::FPS, Self::VOXEL, Self::CPL, Self::CPL_STN, Self::CPL_TRUNK];

    const fn by(name: &'static str, kind: SamplerKind, front: FrontChoice) -> Self {
        Self { name, kind, front }
    }

    /// The one that a row names so.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|config| config.name == name)
    }

    /// The first of its kind.
    pub fn of(kind: SamplerKind) -> Self {
        Self::ALL.into_iter().find(|config| config.kind == kind).unwrap_or(Self::RANDOM)
    }
}
