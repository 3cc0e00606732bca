//! The animation of nodes as trajectories.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3, DVec4};
use gltf::Gltf;
use gltf::json::animation::{Channel, Interpolation, Property, Sampler};
use gltf::json::validation::Checked;

use super::Warnings;
use super::buffers::Buffers;
use super::track::Track;
use crate::pose::{Pose, Trajectory};

/// How far a trajectory may be from the animation: metres, and radians.
const BOUND_M: f64 = 1e-4;
const BOUND_RAD: f64 = 1e-4;

/// The places of moving nodes that are computed for a file at most: a few seconds' work.
const MOST_PLACES: usize = 1 << 24;

/// The translation, the rotation and the scale of a node at rest.
pub(super) struct Rest {
    pub translation: DVec3,
    pub rotation: DQuat,
    pub scale: DVec3,
}

/// What animates a node's translation, rotation and scale.
type Tracks = [Option<Track>; 3];

#[derive(Default)]
pub(super) struct Animation {
    /// By node.
    tracks: HashMap<usize, Tracks>,
    movers: HashMap<usize, Mover>,
    motions: HashMap<usize, (Arc<Trajectory>, f64)>,
    places: usize,
}

impl Animation {
    /// All animations of a file, which run at once.
    pub fn read(file: &Gltf, buffers: &Buffers, warnings: &mut Warnings) -> Result<Self, String> {
        let mut all = Self::default();
        // The crate checks the samplers of an animation, but not the targets of its channels.
        for (i, animation) in file.as_json().animations.iter().enumerate() {
            for (k, channel) in animation.channels.iter().enumerate() {
                let place = format!("animations[{i}].channels[{k}]");
                let sampler = animation.samplers.get(channel.sampler.value());
                let sampler = sampler.ok_or_else(|| format!("{place}: expected a sampler"))?;
                all.add(file, buffers, channel, sampler, warnings)
                    .map_err(|cause| format!("{place}: {cause}"))?;
            }
        }
        Ok(all)
    }

    fn add(
        &mut self,
        file: &Gltf,
        buffers: &Buffers,
        channel: &Channel,
        sampler: &Sampler,
        warnings: &mut Warnings,
    ) -> Result<(), String> {
        let (node, n) = (channel.target.node.value(), file.nodes().len());
        if node >= n {
            return Err(format!("expected one of {n} nodes, found {node}"));
        }
        let at = match channel.target.path {
            Checked::Valid(Property::Translation) => 0,
            Checked::Valid(Property::Rotation) => 1,
            Checked::Valid(Property::Scale) => 2,
            Checked::Valid(Property::MorphTargetWeights) => {
                warnings.add("morph targets are not applied: their meshes stand undeformed");
                return Ok(());
            }
            Checked::Invalid => {
                return Err("expected translation, rotation, scale or weights as path".to_owned());
            }
        };
        let slot = &mut self.tracks.entry(node).or_default()[at];
        if slot.is_some() {
            warnings.add("of animations that move a node in several ways, the first is applied");
            return Ok(());
        }
        *slot = Some(Track::read(file, buffers, sampler, at == 1)?);
        Ok(())
    }

    /// Whether a channel names `node`.
    pub fn moves(&self, node: usize) -> bool {
        self.tracks.contains_key(&node)
    }

    /// What animates `node`, without what stays as it is, which goes to `rest`.
    pub fn settle(&mut self, node: usize, rest: &mut Rest) -> Option<Tracks> {
        let [translation, rotation, scale] = self.tracks.remove(&node)?;
        let still = |track: Option<Track>, set: &mut dyn FnMut(DVec4)| match track {
            Some(track) if track.is_still() => {
                set(track.first_value());
                None
            }
            track => track,
        };
        let translation = still(translation, &mut |to| rest.translation = to.truncate());
        let rotation = still(rotation, &mut |to| rest.rotation = DQuat::from_vec4(to));
        let scale = still(scale, &mut |to| rest.scale = to.truncate());
        let tracks = [translation, rotation, scale];
        tracks.iter().any(Option::is_some).then_some(tracks)
    }

    /// Adds a node that `tracks` move, below the mover `above`, or else the world, through `before`.
    pub fn add_mover(
        &mut self,
        node: usize,
        above: Option<usize>,
        before: &DAffine3,
        rest: &Rest,
        tracks: Tracks,
    ) {
        let [translation, rotation, scale] = tracks;
        let before = match similar(before) {
            _ if scale.is_some() => Err("expected a scale that stays, found an animated one"),
            None => Err("expected even scales above an animated node, found others"),
            Some(before) => Ok(before),
        };
        let before = before.map_err(|cause| format!("nodes[{node}]: {cause}"));
        let rest = (rest.translation, rest.rotation);
        self.movers.insert(node, Mover { above, before, rest, translation, rotation });
    }

    /// The poses of the frame of a mover, and the factor of lengths in it.
    pub fn motion(&mut self, mover: usize) -> Result<(Arc<Trajectory>, f64), String> {
        if let Some((motion, factor)) = self.motions.get(&mover) {
            return Ok((Arc::clone(motion), *factor));
        }
        let mut chain = Vec::new();
        let mut next = Some(mover);
        while let Some(mover) = next.map(|node| &self.movers[&node]) {
            chain.push((mover, mover.before.as_ref().map_err(String::clone)?));
            next = mover.above;
        }
        chain.reverse();
        let factor = chain.iter().map(|(_, before)| before.1).product();
        let mut sampled = Sampled { chain, poses: Vec::new(), places: &mut self.places };
        sampled.sample()?;
        let motion = Trajectory::new(sampled.poses).map_err(|invalid| invalid.cause)?;
        let motion = Arc::new(motion);
        self.motions.insert(mover, (Arc::clone(&motion), factor));
        Ok((motion, factor))
    }
}

/// A node that is animated.
struct Mover {
    above: Option<usize>,
    /// From the node, unmoved, to the mover above or the world: a pose, and a factor of lengths; or why
    /// what stands on the node has no trajectory.
    before: Result<(Pose, f64), String>,
    rest: (DVec3, DQuat),
    translation: Option<Track>,
    rotation: Option<Track>,
}

impl Mover {
    fn tracks(&self) -> impl Iterator<Item = &Track> {
        self.translation.iter().chain(&self.rotation)
    }

    fn at(&self, time_s: f64) -> Pose {
        let (translation, rotation) = self.rest;
        let at = |track: &Track| track.at(time_s);
        Pose {
            position_m: self.translation.as_ref().map_or(translation, |it| at(it).truncate()),
            rotation: self.rotation.as_ref().map_or(rotation, |it| DQuat::from_vec4(at(it))),
        }
    }
}

/// `map` as a pose after a factor, which is negative for a mirror image, if it scales all axes alike.
fn similar(map: &DAffine3) -> Option<(Pose, f64)> {
    let sign = map.matrix3.determinant().signum();
    let unmirrored = DAffine3 { matrix3: map.matrix3 * sign, ..*map };
    let (pose, scale) = Pose::of_scaled(&unmirrored)?;
    let is_even = scale.max_element() - scale.min_element() <= 1e-5 * scale.max_element();
    is_even.then(|| (pose, sign * scale.element_sum() / 3.0))
}

/// The movers of a node from the outermost on, with their static parts, and the poses over time.
struct Sampled<'a> {
    chain: Vec<(&'a Mover, &'a (Pose, f64))>,
    poses: Vec<(f64, Pose)>,
    places: &'a mut usize,
}

impl Sampled<'_> {
    fn at(&mut self, time_s: f64) -> (f64, Pose) {
        *self.places += self.chain.len();
        let mut factor = 1.0;
        let mut all = Pose::IDENTITY;
        let mut append = |pose: Pose, scale: f64| {
            all.position_m += factor * (all.rotation * pose.position_m);
            all.rotation = (all.rotation * pose.rotation).normalize();
            factor *= scale;
        };
        for (mover, (before, scale)) in &self.chain {
            append(*before, *scale);
            append(mover.at(time_s), 1.0);
        }
        (time_s, all)
    }

    /// Between keys, poses are added until linear motion and constant rotation are within the bound.
    fn sample(&mut self) -> Result<(), String> {
        let all = self.chain.iter().flat_map(|(mover, _)| mover.tracks());
        let mut times: Vec<f64> = all.flat_map(|track| &track.times).copied().collect();
        times.sort_by(f64::total_cmp);
        times.dedup();
        let first = self.at(times[0]);
        self.poses.push(first);
        for [from_s, to_s] in times.array_windows().copied() {
            let jumps = self.chain.iter().flat_map(|(mover, _)| mover.tracks());
            let jumps = jumps.filter(|track| track.kind == Interpolation::Step).count() > 0;
            // A step is a line from the last number before it.
            let last_s = if jumps { to_s.next_down() } else { to_s };
            // Turns of less than half a turn have one shortest arc.
            let parts = self.parts(from_s, last_s);
            for part in 1..=parts {
                let share = part as f64 / parts as f64;
                let at_s = if part == parts { last_s } else { from_s + share * (to_s - from_s) };
                let end = self.at(at_s);
                self.refine(end)?;
            }
            if jumps {
                let next = self.at(to_s);
                self.poses.push(next);
            }
        }
        Ok(())
    }

    /// In how many parts of at most 45 degrees the rotations between two keys are sampled at least.
    fn parts(&self, from_s: f64, to_s: f64) -> usize {
        let turns = self
            .chain
            .iter()
            .map(|(mover, _)| turn(mover.at(from_s).rotation, mover.at(to_s).rotation));
        let least = (turns.sum::<f64>() / std::f64::consts::FRAC_PI_4).ceil() as usize;
        let mut tracks = self.chain.iter().flat_map(|(mover, _)| mover.tracks());
        let is_curved = tracks.any(|track| track.kind == Interpolation::CubicSpline);
        least.max(if is_curved { 8 } else { 1 })
    }

    /// Adds `end`, and before it as many poses as the bound asks for.
    fn refine(&mut self, end: (f64, Pose)) -> Result<(), String> {
        let mut ends = vec![end];
        while let Some(&(end_s, to)) = ends.last() {
            if *self.places > MOST_PLACES {
                let cause = format!("expected motion of {MOST_PLACES} places, found more");
                return Err(cause);
            }
            let (start_s, from) = self.poses[self.poses.len() - 1];
            let middle_s = 0.5 * (start_s + end_s);
            let is_near = [0.25, 0.5, 0.75].into_iter().all(|share| {
                let (_, exact) = self.at(start_s + share * (end_s - start_s));
                let found = from.towards(&to, share);
                let scale = exact.position_m.abs().max_element();
                found.position_m.distance(exact.position_m) <= 0.9 * BOUND_M.max(1e-6 * scale)
                    && turn(found.rotation, exact.rotation) <= 0.9 * BOUND_RAD
            });
            if is_near || middle_s <= start_s || middle_s >= end_s {
                self.poses.extend(ends.pop().filter(|_| end_s > start_s));
            } else {
                ends.push(self.at(middle_s));
            }
        }
        Ok(())
    }
}

/// The angle between two rotations, radians, also where it is small.
fn turn(a: DQuat, b: DQuat) -> f64 {
    let difference = a.conjugate() * b;
    2.0 * libm::atan2(difference.xyz().length(), difference.w.abs())
}
