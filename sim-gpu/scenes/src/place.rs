//! Where the objects of a scene stand.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use edgepuck_shapes::Sampler;
use glam::{DVec2, DVec3};

use crate::footprint::Footprint;
use crate::ground::Ground;
use crate::lanes::Lane;
use crate::recipe::{Objects, Place};
use crate::scene::PlacedObject;

/// How often a place is drawn for an object before the scene goes without it.
const TRIES: usize = 12;

/// The sensor's own vehicle covers this much around it, metres.
pub(crate) const OWN_RADIUS_M: f64 = 1.2;

/// Width of a pavement, metres.
pub(crate) const PAVEMENT_M: [f64; 2] = [1.5, 4.5];

/// How far behind the pavements houses begin, metres.
const FRONT_GARDEN_M: [f64; 2] = [0.0, 6.0];

/// How precisely drivers and builders keep to the road's direction: standard
/// deviation, radians.
const SKEW_RAD: f64 = 0.04;

/// The share of places in a row of parked cars that are free.
const FREE: f64 = 0.25;

/// What goes along the street keeps as far away from what is ahead as it goes in this time,
/// seconds.
const HEADWAY_S: f64 = 0.25;

/// Takes objects into a scene or a block of a street, one after the other.
pub(crate) struct Placing<'a> {
    pub(crate) ground: &'a Ground,
    pub(crate) s: &'a mut Sampler,
    taken: Vec<Footprint>,
    /// Nothing reaches farther along x.
    half_length_m: f64,
    pub(crate) objects: Vec<PlacedObject>,
}

/// An object that has no place yet.
struct Unplaced {
    entry: usize,
    variant: u32,
    scale: DVec3,
    /// Half of its footprint, metres.
    half: DVec2,
}

impl<'a> Placing<'a> {
    pub(crate) fn new(ground: &'a Ground, s: &'a mut Sampler) -> Self {
        let half = DVec2::splat(OWN_RADIUS_M);
        let own = Footprint { centre: DVec2::ZERO, half, yaw_rad: 0.0 };
        Self { ground, s, taken: vec![own], half_length_m: f64::INFINITY, objects: Vec::new() }
    }

    /// In a block of a street, `length_m` long, beside the sensor's way and the `lanes`.
    pub(crate) fn in_block(
        ground: &'a Ground,
        s: &'a mut Sampler,
        length_m: f64,
        lanes: &[Lane],
    ) -> Self {
        let half_length_m = length_m / 2.0;
        let strip = |y_m: f64, half_m: f64| Footprint {
            centre: DVec2::new(0.0, y_m),
            half: DVec2::new(half_length_m, half_m),
            yaw_rad: 0.0,
        };
        let mut taken = vec![strip(0.0, OWN_RADIUS_M)];
        taken.extend(lanes.iter().map(|lane| strip(lane.y_m, lane.half_m)));
        Self { ground, s, taken, half_length_m, objects: Vec::new() }
    }

    /// In a block of a lane, `length_m` long.
    pub(crate) fn in_lane(ground: &'a Ground, s: &'a mut Sampler, length_m: f64) -> Self {
        let half_length_m = length_m / 2.0;
        Self { ground, s, taken: Vec::new(), half_length_m, objects: Vec::new() }
    }

    /// Places the objects of one entry of a recipe, number `entry`, of which there
    /// are `n_variants`; `size` tells how large one is.
    pub(crate) fn place(
        &mut self,
        entry: usize,
        objects: &Objects,
        n_variants: u32,
        size: impl Fn(u32) -> DVec3,
    ) {
        let mut queue = self.draw(entry, objects, n_variants, size);
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

    /// Places those objects of one entry, as [`Placing::place`] draws them, that go in `lane`:
    /// a `share` of them.
    pub(crate) fn place_in(
        &mut self,
        lane: &Lane,
        share: f64,
        entry: usize,
        objects: &Objects,
        n_variants: u32,
        size: impl Fn(u32) -> DVec3,
    ) {
        let headway_m = HEADWAY_S * lane.velocity_m_s.abs();
        let heading_rad = if lane.velocity_m_s < 0.0 { PI } else { 0.0 };
        for mut object in self.draw(entry, objects, n_variants, size) {
            if !self.s.chance(share) {
                continue;
            }
            let beside_m = lane.half_m - object.half.y;
            object.half.x += headway_m;
            for _ in 0..TRIES {
                let x_m = self.half_length_m * self.s.uniform(-1.0, 1.0);
                let y_m = lane.y_m + beside_m * self.s.uniform(-1.0, 1.0);
                if self.try_at(&object, DVec2::new(x_m, y_m), heading_rad) {
                    break;
                }
            }
        }
    }

    /// Draws the objects of one entry.
    fn draw(
        &mut self,
        entry: usize,
        objects: &Objects,
        n_variants: u32,
        size: impl Fn(u32) -> DVec3,
    ) -> Vec<Unplaced> {
        let [least, most] = objects.count.map(|n| n as usize);
        let n = self.s.count(least, most);
        (0..n)
            .map(|_| {
                let variant = self.s.count(0, n_variants as usize - 1) as u32;
                let scale = DVec3::from_array([(); 3].map(|()| self.within(objects.scale)));
                let half = (size(variant) * scale / 2.0).truncate();
                Unplaced { entry, variant, scale, half }
            })
            .collect()
    }

    fn within(&mut self, span: crate::recipe::Span) -> f64 {
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

    /// Takes `object` if it is free there.
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

    /// Places each object by itself.
    fn scatter(
        &mut self,
        objects: &Objects,
        queue: Vec<Unplaced>,
        draw: fn(&mut Self, &Objects) -> (DVec2, f64),
    ) {
        for object in queue {
            for _ in 0..TRIES {
                let (centre, yaw_rad) = draw(self, objects);
                if self.try_at(&object, centre, yaw_rad) {
                    break;
                }
            }
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
        // Traffic keeps to its side.
        let heading_rad = if y_m > road_y_m { PI } else { 0.0 };
        (DVec2::new(x_m, y_m), heading_rad + self.skew())
    }

    /// Some objects around one point of a pavement.
    fn group(&mut self, objects: &Objects, group: Vec<Unplaced>) {
        let side = self.side();
        let beside_m = self.s.uniform(0.3, PAVEMENT_M[1]);
        let y_m = self.ground.road_y_m + side * (self.ground.road_half_m + beside_m);
        let anchor = DVec2::new(self.side() * self.distance(objects), y_m);
        let heading_rad = self.s.uniform(0.0, TAU);
        for object in group {
            for _ in 0..TRIES {
                let off = DVec2::from_angle(self.s.uniform(0.0, TAU))
                    * (object.half.max_element() + self.within(objects.gap_m));
                let yaw_rad = heading_rad + self.s.uniform(-0.5, 0.5);
                if self.try_at(&object, anchor + off, yaw_rad) {
                    break;
                }
            }
        }
    }

    /// Rows along the road, on both sides. `stand` says how far from the road's
    /// edge an object's middle is, and how it is turned; `free` is the share of
    /// places that are left out.
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
                    // A house keeps its front to the road.
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

/// What the objects of one row have in common.
struct RowStyle {
    /// On which side of the road the row is, 1 or -1.
    side: f64,
    /// Whether cars are parked across the road's direction.
    across: bool,
    /// Width of the pavement, metres.
    pavement_m: f64,
    /// Depth of what is between the pavement and a house, metres.
    garden_m: f64,
}
