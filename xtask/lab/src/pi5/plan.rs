//! What infer-cpu does to classify one cloud, stage by stage.

use super::kernels::Number;
use super::network::{Layer, Net, Network};
use infer_cpu::Precision;
use infer_cpu::sharing::{BLOCK, RUN_BLOCKS, folding_pays, prefilter_pays};
use std::iter::once;
use std::slice::from_ref;

/// Where the points that a network sees come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampler {
    All,
    Fps,
    /// A Critical Points Layer with a front end of its own.
    Cpl,
}

impl Sampler {
    /// The value of `infer-cpu bench --sampler`. No point is repeated, because the network would
    /// see it once in any case.
    pub fn word(self) -> &'static str {
        match self {
            Self::All => "all",
            Self::Fps => "fps",
            Self::Cpl => "cpl:own",
        }
    }
}

/// A classification: `points` are chosen from a cloud of `from` points.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    pub sampler: Sampler,
    /// Points of the cloud.
    pub from: usize,
    /// Points that the network sees.
    pub points: usize,
    pub precision: Precision,
}

impl Setting {
    /// The stages of infer-cpu; `None` if the network lacks the layers that the sampler pools.
    pub fn stages(self, network: &Network) -> Option<Vec<Stage>> {
        stages(network, self.sampler, (self.from, self.points), self.precision)
    }
}

/// A point-wise layer in a format.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Product {
    pub layer: Layer,
    pub number: Number,
}

/// Work between two points at which threads wait for each other.
#[derive(Clone, Debug, PartialEq)]
pub enum Stage {
    /// Rows through some layers; threads share out blocks of rows.
    Hidden { rows: usize, products: Vec<Product> },
    /// Rows through a layer whose outputs are pooled; threads share out groups
    /// of outputs. Where int8 products screen those of fp32, `product` is of
    /// the former; the few of the latter are not in it.
    Pool { rows: usize, product: Product, screened: bool },
    /// Rows through a layer on one thread.
    Alone { rows: usize, product: Product },
    /// One vector through a layer.
    Vector { layer: Layer, stored: Number },
    /// Farthest point sampling, on one thread.
    Farthest { points: usize, picks: usize },
}

impl Stage {
    /// The layers that tiles multiply, and how many rows go through each.
    pub fn products(&self) -> (usize, &[Product]) {
        match self {
            Self::Hidden { rows, products } => (*rows, products),
            Self::Pool { rows, product, .. } | Self::Alone { rows, product } => {
                (*rows, from_ref(product))
            }
            Self::Vector { .. } | Self::Farthest { .. } => (0, &[]),
        }
    }

    /// Multiplications with an addition, padding left out.
    pub fn macs(&self) -> usize {
        let of = |layer: &Layer| layer.inputs * layer.outputs;
        let (rows, products) = self.products();
        let of_vector = if let Self::Vector { layer, .. } = self { of(layer) } else { 0 };
        rows * products.iter().map(|product| of(&product.layer)).sum::<usize>() + of_vector
    }
}

/// The stages of classifying a cloud of `from` points by `points` of them;
/// `None` if the network lacks what the sampler pools.
pub fn stages(
    network: &Network,
    sampler: Sampler,
    (from, points): (usize, usize),
    precision: Precision,
) -> Option<Vec<Stage>> {
    let number = match precision {
        Precision::F32 => Number::F32,
        Precision::I8 => Number::I8,
    };
    let mut stages = Vec::new();
    match sampler {
        // What this does is all outside the inner loops.
        Sampler::All => {}
        Sampler::Fps => stages.push(Stage::Farthest { points: from, picks: points }),
        Sampler::Cpl => number.pass(&mut stages, from, &[], &network.front.convs)?,
    }
    if !network.stn.convs.is_empty() {
        number.pass(&mut stages, points, &[], &network.stn.convs)?;
        number.vectors(&mut stages, &network.stn);
    }
    let Net { convs: trunk, fcs: _ } = &network.trunk;
    let (stem, rest) = trunk.split_at_checked(network.transform_after)?;
    if let Some(first) = network.abstractions.first() {
        // The centres of the other levels are the first of these.
        stages.push(Stage::Farthest { points, picks: first.centres.min(points) });
        number.levels(&mut stages, points, network);
    } else if network.fstn.convs.is_empty() {
        number.pass(&mut stages, points, &[], trunk)?;
    } else {
        number.pass(&mut stages, points, stem, &network.fstn.convs)?;
        number.vectors(&mut stages, &network.fstn);
        let after = *rest.first()?;
        let transform = Layer { inputs: after.inputs, outputs: after.inputs };
        // Activations of int8 have no sign, and a transform's have.
        if number == Number::I8 || folding_pays(points, after.outputs) {
            let product = Product { layer: after, number: Number::F32 };
            stages.push(Stage::Alone { rows: transform.outputs, product });
            number.pass(&mut stages, points, stem, rest)?;
        } else {
            let through: Vec<Layer> = stem.iter().copied().chain([transform]).collect();
            number.pass(&mut stages, points, &through, rest)?;
        }
    }
    number.vectors(&mut stages, &network.trunk);
    Some(stages)
}

/// The stages of a network whose point-wise layers but for the first, and weights of vector layers,
/// are in a format.
impl Number {
    /// `rows` points through `stem` and then `layers`, the last of which is
    /// pooled, in runs of blocks; `None` without a last layer.
    fn pass(
        self,
        stages: &mut Vec<Stage>,
        rows: usize,
        stem: &[Layer],
        layers: &[Layer],
    ) -> Option<()> {
        let (&last, hidden) = layers.split_last()?;
        let layers: Vec<Layer> = stem.iter().chain(hidden).copied().collect();
        let products = self.of_points(&layers);
        let screened = self == Self::F32 && prefilter_pays(last.inputs);
        let number = if screened { Self::I8 } else { self };
        let product = Product { layer: last, number };
        for first in (0..rows).step_by(BLOCK * RUN_BLOCKS) {
            let rows = (rows - first).min(BLOCK * RUN_BLOCKS);
            stages.push(Stage::Hidden { rows, products: products.clone() });
            stages.push(Stage::Pool { rows, product, screened });
        }
        Some(())
    }

    /// Layers that begin with one that takes coordinates, which is in fp32 whatever the precision.
    fn of_points(self, layers: &[Layer]) -> Vec<Product> {
        let mut products = self.products(layers);
        products.iter_mut().take(1).for_each(|first| first.number = Self::F32);
        products
    }

    fn products(self, layers: &[Layer]) -> Vec<Product> {
        layers.iter().map(|&layer| Product { layer, number: self }).collect()
    }

    /// The trunk on all points, and the layers of each set abstraction on its centres. The poolings
    /// are all outside the inner loops.
    fn levels(self, stages: &mut Vec<Stage>, points: usize, network: &Network) {
        let trunk = (points, self.of_points(&network.trunk.convs));
        let abstractions = network.abstractions.iter();
        let centres =
            abstractions.map(|level| (level.centres.min(points), self.products(&level.convs)));
        for (n, products) in once(trunk).chain(centres) {
            for first in (0..n).step_by(BLOCK * RUN_BLOCKS) {
                let rows = (n - first).min(BLOCK * RUN_BLOCKS);
                stages.push(Stage::Hidden { rows, products: products.clone() });
            }
        }
    }

    fn vectors(self, stages: &mut Vec<Stage>, net: &Net) {
        stages.extend(net.fcs.iter().map(|&layer| Stage::Vector { layer, stored: self }));
    }
}

#[cfg(test)]
mod tests {
    use super::super::network::Abstraction;
    use super::super::network::tests::baseline;
    use super::*;
    use infer_cpu::sampler::FrontChoice;

    #[test]
    fn critical_points_are_called_as_infer_cpu_calls_them() {
        let (kind, front) = Sampler::Cpl.word().split_once(':').unwrap();
        assert!(kind == "cpl" && front.parse::<FrontChoice>().is_ok(), "{kind}:{front}");
    }

    fn macs(sampler: Sampler, from: usize, points: usize) -> usize {
        let stages = stages(&baseline(), sampler, (from, points), Precision::F32).unwrap();
        stages.iter().map(Stage::macs).sum()
    }

    /// The network's own count: 426,368 a point (its 3x3 transform is folded,
    /// which is another 9, and the first layer of the trunk is computed twice,
    /// once for the T-Net of the features) and 3,027,200 of vector layers.
    #[test]
    fn products_are_those_of_the_network() {
        assert_eq!(macs(Sampler::All, 64, 64), 64 * (426_368 + 192) + 3_027_200);
        // Past 128 points the feature transform costs 64 x 64 x 128 once.
        let folded = 1024 * (426_368 + 192 - 4096) + 64 * 64 * 128 + 3_027_200;
        assert_eq!(macs(Sampler::All, 1024, 1024), folded);
    }

    #[test]
    fn a_critical_points_layer_costs_its_front_end() {
        let all = macs(Sampler::All, 64, 64);
        let front_end = 3 * 64 + 64 * 128 + 128 * 1024;
        assert_eq!(macs(Sampler::Cpl, 1024, 64), all + 1024 * front_end);
        let mut plain = baseline();
        plain.front = Net::default();
        assert_eq!(stages(&plain, Sampler::Cpl, (1024, 64), Precision::F32), None);
    }

    /// The trunk of 3 x 32 and 32 x 64 on all points, and after each pooling one layer on its
    /// centres, which are as many as there are points at most.
    #[test]
    fn set_abstractions_choose_once_and_multiply_on_their_centres() {
        let layers = |widths: &[usize]| -> Vec<Layer> {
            let layer = |pair: &[usize]| Layer { inputs: pair[0], outputs: pair[1] };
            widths.windows(2).map(layer).collect()
        };
        let level = |(centres, widths): (usize, [usize; 2])| Abstraction {
            centres,
            convs: layers(&widths),
        };
        let network = Network {
            stn: Net::default(),
            fstn: Net::default(),
            trunk: Net { convs: layers(&[3, 32, 64]), fcs: layers(&[1024, 40]) },
            abstractions: [(256, [64, 128]), (64, [128, 512])].map(level).to_vec(),
            ..baseline()
        };
        let stages = |n| stages(&network, Sampler::All, (n, n), Precision::I8).unwrap();
        let macs = |n| stages(n).iter().map(Stage::macs).sum::<usize>();
        let of_point = 3 * 32 + 32 * 64;
        let of_centres = |first: usize, second: usize| first * 64 * 128 + second * 128 * 512;
        assert_eq!(macs(1024), 1024 * of_point + of_centres(256, 64) + 1024 * 40);
        assert_eq!(macs(48), 48 * of_point + of_centres(48, 48) + 1024 * 40);
        let picks = |stage: &Stage| match stage {
            Stage::Farthest { points, picks } => Some((*points, *picks)),
            _ => None,
        };
        let stages = stages(1024);
        assert_eq!(stages.iter().filter_map(picks).collect::<Vec<_>>(), [(1024, 256)]);
        let (_, last) = stages[3].products();
        assert!(last.iter().all(|product| product.number == Number::I8), "{last:?}");
    }

    #[test]
    fn coordinates_stay_in_fp32_and_int8_folds_its_transform() {
        let stages = stages(&baseline(), Sampler::All, (64, 64), Precision::I8).unwrap();
        let numbers = stages.iter().filter_map(|stage| match stage {
            Stage::Hidden { products, .. } => Some(products.iter().map(|p| p.number).collect()),
            _ => None,
        });
        let numbers: Vec<Vec<Number>> = numbers.collect();
        use Number::{F32, I8};
        assert_eq!(numbers, [vec![F32, I8], vec![F32, I8, I8], vec![F32, I8]]);
        assert!(stages.iter().any(|stage| matches!(stage, Stage::Alone { rows: 64, .. })));
    }
}
