use std::f64::consts::{FRAC_PI_2, PI, TAU};

use edgepuck_shapes::Sampler;
use glam::{DVec2, DVec3};

use crate::footprint::Footprint;
use crate::ground::{Ground, PAVEMENT_M};
use crate::lanes::Lane;
use crate::placed_object::PlacedObject;
use crate::recipe::{Objects, Place, SCALE, Span};
use crate::stage::Stage;

/// How many places are drawn for an object before it is left out.
const MAX_TRIES: usize = 12;

/// The least and the greatest distance of a house from its pavement, metres.
const FRONT_GARDEN_M: [f64; 2] = [0.0, 6.0];

/// The standard deviation of an object's direction from that of the road, radians.
const SKEW_RAD: f64 = 0.04;

/// The fraction of free places in a row of parked cars.
const FREE: f64 = 0.25;

/// The least time between two objects in a lane, seconds.
const HEADWAY_S: f64 = 0.25;

/// Places objects one after the other in a scene or in a block of a street.
pub(crate) struct Placer<'a> {
    stage: &'a Stage,
    ground: &'a Ground,
    s: &'a mut Sampler,
    taken: Vec<Footprint>,
    /// The greatest |x| of an object.
    half_length_m: f64,
    pub(crate) objects: Vec<PlacedObject>,
}

/// An object without a place.
struct Unplaced {
    entry: usize,
    variant: u32,
    scale: DVec3,
    /// Half the size of its footprint, metres.
    half: DVec2,
}

impl<'a> Placer<'a> {
    /// Starts without objects. The places in `taken` stay free.
    pub(crate) fn new(
        stage: &'a Stage,
        ground: &'a Ground,
        s: &'a mut Sampler,
        half_length_m: f64,
        taken: Vec<Footprint>,
    ) -> Self {
        Self { stage, ground, s, taken, half_length_m, objects: Vec::new() }
    }

    pub(crate) fn place(&mut self, entry: usize) {
        let objects = &self.stage.recipe().object[entry];
        let mut queue = self.draw(entry);
        match objects.place {
            Place::Anywhere => self.scatter(objects, queue, Self::anywhere),
            Place::Road => self.scatter(objects, queue, Self::on_road),
            Place::Front => self.rows(objects, queue, 0.0, Self::front),
            Place::Line => self.rows(objects, queue, 0.0, Self::line),
            Place::Parked => self.rows(objects, queue, FREE, Self::parked),
            Place::Pavement => {
                while !queue.is_empty() {
                    let size = self.s.count(1, 4).min(queue.len());
                    let group = queue.split_off(queue.len() - size);
                    self.group(objects, group);
                }
            }
        }
    }

    /// Places a `share` of the objects of entry number `entry` in `lane`.
    pub(crate) fn place_in(&mut self, lane: &Lane, share: f64, entry: usize) {
        let headway_m = HEADWAY_S * lane.velocity_m_s.abs();
        let heading_rad = if lane.velocity_m_s < 0.0 { PI } else { 0.0 };
        for mut object in self.draw(entry) {
            if !self.s.chance(share) {
                continue;
            }
            let beside_m = lane.half_m - object.half.y;
            object.half.x += headway_m;
            self.try_drawn(&object, |placer| {
                let x_m = placer.half_length_m * placer.s.uniform(-1.0, 1.0);
                let y_m = lane.y_m + beside_m * placer.s.uniform(-1.0, 1.0);
                (DVec2::new(x_m, y_m), heading_rad)
            });
        }
    }

    fn draw(&mut self, entry: usize) -> Vec<Unplaced> {
        let stage = self.stage;
        let objects = &stage.recipe().object[entry];
        let [least, most] = objects.count.map(|n| n as usize);
        let n = self.s.count(least, most);
        (0..n)
            .map(|_| {
                let variant = self.s.count(0, stage.variants(entry) as usize - 1) as u32;
                let scale = DVec3::from_array([(); 3].map(|()| self.within(SCALE)));
                let half = (stage.model(entry, variant).size_m * scale / 2.0).truncate();
                Unplaced { entry, variant, scale, half }
            })
            .collect()
    }

    fn within(&mut self, span: Span) -> f64 {
        span.at(self.s.uniform(0.0, 1.0))
    }

    fn side(&mut self) -> f64 {
        if self.s.chance(0.5) { 1.0 } else { -1.0 }
    }

    fn skew(&mut self) -> f64 {
        SKEW_RAD * 3f64.sqrt() * self.s.uniform(-1.0, 1.0)
    }

    fn distance(&mut self, objects: &Objects) -> f64 {
        objects.distance_m.at_log(self.s.uniform(0.0, 1.0))
    }

    /// Places `object` if nothing else is there, and returns whether it did.
    fn try_at(&mut self, object: &Unplaced, centre: DVec2, yaw_rad: f64) -> bool {
        let footprint = Footprint { centre, half: object.half, yaw_rad };
        if centre.x.abs() + footprint.reach(DVec2::X) > self.half_length_m {
            return false;
        }
        if self.taken.iter().any(|other| other.meets(&footprint)) {
            return false;
        }
        self.taken.push(footprint);
        let &Unplaced { entry, variant, scale, .. } = object;
        let position = centre.extend(self.ground.height_m(centre));
        self.objects.push(PlacedObject { entry, variant, scale, yaw_rad, position });
        true
    }

    /// Places `object` at the first free one of the places that `draw` returns.
    fn try_drawn(&mut self, object: &Unplaced, draw: impl Fn(&mut Self) -> (DVec2, f64)) {
        let _ = (0..MAX_TRIES).any(|_| {
            let (centre, yaw_rad) = draw(self);
            self.try_at(object, centre, yaw_rad)
        });
    }

    /// Places each object on its own.
    fn scatter(
        &mut self,
        objects: &Objects,
        queue: Vec<Unplaced>,
        draw: fn(&mut Self, &Objects) -> (DVec2, f64),
    ) {
        for object in queue {
            self.try_drawn(&object, |placer| draw(placer, objects));
        }
    }

    fn anywhere(&mut self, objects: &Objects) -> (DVec2, f64) {
        let azimuth_rad = self.s.uniform(0.0, TAU);
        let centre = DVec2::from_angle(azimuth_rad) * self.distance(objects);
        (centre, self.s.uniform(0.0, TAU))
    }

    fn on_road(&mut self, objects: &Objects) -> (DVec2, f64) {
        let Ground { road_y_m, road_half_m, .. } = *self.ground;
        let y_m = road_y_m + road_half_m * self.s.uniform(-0.8, 0.8);
        let x_m = self.side() * self.distance(objects);
        // Traffic keeps to the right.
        let heading_rad = if y_m > road_y_m { PI } else { 0.0 };
        (DVec2::new(x_m, y_m), heading_rad + self.skew())
    }

    /// Places a group of objects around one point of a pavement.
    fn group(&mut self, objects: &Objects, group: Vec<Unplaced>) {
        let side = self.side();
        let beside_m = self.s.uniform(0.3, PAVEMENT_M[1]);
        let y_m = self.ground.road_y_m + side * (self.ground.road_half_m + beside_m);
        let anchor = DVec2::new(self.side() * self.distance(objects), y_m);
        let heading_rad = self.s.uniform(0.0, TAU);
        for object in group {
            self.try_drawn(&object, |placer| {
                let off = DVec2::from_angle(placer.s.uniform(0.0, TAU))
                    * (object.half.max_element() + placer.within(objects.gap_m));
                (anchor + off, heading_rad + placer.s.uniform(-0.5, 0.5))
            });
        }
    }

    /// Places objects in rows along both sides of the road. `stand` returns the distance of an
    /// object's middle from the edge of the road, and its yaw; `free` is the fraction of places
    /// that stay empty.
    fn rows(
        &mut self,
        objects: &Objects,
        queue: Vec<Unplaced>,
        free: f64,
        stand: fn(&Unplaced, &RowStyle) -> (f64, f64),
    ) {
        let mut queue = queue.into_iter();
        for side in [-1.0, 1.0] {
            let style = RowStyle {
                side,
                across: self.s.chance(0.3),
                pavement_m: self.s.uniform(PAVEMENT_M[0], PAVEMENT_M[1]),
                garden_m: self.s.uniform(FRONT_GARDEN_M[0], FRONT_GARDEN_M[1]),
            };
            let end_m = objects.distance_m.most.min(self.half_length_m);
            let mut x_m = -end_m * self.s.uniform(0.0, 1.0);
            let share = if side < 0.0 { queue.len() / 2 } else { queue.len() };
            for object in queue.by_ref().take(share) {
                while self.s.chance(free) {
                    x_m += 2.0 * object.half.max_element();
                }
                let (beside_m, yaw_rad) = stand(&object, &style);
                let turned = DVec2::from_angle(yaw_rad).abs();
                let half_m = object.half.dot(turned);
                let y_m = self.ground.road_y_m + side * (self.ground.road_half_m + beside_m);
                x_m += half_m;
                if x_m > end_m {
                    break;
                }
                let centre = DVec2::new(x_m, y_m);
                if centre.length() >= objects.distance_m.least {
                    // Houses always face the road.
                    let is_turned = self.s.chance(0.5) && objects.place != Place::Front;
                    let heading_rad = yaw_rad + if is_turned { PI } else { 0.0 };
                    let skew_rad = self.skew();
                    self.try_at(&object, centre, heading_rad + skew_rad);
                }
                x_m += half_m + self.within(objects.gap_m);
            }
        }
    }

    fn parked(object: &Unplaced, style: &RowStyle) -> (f64, f64) {
        let yaw_rad = if style.across { FRAC_PI_2 } else { 0.0 };
        let half_m = if style.across { object.half.x } else { object.half.y };
        // Wheels stand at the kerb, on the road.
        (-half_m - 0.15, yaw_rad)
    }

    fn line(object: &Unplaced, style: &RowStyle) -> (f64, f64) {
        let is_long = object.half.x >= object.half.y;
        let yaw_rad = if is_long { 0.0 } else { FRAC_PI_2 };
        (style.pavement_m + object.half.min_element(), yaw_rad)
    }

    fn front(object: &Unplaced, style: &RowStyle) -> (f64, f64) {
        let beside_m = style.pavement_m + style.garden_m + object.half.x;
        (beside_m, -style.side * FRAC_PI_2)
    }
}

struct RowStyle {
    /// The side of the road, 1 or -1.
    side: f64,
    /// Whether cars are parked across the road.
    across: bool,
    pavement_m: f64,
    garden_m: f64,
}
