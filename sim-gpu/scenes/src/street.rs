//! An endless street, drawn block by block where the sensor can see it.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;

use edgepuck_shapes::Sampler;
use formats::streams::Stream;
use glam::{DVec2, DVec3};
use sim_gpu::Mesh;
use sim_gpu::internals::bvh::Builder;

use crate::footprint::Footprint;
use crate::ground::{Ground, OWN_RADIUS_M};
use crate::lanes::{Lane, lanes};
use crate::model::shared;
use crate::place::Placer;
use crate::placed_object::PlacedObject;
use crate::stage::Stage;

/// An object in a street, which stands or moves at a constant velocity.
#[derive(Clone, Debug)]
pub struct StreetObject {
    /// The object and its place at time 0.
    pub placed: PlacedObject,
    /// Its length, width and height, metres.
    pub size_m: DVec3,
    /// Its velocity, metres a second.
    pub velocity_m_s: DVec3,
}

impl StreetObject {
    pub(crate) fn radius_m(&self) -> f64 {
        self.size_m.length() / 2.0
    }

    /// The centre of its box at `time_s`, metres.
    #[must_use]
    pub fn centre_m(&self, time_s: f64) -> DVec3 {
        let position = self.placed.position + self.velocity_m_s * time_s;
        position + DVec3::new(0.0, 0.0, self.size_m.z / 2.0)
    }
}

/// A street along x.
pub(crate) struct Street<'a> {
    pub(crate) stage: &'a Stage,
    pub(crate) ground: Ground,
    lanes: Vec<Lane>,
    block_m: f64,
    /// The numbers of the blocks drawn so far, by layer. Layer 0 holds the objects that stand,
    /// layer `1 + i` those that move in lane `i`.
    drawn: Vec<Option<RangeInclusive<i32>>>,
    /// The objects drawn so far. New ones are appended, so that an index stays valid.
    pub(crate) objects: Vec<StreetObject>,
    /// The tiles of the ground in sight, by number.
    pub(crate) tiles: BTreeMap<i32, Mesh>,
}

impl<'a> Street<'a> {
    pub(crate) fn new(stage: &'a Stage, ground: Ground, s: &mut Sampler) -> Self {
        let lanes = lanes(stage, &ground, s);
        let drawn = vec![None; 1 + lanes.len()];
        let farthest_m = stage.recipe().object.iter().map(|objects| objects.distance_m.most);
        // A block is as long as a scene of the recipe.
        let block_m = 2.0 * farthest_m.fold(0.0, f64::max);
        let (objects, tiles) = (Vec::new(), BTreeMap::new());
        Self { stage, ground, lanes, block_m, drawn, objects, tiles }
    }

    /// Draws everything in sight of a sensor at two places, each given as x and the time.
    pub(crate) fn draw_around(&mut self, places: [(f64, f64); 2]) {
        for layer in 0..self.drawn.len() {
            let velocity_m_s = layer.checked_sub(1).map_or(0.0, |i| self.lanes[i].velocity_m_s);
            let block = |(x_m, time_s): (f64, f64), to_m: f64| {
                ((x_m + to_m - velocity_m_s * time_s) / self.block_m).round() as i32
            };
            let ends = [-self.ground.half_m, self.ground.half_m]
                .map(|to_m| places.map(|place| block(place, to_m)));
            let (mut first, mut last) = (ends[0][0].min(ends[0][1]), ends[1][0].max(ends[1][1]));
            let before = self.drawn[layer].take();
            if let Some(before) = &before {
                // The range has no gaps, so that no block is drawn twice.
                (first, last) = (first.min(*before.start()), last.max(*before.end()));
            }
            for number in first..=last {
                if !before.as_ref().is_some_and(|before| before.contains(&number)) {
                    self.draw_block(layer, number);
                }
            }
            self.drawn[layer] = Some(first..=last);
        }
        let in_sight = places.map(|(x_m, _)| self.tiles_in_sight(x_m));
        self.tiles.retain(|number, _| in_sight.iter().any(|tiles| tiles.contains(number)));
        for number in in_sight.into_iter().flatten() {
            let mesh = || self.ground.tile(number, self.block_m);
            self.tiles.entry(number).or_insert_with(|| shared(mesh(), Builder::Morton));
        }
    }

    /// The numbers of the ground's tiles in sight from `x_m`.
    pub(crate) fn tiles_in_sight(&self, x_m: f64) -> RangeInclusive<i32> {
        let tile = |x_m: f64| (x_m / self.block_m).floor() as i32;
        tile(x_m - self.ground.half_m)..=tile(x_m + self.ground.half_m)
    }

    fn draw_block(&mut self, layer: usize, number: i32) {
        let Self { stage, ground, lanes, block_m, .. } = &*self;
        let lane = layer.checked_sub(1).map(|i| &lanes[i]);
        let stream = Stream::DriveBlock { layer, block: number as u32 };
        let s = &mut Sampler::new(stream.key(stage.seed()));
        let half_m = block_m / 2.0;
        let mut taken = Vec::new();
        if lane.is_none() {
            let strip = |y_m, half_y_m| {
                Footprint::level(DVec2::new(0.0, y_m), DVec2::new(half_m, half_y_m))
            };
            taken.push(strip(0.0, OWN_RADIUS_M));
            taken.extend(lanes.iter().map(|lane| strip(lane.y_m, lane.half_m)));
        }
        let mut placer = Placer::new(stage, ground, s, half_m, taken);
        for (entry, objects) in stage.recipe().object.iter().enumerate() {
            let has_entry = |lane: &&Lane| lane.entries.contains(&entry);
            match lane {
                None if !objects.moves() => placer.place(entry),
                Some(lane) if has_entry(&lane) => {
                    let share = 1.0 / lanes.iter().filter(has_entry).count() as f64;
                    placer.place_in(lane, share, entry);
                }
                _ => {}
            }
        }
        let from_origin = ground.along(f64::from(number) * block_m);
        let velocity_m_s = ground.along(lane.map_or(0.0, |lane| lane.velocity_m_s));
        let objects = placer.objects.into_iter().map(|mut placed| {
            placed.position += from_origin;
            StreetObject { size_m: stage.size_of(&placed), placed, velocity_m_s }
        });
        let objects: Vec<StreetObject> = objects.collect();
        self.objects.extend(objects);
    }
}
