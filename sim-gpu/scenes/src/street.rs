//! An endless street, drawn block by block as far as it is in sight.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use edgepuck_shapes::Sampler;
use formats::rng::StreamKey;
use glam::DVec3;
use sim_gpu::bvh::Builder;
use sim_gpu::target::Target;

use crate::ground::Ground;
use crate::lanes::{Lane, lanes};
use crate::place::Placing;
use crate::scene::PlacedObject;
use crate::stage::{Stage, whole};

/// Something in a street, which stands or goes straight on.
#[derive(Clone, Debug)]
pub struct Body {
    /// The object, at time 0.
    pub object: PlacedObject,
    /// Its length, width and height, metres.
    pub size_m: DVec3,
    /// Metres a second.
    pub velocity_m_s: DVec3,
}

impl Body {
    /// Of a sphere around that middle that holds it.
    pub(crate) fn radius_m(&self) -> f64 {
        self.size_m.length() / 2.0
    }

    /// The middle of its box at `time_s`.
    #[must_use]
    pub fn centre_m(&self, time_s: f64) -> DVec3 {
        let position = self.object.position + self.velocity_m_s * time_s;
        position + DVec3::new(0.0, 0.0, self.size_m.z / 2.0)
    }
}

/// A street along x.
pub(crate) struct Street<'a> {
    pub(crate) stage: &'a Stage,
    pub(crate) ground: Ground,
    lanes: Vec<Lane>,
    /// Length of each block.
    block_m: f64,
    /// The blocks that were drawn: of what stands, then of each lane.
    drawn: Vec<Option<RangeInclusive<i32>>>,
    /// What was drawn, in an order that never changes.
    pub(crate) bodies: Vec<Body>,
    /// The parts of the ground that are in sight.
    pub(crate) parts: BTreeMap<i32, Target>,
}

impl<'a> Street<'a> {
    pub(crate) fn new(stage: &'a Stage, ground: Ground, s: &mut Sampler) -> Self {
        let lanes = lanes(stage, &ground, s);
        let drawn = vec![None; 1 + lanes.len()];
        let farthest_m = stage.recipe().object.iter().map(|objects| objects.distance_m.most);
        // As far as a scene of the recipe reaches.
        let block_m = 2.0 * farthest_m.fold(0.0, f64::max);
        let (bodies, parts) = (Vec::new(), BTreeMap::new());
        Self { stage, ground, lanes, block_m, drawn, bodies, parts }
    }

    /// Draws what is in sight from each of these places along x at its time.
    pub(crate) fn draw_around(&mut self, places: [(f64, f64); 2]) {
        for belt in 0..self.drawn.len() {
            let velocity_m_s = belt.checked_sub(1).map_or(0.0, |i| self.lanes[i].velocity_m_s);
            let block = |(x_m, time_s): (f64, f64), to_m: f64| {
                ((x_m + to_m - velocity_m_s * time_s) / self.block_m).round() as i32
            };
            let ends = [-self.ground.half_m, self.ground.half_m]
                .map(|to_m| places.map(|place| block(place, to_m)));
            let (mut first, mut last) = (ends[0][0].min(ends[0][1]), ends[1][0].max(ends[1][1]));
            let before = self.drawn[belt].take();
            if let Some(before) = &before {
                // Drawn without gaps, so that each block is drawn once.
                (first, last) = (first.min(*before.start()), last.max(*before.end()));
            }
            for number in first..=last {
                if !before.as_ref().is_some_and(|before| before.contains(&number)) {
                    self.draw_block(belt, number);
                }
            }
            self.drawn[belt] = Some(first..=last);
        }
        let in_sight = places.map(|(x_m, _)| self.parts_in_sight(x_m));
        self.parts.retain(|number, _| in_sight.iter().any(|parts| parts.contains(number)));
        for number in in_sight.into_iter().flatten() {
            let mesh = || self.ground.part(number, self.block_m);
            let target = || Target::new(whole(mesh()), Builder::Morton);
            self.parts.entry(number).or_insert_with(target);
        }
    }

    /// The numbers of the parts of the ground that are in sight from `x_m`.
    pub(crate) fn parts_in_sight(&self, x_m: f64) -> RangeInclusive<i32> {
        let part = |x_m: f64| (x_m / self.block_m).floor() as i32;
        part(x_m - self.ground.half_m)..=part(x_m + self.ground.half_m)
    }

    /// Draws one block of a lane, or of what stands.
    fn draw_block(&mut self, belt: usize, number: i32) {
        let Self { stage, ground, lanes, block_m, .. } = &*self;
        let lane = belt.checked_sub(1).map(|i| &lanes[i]);
        let name = format!("drive/block/{belt}");
        let s = &mut Sampler::new(StreamKey::new(stage.seed(), &name, number as u32));
        let mut placing = match lane {
            None => Placing::in_block(ground, s, *block_m, lanes),
            Some(_) => Placing::in_lane(ground, s, *block_m),
        };
        for (entry, objects) in stage.recipe().object.iter().enumerate() {
            let size = |variant| stage.prop(entry, variant).size_m;
            let n_variants = stage.variants(entry);
            let has_it = |lane: &&Lane| lane.entries.contains(&entry);
            match lane {
                None if !objects.moves() => placing.place(entry, objects, n_variants, size),
                Some(lane) if has_it(&lane) => {
                    let share = 1.0 / lanes.iter().filter(has_it).count() as f64;
                    placing.place_in(lane, share, entry, objects, n_variants, size);
                }
                _ => {}
            }
        }
        let from_origin = ground.along(f64::from(number) * block_m);
        let velocity_m_s = ground.along(lane.map_or(0.0, |lane| lane.velocity_m_s));
        let bodies = placing.objects.into_iter().map(|mut object| {
            object.position += from_origin;
            Body { size_m: stage.size_of(&object), object, velocity_m_s }
        });
        let bodies: Vec<Body> = bodies.collect();
        self.bodies.extend(bodies);
    }
}
