//! A model file's layers in f64, and the chains of them that are measured.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::{Result, bail};
use formats::model_card::ModelCard;
use formats::weights::{Tensor, WeightsFile};

use super::affine::Affine;

/// A model's tensors.
pub struct Net {
    pub card: ModelCard,
    pub tensors: BTreeMap<String, Tensor>,
}

/// Layers that points go through one after the other, a pooling, and layers that
/// the pooled vector goes through: the trunk and head, or those of a T-Net.
#[derive(Clone)]
pub struct Chain {
    /// Names of point-wise layers.
    pub convs: Vec<String>,
    /// Names of vector layers.
    pub fcs: Vec<String>,
    /// Whether the last point-wise layer has a ReLU.
    pub pooled_relu: bool,
    /// Whether coordinates are turned by the input T-Net first.
    pub stn: bool,
    /// After how many layers features are turned, if they are.
    pub fstn_after: Option<usize>,
    /// Whether points bring what surrounds them.
    pub edges: bool,
}

impl Net {
    /// Reads the model at `path`.
    ///
    /// # Errors
    /// A file that is no model, or whose batch norms are not folded in.
    pub fn read(path: &Path) -> Result<Self> {
        let mut file = WeightsFile::open(path)?;
        let card = ModelCard::from_metadata(path, &file.metadata())?;
        let mut tensors = BTreeMap::new();
        for name in file.shapes().into_keys() {
            if name.ends_with(".running_var") {
                bail!("{}: {name}: batch norms must be folded in to be measured", path.display());
            }
            tensors.insert(name.clone(), file.read(&name)?);
        }
        Ok(Self { card, tensors })
    }

    /// The numbered layers whose names begin with `stem`.
    fn layers(&self, stem: &str) -> Vec<String> {
        let name = |i: usize| format!("{stem}{i}");
        let is_there = |name: &String| self.tensors.contains_key(&format!("{name}.weight"));
        (1..).map(name).take_while(is_there).collect()
    }

    /// Every chain of the network: T-Nets first.
    pub fn chains(&self) -> Vec<Chain> {
        let after = self.card.transform_after;
        let [stn, fstn] = ["feat.stn.", "feat.fstn."].map(|t| self.layers(&format!("{t}conv")));
        let (has_stn, has_fstn) = (!stn.is_empty(), !fstn.is_empty());
        let trunk = self.layers("feat.conv");
        let edges = !self.card.edge_radii.is_empty();
        let t_net = |prefix: &str, convs: Vec<String>, has_stn: bool, edges: bool| Chain {
            convs,
            fcs: self.layers(&format!("{prefix}fc")),
            pooled_relu: true,
            stn: has_stn,
            fstn_after: None,
            edges,
        };
        let mut chains = Vec::new();
        if has_stn {
            chains.push(t_net("feat.stn.", stn, false, false));
        }
        if has_fstn {
            let convs = trunk[..after].iter().cloned().chain(fstn).collect();
            chains.push(t_net("feat.fstn.", convs, has_stn, edges));
        }
        chains.push(Chain {
            convs: trunk,
            fcs: self.layers("fc"),
            pooled_relu: self.card.pooled_relu,
            stn: has_stn,
            fstn_after: has_fstn.then_some(after),
            edges,
        });
        chains
    }

    /// A layer; `relu` says whether it ends in one.
    pub fn affine(&self, name: &str, relu: bool) -> Affine {
        let weight = &self.tensors[&format!("{name}.weight")];
        let bias = &self.tensors[&format!("{name}.bias")];
        let w: Vec<f64> = weight.values.iter().map(|&x| f64::from(x)).collect();
        Affine {
            inputs: weight.shape[1],
            outputs: weight.shape[0],
            dw: vec![0.0; w.len()],
            w,
            b: bias.values.iter().map(|&x| f64::from(x)).collect(),
            relu,
        }
    }

    /// The largest activation that int8 is calibrated to; 1 if it is not.
    pub fn range(&self, layer: &str) -> f64 {
        self.card.activation_ranges.get(layer).map_or(1.0, |&range| f64::from(range))
    }
}
