//! A summary of a model file and of its cost.

use std::path::Path;

use edgepuck_kernels::Dense;
use formats::model_card::ModelCard;

use crate::error::Error;
use crate::model::network::{Network, SetAbstraction, TNet, open, read_network};
use crate::precision::Precision;

/// The network of a model file, layer by layer.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Summary {
    /// The metadata of the file.
    pub card: ModelCard,
    /// The T-Net of the coordinates, if there is one.
    pub stn: Option<NetShape>,
    /// The T-Net of the features, if there is one.
    pub fstn: Option<NetShape>,
    /// The EdgeConv layers, each with its radius.
    pub edges: Vec<(f32, LayerShape)>,
    /// The set abstractions, with the numbers of their centres. The first layer of each pools.
    pub abstractions: Vec<(usize, Vec<LayerShape>)>,
    /// The trunk, and the layers from the pooled vector to the logits.
    pub trunk: NetShape,
    /// The front end for a Critical Points Layer, if the file has one.
    pub front: Option<Vec<LayerShape>>,
    /// The number of elements of all tensors in the file.
    pub n_stored: usize,
}

/// Layers before and after a pooling.
#[derive(Clone, Debug, PartialEq)]
pub struct NetShape {
    /// The layers before the pooling, for each point.
    pub convs: Vec<LayerShape>,
    /// The layers after the pooling.
    pub fcs: Vec<LayerShape>,
}

/// A linear layer, with its batch norm folded in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LayerShape {
    /// Its name in the file.
    pub name: String,
    /// Inputs.
    pub inputs: usize,
    /// Outputs.
    pub outputs: usize,
}

/// Reads the model file at `path` with all tensors.
///
/// # Errors
/// A file that is not a model, as for [`crate::Classifier::load`].
pub fn inspect(path: &Path) -> Result<Summary, Error> {
    let (mut file, card) = open(path)?;
    let n_stored = file.shapes().values().map(|shape| shape.iter().product::<usize>()).sum();
    let network = read_network(&mut file, &card, |dense, _| shape_of(dense), shape_of)?;
    let Network { stn, edges, trunk, abstractions, fstn, head, front, .. } = network;
    let layers = |SetAbstraction { centres, pool, convs, .. }| {
        (centres, std::iter::once(pool).chain(convs).collect())
    };
    let t_net = |TNet { convs, fcs, .. }| NetShape { convs, fcs };
    Ok(Summary {
        card,
        stn: stn.map(t_net),
        fstn: fstn.map(t_net),
        edges: edges.into_iter().map(|(radius, dense)| (radius, shape_of(dense))).collect(),
        abstractions: abstractions.into_iter().map(layers).collect(),
        trunk: NetShape { convs: trunk, fcs: head },
        front,
        n_stored,
    })
}

fn shape_of(dense: Dense) -> LayerShape {
    LayerShape { name: dense.name, inputs: dense.inputs, outputs: dense.outputs }
}

impl LayerShape {
    /// The number of multiplications for one input.
    #[must_use]
    pub fn macs(&self) -> usize {
        self.inputs * self.outputs
    }

    /// The number of weights and biases.
    #[must_use]
    pub fn parameters(&self) -> usize {
        self.macs() + self.outputs
    }
}

impl Summary {
    /// The number of classes.
    #[must_use]
    pub fn n_classes(&self) -> usize {
        self.trunk.fcs.last().map_or(0, |layer| layer.outputs)
    }

    /// The number of multiplications for each point, including the transforms, without the front
    /// end.
    #[must_use]
    pub fn macs_per_point(&self) -> usize {
        // The last outputs of a T-Net are the elements of its matrix.
        let transform = |net: &NetShape| net.fcs.last().map_or(0, |layer| layer.outputs);
        let transforms: usize = self.t_nets().map(transform).sum();
        self.nets().flat_map(|net| &net.convs).map(LayerShape::macs).sum::<usize>() + transforms
    }

    /// The number of further multiplications for each cloud, which has all centres of the
    /// abstractions.
    #[must_use]
    pub fn macs_per_cloud(&self) -> usize {
        let centres = self.abstractions.iter().map(|(centres, layers)| {
            // The pooling multiplies once for each point of the level before, not here.
            centres * layers[1..].iter().map(LayerShape::macs).sum::<usize>()
        });
        let vectors = self.nets().flat_map(|net| &net.fcs).map(LayerShape::macs);
        centres.chain(vectors).sum()
    }

    /// The number of multiplications of the front end for each point of the cloud.
    #[must_use]
    pub fn front_macs_per_point(&self) -> Option<usize> {
        Some(self.front.as_ref()?.iter().map(LayerShape::macs).sum())
    }

    /// The number of weights and biases, with batch norms folded in.
    #[must_use]
    pub fn parameters(&self) -> usize {
        let layers = self.nets().flat_map(|net| net.convs.iter().chain(&net.fcs));
        let edges = self.edges.iter().map(|(_, layer)| layer);
        let front = self.front.iter().flatten();
        let abstractions = self.abstractions.iter().flat_map(|(_, layers)| layers);
        layers.chain(edges).chain(front).chain(abstractions).map(LayerShape::parameters).sum()
    }

    /// The bytes of weights, biases (fp32) and scales (fp32, for int8) in `precision`, without
    /// padding.
    #[must_use]
    pub fn bytes(&self, precision: Precision) -> usize {
        let (weight_bytes, scale_bytes) = match precision {
            Precision::F32 => (4, 0),
            Precision::I8 => (1, 4),
        };
        let layer =
            |layer: &LayerShape| layer.macs() * weight_bytes + layer.outputs * (4 + scale_bytes);
        let inner = |convs: &[LayerShape]| -> usize { convs.iter().map(layer).sum() };
        // The layer of coordinates is fp32 in any precision.
        let outer = |convs: &[LayerShape]| match convs.split_first() {
            Some((first, rest)) => 4 * first.parameters() + inner(rest),
            None => 0,
        };
        let nets = [self.stn.as_ref(), Some(&self.trunk)].into_iter().flatten();
        let convs = nets.map(|net| outer(&net.convs)).sum::<usize>()
            + self.fstn.as_ref().map_or(0, |fstn| inner(&fstn.convs))
            + self.edges.iter().map(|(_, edge)| 4 * edge.parameters()).sum::<usize>()
            + self.abstractions.iter().map(|(_, layers)| outer(layers)).sum::<usize>();
        let front = self.front.as_deref().map_or(0, outer);
        let fcs = self.nets().flat_map(|net| &net.fcs).map(layer);
        convs + fcs.sum::<usize>() + front
    }

    fn nets(&self) -> impl Iterator<Item = &NetShape> {
        self.t_nets().chain([&self.trunk])
    }

    fn t_nets(&self) -> impl Iterator<Item = &NetShape> {
        [&self.stn, &self.fstn].into_iter().flatten()
    }
}
