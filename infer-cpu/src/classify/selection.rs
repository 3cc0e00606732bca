//! The points for the network: those that the sampler keeps, each once.

use edgepuck_kernels::Kernels;

use crate::engine::{Forward, Input, Pass, Scratch};
use crate::error::Error;
use crate::model::network::Parts;
use crate::sampler::{
    CanonicalOrder, CriticalPoints, FrontChoice, Sampler, SamplerKind, SamplerSpec,
};

/// A sampler with its working memory.
pub struct Selection {
    spec: SamplerSpec,
    sampler: Sampler,
    /// The pass whose features a Critical Points Layer pools.
    front: Option<Pass>,
    /// All points, sorted by geometry, each once.
    cloud: CanonicalOrder,
    critical: CriticalPoints,
    rows: Vec<u32>,
    kept: Vec<[f32; 3]>,
    /// The points for the network: the kept ones, sorted by geometry, each once.
    distinct: CanonicalOrder,
    /// Whether the T-Net pooling of the kept points is known, because it equals that of the whole
    /// cloud.
    pooled_stn: bool,
}

impl Selection {
    /// A selection by `spec`; `front` is the pass that a Critical Points Layer pools.
    pub fn new(spec: &SamplerSpec, front: Option<Pass>) -> Result<Self, Error> {
        let coordinates_alone = match spec.kind {
            SamplerKind::Cpl => SamplerSpec { kind: SamplerKind::All, ..spec.clone() },
            _ => spec.clone(),
        };
        spec.check()?;
        Ok(Self {
            spec: spec.clone(),
            sampler: Sampler::new(coordinates_alone)?,
            front,
            cloud: CanonicalOrder::default(),
            critical: CriticalPoints::default(),
            rows: Vec::new(),
            kept: Vec::new(),
            distinct: CanonicalOrder::default(),
            pooled_stn: false,
        })
    }

    /// The same selection with its own working memory.
    pub fn twin(&self) -> Result<Self, Error> {
        Self::new(&self.spec, self.front)
    }

    pub fn spec(&self) -> &SamplerSpec {
        &self.spec
    }

    /// The distinct points that the last selection kept.
    pub fn points(&self) -> &[[f32; 3]] {
        &self.distinct.points
    }

    /// Whether the last selection left the pooled vector of the coordinates' T-Net in the scratch
    /// memory.
    pub fn pooled_stn(&self) -> bool {
        self.pooled_stn
    }

    /// Chooses from `points` and returns the chosen indices: M of them, or as many as the sampler
    /// yields.
    pub fn select(
        &mut self,
        points: &[[f32; 3]],
        kernels: &'static Kernels,
        network: &dyn Forward,
        scratch: &mut Scratch,
    ) -> Result<&[u32], Error> {
        self.pooled_stn = false;
        self.rows.clear();
        if self.spec.kind == SamplerKind::Cpl {
            self.cloud.sort(points);
            self.select_critical(network, scratch);
            // Turns rows of the sorted cloud into indices of the given one.
            for row in &mut self.rows {
                *row = self.cloud.index[*row as usize];
            }
        } else {
            self.rows.extend(self.sampler.select(points, kernels)?);
        }
        self.kept.clear();
        self.kept.extend(self.rows.iter().map(|&row| points[row as usize]));
        self.distinct.sort(&self.kept);
        Ok(&self.rows)
    }

    fn select_critical(&mut self, network: &dyn Forward, scratch: &mut Scratch) {
        let Some(front) = self.front else {
            unreachable!("invariant: a classifier gives critical points a front end");
        };
        let cloud = &self.cloud.points;
        network.pool_winners(front, &Input { points: cloud, cloud, pooled_stn: false }, scratch);
        self.pooled_stn = front == Pass::Stn;
        self.critical.rank(&scratch.values, &scratch.winners);
        self.rows.extend(self.critical.rows.iter().take(self.spec.points));
    }

    pub fn reserve(
        &mut self,
        n: usize,
        kernels: &'static Kernels,
        network: &dyn Forward,
        scratch: &mut Scratch,
    ) -> Result<(), Error> {
        // A worst case for every sampler: all points differ.
        let cloud: Vec<[f32; 3]> = (0..n).map(|i| [i as f32, (i % 7) as f32, 0.0]).collect();
        self.cloud.sort(&cloud);
        self.distinct.sort(&cloud);
        self.kept.reserve(n);
        self.rows.reserve(n);
        self.sampler.select(&cloud, kernels)?;
        if let Some(front) = self.front {
            let channels = network.channels(front);
            self.critical.reserve(channels, n);
            scratch.reserve(channels);
        }
        Ok(())
    }
}

/// The pass of front end `choice` in a network with these parts.
pub fn front_pass(choice: FrontChoice, parts: &Parts) -> Result<Pass, Error> {
    let lacks = |what: &'static str| Err(Error::FrontMissing { choice, what });
    match choice {
        FrontChoice::Own if parts.front => Ok(Pass::Front),
        FrontChoice::Stn if parts.stn => Ok(Pass::Stn),
        _ if parts.abstractions => {
            lacks("set abstractions, which a Critical Points Layer cannot pool")
        }
        FrontChoice::Trunk if !parts.stn && !parts.fstn => Ok(Pass::Trunk),
        FrontChoice::Auto if parts.front => Ok(Pass::Front),
        FrontChoice::Auto if parts.stn => Ok(Pass::Stn),
        FrontChoice::Auto if !parts.fstn => Ok(Pass::Trunk),
        FrontChoice::Own => lacks("no front end of its own"),
        FrontChoice::Stn => lacks("no T-Net of coordinates"),
        FrontChoice::Trunk => lacks("T-Nets, so that its trunk cannot run before them"),
        FrontChoice::Auto => lacks("neither a front end nor a T-Net of coordinates"),
    }
}
