//! The lanes of a street. All objects in a lane have the same velocity, and lanes do not overlap,
//! so that moving objects never collide.

use edgepuck_shapes::Sampler;

use crate::ground::{Ground, OWN_RADIUS_M, PAVEMENT_M};
use crate::recipe::{Place, Recipe, SCALE, Span};
use crate::stage::Stage;

/// The strip at each edge of the road that lanes leave to parked cars, metres.
const PARKING_M: f64 = 2.2;

/// The distance of the first lane on a pavement from the kerb, metres.
const KERB_DISTANCE_M: f64 = 0.3;

/// The space between the widest object of a lane and the lane's edges, metres.
const MARGIN_M: f64 = 0.15;

/// A strip along x, in which objects move.
pub(crate) struct Lane {
    /// y of its middle.
    pub(crate) y_m: f64,
    pub(crate) half_m: f64,
    pub(crate) velocity_m_s: f64,
    /// The entries of the recipe whose objects move in it.
    pub(crate) entries: Vec<usize>,
}

/// One side of a street, filled with lanes from the middle of the road outwards.
struct StreetSide<'a> {
    stage: &'a Stage,
    ground: &'a Ground,
    /// The sign of y, 1 or -1.
    side: f64,
    /// Where the next lane may begin, metres from the middle of the road.
    next_m: f64,
}

/// Draws the lanes of a street on `ground` for the moving objects of the recipe. A lane that does
/// not fit is left out.
pub(crate) fn lanes(stage: &Stage, ground: &Ground, s: &mut Sampler) -> Vec<Lane> {
    let mut lanes = Vec::new();
    for side in [-1.0, 1.0] {
        let mut street_side = StreetSide { stage, ground, side, next_m: 0.0 };
        for group in groups(stage.recipe(), Place::Road) {
            // On the right, the sensor's own way takes the place of the first lane.
            let is_first = side > 0.0 && street_side.next_m == 0.0;
            let end_m = ground.road_half_m - if is_first { 0.0 } else { PARKING_M };
            // Traffic keeps to the right.
            lanes.extend(street_side.lane(group, -side, end_m, s));
        }
        street_side.next_m = ground.road_half_m + KERB_DISTANCE_M;
        for direction in [-side, side] {
            for group in groups(stage.recipe(), Place::Pavement) {
                let end_m = ground.road_half_m + PAVEMENT_M[1];
                lanes.extend(street_side.lane(group, direction, end_m, s));
            }
        }
    }
    lanes
}

/// The entries that move at `place`, grouped so that the entries of a group have speeds in
/// common, and these speeds.
fn groups(recipe: &Recipe, place: Place) -> Vec<(Span, Vec<usize>)> {
    let mut groups: Vec<(Span, Vec<usize>)> = Vec::new();
    let moving = recipe.object.iter().enumerate();
    for (entry, objects) in moving.filter(|(_, o)| o.moves() && o.place == place) {
        let common = |other: &Span| Span {
            least: other.least.max(objects.speed_m_s.least),
            most: other.most.min(objects.speed_m_s.most),
        };
        match groups.iter_mut().find(|(speeds, _)| common(speeds).least < common(speeds).most) {
            Some((speeds, entries)) => {
                *speeds = common(speeds);
                entries.push(entry);
            }
            None => groups.push((objects.speed_m_s, vec![entry])),
        }
    }
    groups
}

impl StreetSide<'_> {
    /// Draws a lane for a group of entries with common `speeds`. It leaves the sensor's own way
    /// free and ends at most `end_m` from the middle of the road; `None` if it does not fit.
    fn lane(
        &mut self,
        (speeds, entries): (Span, Vec<usize>),
        direction: f64,
        end_m: f64,
        s: &mut Sampler,
    ) -> Option<Lane> {
        let half_m =
            entries.iter().map(|&entry| self.widest_m(entry)).fold(0.0, f64::max) / 2.0 + MARGIN_M;
        let speed_m_s = speeds.at(s.uniform(0.0, 1.0));
        let own_m = -self.side * self.ground.road_y_m;
        let meets_own =
            self.next_m < own_m + OWN_RADIUS_M && own_m - OWN_RADIUS_M < self.next_m + 2.0 * half_m;
        let from_m = if meets_own { own_m + OWN_RADIUS_M } else { self.next_m };
        let to_m = from_m + 2.0 * half_m;
        (to_m <= end_m).then(|| {
            self.next_m = to_m;
            let y_m = self.ground.road_y_m + self.side * (from_m + half_m);
            Lane { y_m, half_m, velocity_m_s: direction * speed_m_s, entries }
        })
    }

    /// The width of the widest object of this entry.
    fn widest_m(&self, entry: usize) -> f64 {
        let width_m = |variant| self.stage.model(entry, variant).size_m.y;
        let widest_m = (0..self.stage.variants(entry)).map(width_m).fold(0.0, f64::max);
        widest_m * SCALE.most
    }
}
