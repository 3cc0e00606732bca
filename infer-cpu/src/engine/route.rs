//! The layers of each pass.

use std::sync::atomic::Ordering;

use edgepuck_kernels::Format;

use super::{Engine, Pass, read};
use crate::model::layers::{Conv, First, Layers, Packed, Vector};
use crate::model::network::{Network, TNet};

/// The point-wise layers of a T-Net, if there is one.
fn convs<T: Format>(net: &Option<TNet<Conv<T>, Vector<T>>>) -> &[Conv<T>] {
    net.as_ref().map_or(&[], |net| &net.convs)
}

fn front<T: Format>(layers: &Layers<T>) -> &[Conv<T>] {
    layers.front.as_deref().unwrap_or_default()
}

/// The point-wise layers of each part that the network has.
pub(super) fn stacks<T: Format>(layers: &Layers<T>) -> impl Iterator<Item = &[Conv<T>]> {
    let stacks = [convs(&layers.stn), convs(&layers.fstn), &layers.trunk, front(layers)];
    let abstractions = layers.abstractions.iter().map(|abstraction| &abstraction.convs[..]);
    stacks.into_iter().chain(abstractions).filter(|convs| !convs.is_empty())
}

impl<T: Format> Engine<T> {
    /// The layers of `pass` after its first. The feature transform is a layer of its own, or
    /// `folded` into the one after it.
    pub(super) fn route<'a>(
        &'a self,
        pass: Pass,
        feature: &'a Packed<T>,
        folded: &'a Packed<T>,
    ) -> impl Iterator<Item = &'a Packed<T>> {
        let Network { stn, trunk, fstn, transform_after, .. } = &*self.layers;
        let after = *transform_after;
        let fold = self.fold.load(Ordering::Relaxed);
        // The layers before the transform, the transform, and those after it.
        let (stem, through, rest): (_, _, &[Conv<T>]) = match pass {
            Pass::Front => (&front(&self.layers)[1..], None, &[]),
            Pass::Stn => (&convs(stn)[1..], None, &[]),
            // The T-Net of features branches off the trunk before the transform.
            Pass::Fstn => (&trunk[1..after], None, convs(fstn)),
            Pass::Trunk if fstn.is_none() => (&trunk[1..], None, &[]),
            // The folded layer replaces the transform and the layer after it.
            Pass::Trunk if fold => (&trunk[1..after], Some(folded), &trunk[after + 1..]),
            Pass::Trunk => (&trunk[1..after], Some(feature), &trunk[after..]),
        };
        stem.iter().map(Conv::packed).chain(through).chain(rest.iter().map(Conv::packed))
    }

    /// The layer of `pass` whose outputs are pooled.
    pub(super) fn last<'a>(
        &'a self,
        pass: Pass,
        feature: &'a Packed<T>,
        folded: &'a Packed<T>,
    ) -> &'a Packed<T> {
        let layers = self.route(pass, feature, folded);
        layers.last().expect("invariant: two layers or more come before a pooling")
    }

    pub(super) fn last_width(&self, pass: Pass) -> usize {
        self.last(pass, &read(&self.feature), &read(&self.folded)).width()
    }

    /// The layer of `pass` that takes coordinates.
    pub(super) fn first(&self, pass: Pass) -> &First {
        match pass {
            Pass::Front => front(&self.layers)[0].first(),
            Pass::Stn => convs(&self.layers.stn)[0].first(),
            Pass::Fstn | Pass::Trunk => self.layers.trunk[0].first(),
        }
    }
}
