//! Which layers a pass goes through.

use std::sync::atomic::Ordering;

use super::{Engine, Pass, read};
use crate::layers::{Conv, First, Packed, Vector};
use crate::network::TNet;
use crate::precision::Format;

/// A layer of a pass, by where it is kept.
#[derive(Clone, Copy)]
pub(super) enum Place {
    Front(usize),
    Stn(usize),
    Fstn(usize),
    Trunk(usize),
    /// The feature transform by itself.
    Feature,
    /// The feature transform and the layer after it in one.
    Folded,
}

impl<T: Format> Engine<T> {
    pub(super) fn front(&self) -> &[Conv<T>] {
        self.layers.front.as_deref().unwrap_or_default()
    }

    /// The layers of `pass` after its first.
    pub(super) fn places(&self, pass: Pass) -> impl Iterator<Item = Place> + use<T> {
        let length =
            |net: &Option<TNet<Conv<T>, Vector<T>>>| net.as_ref().map_or(0, |net| net.convs.len());
        let (n_trunk, after) = (self.layers.trunk.len(), self.layers.transform_after);
        let turned = self.layers.fstn.is_some();
        let fold = self.fold.load(Ordering::Relaxed);
        // Where the trunk goes: up to the transform, through it, on.
        let (front, stn, stem, fstn, through, rest) = match pass {
            Pass::Front => (1..self.front().len(), 0..0, 0..0, 0..0, None, 0..0),
            Pass::Stn => (0..0, 1..length(&self.layers.stn), 0..0, 0..0, None, 0..0),
            Pass::Fstn => (0..0, 0..0, 1..after, 0..length(&self.layers.fstn), None, 0..0),
            Pass::Trunk if !turned => (0..0, 0..0, 1..n_trunk, 0..0, None, 0..0),
            Pass::Trunk if fold => {
                (0..0, 0..0, 1..after, 0..0, Some(Place::Folded), after + 1..n_trunk)
            }
            Pass::Trunk => (0..0, 0..0, 1..after, 0..0, Some(Place::Feature), after..n_trunk),
        };
        front
            .map(Place::Front)
            .chain(stn.map(Place::Stn))
            .chain(stem.map(Place::Trunk))
            .chain(fstn.map(Place::Fstn))
            .chain(through)
            .chain(rest.map(Place::Trunk))
    }

    pub(super) fn last(&self, pass: Pass) -> Place {
        self.places(pass).last().expect("invariant: two layers or more come before a pooling")
    }

    pub(super) fn last_width(&self, pass: Pass) -> usize {
        let (feature, folded) = (read(&self.feature), read(&self.folded));
        self.place(self.last(pass), &feature, &folded).width()
    }

    pub(super) fn place<'a>(
        &'a self,
        place: Place,
        feature: &'a Packed<T>,
        folded: &'a Packed<T>,
    ) -> &'a Packed<T> {
        let of = |net: &'a Option<TNet<Conv<T>, Vector<T>>>, i: usize| {
            let net = net.as_ref().expect("invariant: a T-Net's pass has a T-Net");
            net.convs[i].packed()
        };
        match place {
            Place::Front(i) => self.front()[i].packed(),
            Place::Stn(i) => of(&self.layers.stn, i),
            Place::Fstn(i) => of(&self.layers.fstn, i),
            Place::Trunk(i) => self.layers.trunk[i].packed(),
            Place::Feature => feature,
            Place::Folded => folded,
        }
    }

    /// The layer of `pass` that takes coordinates, and where it is kept if
    /// another than its own panels are in use.
    pub(super) fn first(&self, pass: Pass) -> &First {
        match pass {
            Pass::Front => self.front()[0].first(),
            Pass::Stn => match &self.layers.stn {
                Some(stn) => stn.convs[0].first(),
                None => unreachable!("invariant: a T-Net's pass has a T-Net"),
            },
            Pass::Fstn | Pass::Trunk => self.layers.trunk[0].first(),
        }
    }
}
