//! The network in a model file: a PointNet of any widths, with or without each T-Net, and
//! optionally a front end for a Critical Points Layer.
//!
//! Names are those of yanx27/Pointnet_Pointnet2_pytorch, for any number of layers: `feat.conv1…`
//! and `feat.bn1…` are the trunk, `feat.stn.*` and `feat.fstn.*` the T-Nets (with `conv`, `fc`, and
//! `bn` numbered through both), `fc1…` and `bn1…` the head. The front end is `cpl.conv1…` and
//! `cpl.bn1…`. `edge.conv1…` computes features of a point's neighborhood, one layer for each of the
//! card's `edge_radii`. `sa1.conv1…`, `sa2.conv1…` are set abstractions, one for each of the card's
//! `abstractions`; `conv1` is the pooling, whose inputs are a point's own feature and its offset. If
//! no layer has a batch norm, all are folded in already.

use std::collections::BTreeSet;
use std::path::Path;

use edgepuck_kernels::Dense;
use formats::FormatError;
use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile, tensor_part};

use crate::model::batch_norm::BatchNorm;
use crate::model::source::ModelSource;

/// The most centres of a set abstraction: memory for all of them is allocated when a model is loaded.
const MOST_CENTRES: usize = 1 << 16;

/// A network whose point-wise layers are `C` and whose vector layers are `F`.
pub struct Network<C, F> {
    /// The T-Net of the coordinates.
    pub stn: Option<TNet<C, F>>,
    /// The EdgeConv layers, each with its radius.
    pub edges: Vec<(f32, Dense)>,
    /// The layers from coordinates and EdgeConv features to the pooled features.
    pub trunk: Vec<C>,
    /// The set abstractions after the trunk. Without any, the trunk's outputs are pooled.
    pub abstractions: Vec<SetAbstraction<C>>,
    /// The T-Net of the features.
    pub fstn: Option<TNet<C, F>>,
    /// The number of layers of the trunk before the feature transform.
    pub transform_after: usize,
    /// The layers from the pooled vector to the logits.
    pub head: Vec<F>,
    /// The layers that a Critical Points Layer pools, if the file has them.
    pub front: Option<Vec<C>>,
}

/// The optional parts of a network that decide what a Critical Points Layer can pool.
#[derive(Clone, Copy, Debug)]
pub struct Parts {
    pub stn: bool,
    pub fstn: bool,
    pub front: bool,
    pub abstractions: bool,
}

impl<C, F> Network<C, F> {
    pub(crate) fn parts(&self) -> Parts {
        let Self { stn, fstn, front, abstractions, .. } = self;
        Parts {
            stn: stn.is_some(),
            fstn: fstn.is_some(),
            front: front.is_some(),
            abstractions: !abstractions.is_empty(),
        }
    }
}

/// A level of a network: features of the neighborhoods of some of its points.
pub struct SetAbstraction<C> {
    /// The number of centres, the first farthest points.
    pub centres: usize,
    /// The radius of a neighborhood.
    pub radius: f32,
    /// The pooling over neighborhoods. Its inputs are the feature of the same channel, x, y and z.
    pub pool: C,
    /// The layers after the pooling.
    pub convs: Vec<C>,
}

/// A network that predicts a `k` x `k` matrix, row by row. Its last biases include the identity.
pub struct TNet<C, F> {
    /// The number of rows of the matrix.
    pub k: usize,
    /// Layers before the pooling.
    pub convs: Vec<C>,
    /// Layers after it.
    pub fcs: Vec<F>,
}

/// The position of a point-wise layer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// Its inputs are coordinates.
    First,
    /// Its inputs and outputs are features.
    Inner,
    /// Its inputs are features after the feature transform.
    AfterTransform,
    /// Its outputs are pooled.
    Last,
}

/// The widest layer: a sum of int8 products over that many inputs fits into 32 bits.
const WIDEST: usize = 1 << 16;

/// Opens the tensors and reads the card of the bundled model of this name, or of the model file at
/// `path`.
pub fn open(path: &Path) -> Result<(WeightsFile, ModelCard), FormatError> {
    ModelSource::of(path)?.open()
}

/// Reads the card and the network of the bundled model of this name, or of the model file at `path`,
/// in f32, with batch norms folded in.
pub fn read(path: &Path) -> Result<(ModelCard, Network<Dense, Dense>), FormatError> {
    let (mut file, card) = open(path)?;
    let network = read_network(&mut file, &card, |dense, _| dense, |dense| dense)?;
    Ok((card, network))
}

/// Reads the network of `file`. `conv` or `fc` converts each layer as soon as it is read, so that
/// at most one is in memory twice.
pub fn read_network<C, F>(
    file: &mut WeightsFile,
    card: &ModelCard,
    mut conv: impl FnMut(Dense, Role) -> C,
    mut fc: impl FnMut(Dense) -> F,
) -> Result<Network<C, F>, FormatError> {
    let names: BTreeSet<String> = file.shapes().into_keys().collect();
    let has_norms = names.iter().any(|name| name.ends_with("running_var"));
    let (conv, fc) = (&mut conv, &mut fc);
    let mut reader = Reader { file, names, used: BTreeSet::new(), has_norms, conv, fc };
    let network = reader.network(card)?;
    reader.check_that_all_is_used()?;
    Ok(network)
}

struct Reader<'a, C, F> {
    file: &'a mut WeightsFile,
    names: BTreeSet<String>,
    used: BTreeSet<String>,
    has_norms: bool,
    conv: &'a mut dyn FnMut(Dense, Role) -> C,
    fc: &'a mut dyn FnMut(Dense) -> F,
}

impl<C, F> Reader<'_, C, F> {
    fn network(&mut self, card: &ModelCard) -> Result<Network<C, F>, FormatError> {
        let stn = self.has("feat.stn.").then(|| self.t_net("feat.stn", 3, Role::First));
        let stn = stn.transpose()?;
        let edges = self.edges(card)?;
        let inputs = 3 + edges.iter().map(|(_, dense)| dense.outputs).sum::<usize>();
        let transform_after = card.transform_after;
        let turned = self.has("feat.fstn.").then_some(transform_after);
        if self.has("sa") || !card.abstractions.is_empty() {
            return self.set_network(card);
        }
        let (trunk, widths) =
            self.point_layers("feat", inputs, Role::First, turned, card.pooled_relu)?;
        let n_trunk = trunk.len();
        let fstn = match turned {
            Some(after) if !(1..n_trunk).contains(&after) => {
                let most = n_trunk - 1;
                let cause =
                    format!("expected 1 to {most} for a trunk of {n_trunk} layers, found {after}");
                return Err(self.file_error("metadata `transform_after`", cause));
            }
            Some(after) => Some(self.t_net("feat.fstn", widths[after], Role::Inner)?),
            None => None,
        };
        let head = self.vector_layers("", 0, widths[n_trunk], None)?;
        self.check_class_names(card, head.len())?;
        let front = self
            .has("cpl.")
            .then(|| self.point_layers("cpl", 3, Role::First, None, true))
            .transpose()?
            .map(|(layers, _)| layers);
        let abstractions = Vec::new();
        Ok(Network { stn, edges, trunk, abstractions, fstn, transform_after, head, front })
    }

    /// A network of set abstractions.
    fn set_network(&mut self, card: &ModelCard) -> Result<Network<C, F>, FormatError> {
        let (trunk, mut width) = self.hidden_layers("feat", 1, 3, Role::First)?;
        let mut abstractions = Vec::new();
        for (&(centres, radius), number) in card.abstractions.iter().zip(1..) {
            let most = abstractions
                .last()
                .map_or(MOST_CENTRES, |before: &SetAbstraction<C>| before.centres);
            if !((1..=most).contains(&centres) && radius.is_normal() && radius > 0.0) {
                let cause = format!(
                    "expected 1 to {most} centres and a radius above 0, found {centres} and {radius}"
                );
                return Err(self.file_error("metadata `abstractions`", cause));
            }
            let prefix = format!("sa{number}");
            let pool = self.dense(&prefix, ("conv", 1), Some(1), 4, true)?;
            if pool.outputs != width {
                let cause = format!("expected shape [{width}, 4], found [{}, 4]", pool.outputs);
                return Err(self.error(&format!("{prefix}.conv1.weight"), cause));
            }
            let pool = (self.conv)(pool, Role::First);
            let (convs, after) = self.hidden_layers(&prefix, 2, width, Role::Inner)?;
            width = after;
            abstractions.push(SetAbstraction { centres, radius, pool, convs });
        }
        if abstractions.is_empty() {
            let cause = "missing, although the file has set abstractions".to_owned();
            return Err(self.file_error("metadata `abstractions`", cause));
        }
        let head = self.vector_layers("", 0, 2 * width, None)?;
        self.check_class_names(card, head.len())?;
        let (edges, transform_after) = (Vec::new(), card.transform_after);
        let (stn, fstn, front) = (None, None, None);
        Ok(Network { stn, edges, trunk, abstractions, fstn, transform_after, head, front })
    }

    /// Point-wise layers with ReLU from number `first` on, whose outputs are stored, and the last
    /// width. The first of them has the role `role`.
    fn hidden_layers(
        &mut self,
        prefix: &str,
        first: usize,
        mut width: usize,
        role: Role,
    ) -> Result<(Vec<C>, usize), FormatError> {
        let n = self.count(&format!("{prefix}.conv")).max(first);
        let mut layers = Vec::new();
        for i in first..=n {
            let dense = self.dense(prefix, ("conv", i), Some(i), width, true)?;
            width = dense.outputs;
            layers.push((self.conv)(dense, if i == first { role } else { Role::Inner }));
        }
        Ok((layers, width))
    }

    fn check_class_names(&self, card: &ModelCard, n_layers: usize) -> Result<(), FormatError> {
        let last = self.file.shape(&format!("fc{n_layers}.weight"));
        let n_classes = last.and_then(|shape| shape.first()).copied().unwrap_or(0);
        let n_names = card.classes.len();
        if n_names != 0 && n_names != n_classes {
            let cause = format!("expected {n_classes} names, one for each logit, found {n_names}");
            return Err(self.file_error("metadata `classes`", cause));
        }
        Ok(())
    }

    /// The T-Net that predicts a square matrix with `inputs` rows.
    fn t_net(
        &mut self,
        prefix: &str,
        inputs: usize,
        first: Role,
    ) -> Result<TNet<C, F>, FormatError> {
        let (convs, widths) = self.point_layers(prefix, inputs, first, None, true)?;
        let fcs = self.vector_layers(prefix, convs.len(), widths[convs.len()], Some(inputs))?;
        Ok(TNet { k: inputs, convs, fcs })
    }

    fn edges(&mut self, card: &ModelCard) -> Result<Vec<(f32, Dense)>, FormatError> {
        let (n, radii) = (self.count("edge.conv"), &card.edge_radii);
        if radii.len() != n {
            let cause = format!(
                "expected {n} radii, one for each layer `edge.conv`, found {}",
                radii.len()
            );
            return Err(self.file_error("metadata `edge_radii`", cause));
        }
        if let Some(radius) = radii.iter().find(|r| !(r.is_normal() && **r > 0.0)) {
            let cause = format!("expected radii above 0, found {radius}");
            return Err(self.file_error("metadata `edge_radii`", cause));
        }
        let numbered = radii.iter().zip(1..);
        numbered
            .map(|(&radius, i)| Ok((radius, self.dense("edge", ("conv", i), Some(i), 3, true)?)))
            .collect()
    }

    /// Point-wise layers, and the widths before, between and after them. A transform precedes layer
    /// `turned`; the last layer has a ReLU if `pooled_relu`.
    fn point_layers(
        &mut self,
        prefix: &str,
        inputs: usize,
        first: Role,
        turned: Option<usize>,
        pooled_relu: bool,
    ) -> Result<(Vec<C>, Vec<usize>), FormatError> {
        let n = self.count(&format!("{prefix}.conv"));
        if n < 2 {
            let cause = "missing: expected two layers or more before a pooling";
            return Err(self.error(&format!("{prefix}.conv2.weight"), cause));
        }
        let mut widths = vec![inputs];
        let mut layers = Vec::with_capacity(n);
        for i in 0..n {
            let is_last = i + 1 == n;
            let role = match i {
                0 => first,
                _ if turned == Some(i) => Role::AfterTransform,
                _ if is_last => Role::Last,
                _ => Role::Inner,
            };
            let relu = !is_last || pooled_relu;
            let dense = self.dense(prefix, ("conv", i + 1), Some(i + 1), widths[i], relu)?;
            widths.push(dense.outputs);
            layers.push((self.conv)(dense, role));
        }
        Ok((layers, widths))
    }

    /// The layers after a pooling; `matrix` is the number of rows of a T-Net's matrix.
    /// `norms_before` is the number of batch norms of the point-wise layers.
    fn vector_layers(
        &mut self,
        prefix: &str,
        norms_before: usize,
        inputs: usize,
        matrix: Option<usize>,
    ) -> Result<Vec<F>, FormatError> {
        let n = self.count(&dotted(prefix, "fc")).max(1);
        let mut width = inputs;
        let mut layers = Vec::with_capacity(n);
        for i in 1..=n {
            let last = i == n;
            let norm = (!last).then_some(norms_before + i);
            let mut dense = self.dense(prefix, ("fc", i), norm, width, !last)?;
            width = dense.outputs;
            if let Some(k) = matrix.filter(|_| last) {
                if width != k * k {
                    let (name, inputs) = (format!("{}.weight", dense.name), dense.inputs);
                    let expected = k * k;
                    let cause =
                        format!("expected shape [{expected}, {inputs}], found [{width}, {inputs}]");
                    return Err(self.error(&name, cause));
                }
                (0..k).for_each(|i| dense.bias[i * k + i] += 1.0);
            }
            layers.push((self.fc)(dense));
        }
        Ok(layers)
    }

    /// Reads one layer of `inputs` inputs and the batch norm that follows it.
    fn dense(
        &mut self,
        prefix: &str,
        (kind, number): (&str, usize),
        norm: Option<usize>,
        inputs: usize,
        relu: bool,
    ) -> Result<Dense, FormatError> {
        let name = dotted(prefix, &format!("{kind}{number}"));
        let weight_name = format!("{name}.weight");
        if let Some(width) = self.too_wide(&weight_name) {
            let cause = format!("expected a layer of at most {WIDEST} channels, found {width}");
            return Err(self.error(&weight_name, cause));
        }
        let weight = self.tensor(&weight_name)?;
        let outputs = match weight.shape[..] {
            [outputs, found] | [outputs, found, 1] if found == inputs && outputs > 0 => outputs,
            _ => {
                let outputs = weight.shape.first().copied().unwrap_or(0).max(1);
                let expected = match kind {
                    "conv" => format!("[{outputs}, {inputs}, 1]"),
                    _ => format!("[{outputs}, {inputs}]"),
                };
                let cause = format!("expected shape {expected}, found {:?}", weight.shape);
                return Err(self.error(&weight_name, cause));
            }
        };
        let bias = self.vector(&format!("{name}.bias"), outputs)?.values;
        let mut dense = Dense { name, inputs, outputs, weight: weight.values, bias, relu };
        if let Some(norm) = norm.filter(|_| self.has_norms) {
            let norm = self.batch_norm(&dotted(prefix, &format!("bn{norm}")), outputs)?;
            norm.fold_into(&mut dense);
        }
        dense.flush();
        let values = dense.weight.iter().chain(&dense.bias);
        if !values.fold(true, |finite, value| finite & value.is_finite()) {
            return Err(self.error(
                &weight_name,
                "expected finite weights after the batch norm is folded in, found others",
            ));
        }
        Ok(dense)
    }

    fn batch_norm(&mut self, name: &str, width: usize) -> Result<BatchNorm, FormatError> {
        let mut part = |part: &str| self.vector(&format!("{name}.{part}"), width);
        let norm = BatchNorm {
            weight: part("weight")?,
            bias: part("bias")?,
            mean: part("running_mean")?,
            variance: part("running_var")?,
        };
        match norm.variance.values.iter().position(|&variance| variance < 0.0) {
            Some(at) => {
                let cause = format!(
                    "expected variances of at least 0, found {} at element {at}",
                    norm.variance.values[at]
                );
                Err(self.error(&format!("{name}.running_var"), cause))
            }
            None => Ok(norm),
        }
    }

    fn vector(&mut self, name: &str, width: usize) -> Result<Tensor, FormatError> {
        let tensor = self.tensor(name)?;
        if tensor.shape != [width] {
            let cause = format!("expected shape [{width}], found {:?}", tensor.shape);
            return Err(self.error(name, cause));
        }
        Ok(tensor)
    }

    fn tensor(&mut self, name: &str) -> Result<Tensor, FormatError> {
        self.used.insert(name.to_owned());
        self.file.read(name)
    }

    /// The highest number of a layer whose name begins with `stem`. Reading a missing layer below
    /// it fails.
    fn count(&self, stem: &str) -> usize {
        let numbers = self.names.iter().filter_map(|name| {
            let (number, _) = name.strip_prefix(stem)?.split_once('.')?;
            number.parse::<usize>().ok()
        });
        // No network has more layers; a higher number is reported as an unknown tensor.
        numbers.filter(|&number| number <= 64).max().unwrap_or(0)
    }

    fn has(&self, prefix: &str) -> bool {
        self.names.iter().any(|name| name.starts_with(prefix))
    }

    fn check_that_all_is_used(&self) -> Result<(), FormatError> {
        let left = self.names.difference(&self.used);
        match left.into_iter().find(|name| !name.ends_with(".num_batches_tracked")) {
            Some(name) => {
                let shape = self.file.shape(name).unwrap_or_default();
                Err(self.error(
                    name,
                    format!("unexpected: no layer takes a tensor of this name (shape {shape:?})"),
                ))
            }
            None => Ok(()),
        }
    }

    fn too_wide(&self, weight: &str) -> Option<usize> {
        let shape = self.file.shape(weight)?;
        shape.iter().copied().find(|&width| width > WIDEST)
    }

    fn error(&self, tensor: &str, cause: impl Into<String>) -> FormatError {
        self.file_error(&tensor_part(tensor), cause.into())
    }

    fn file_error(&self, part: &str, cause: String) -> FormatError {
        FormatError::malformed(self.file.path(), part, cause)
    }
}

fn dotted(prefix: &str, name: &str) -> String {
    if prefix.is_empty() { name.to_owned() } else { format!("{prefix}.{name}") }
}
