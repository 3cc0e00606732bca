//! The lanes of a street. All that goes in one lane keeps its speed, and lanes lie beside each
//! other, so that nothing that moves meets anything.

use edgepuck_shapes::Sampler;

use crate::ground::Ground;
use crate::place::{OWN_RADIUS_M, PAVEMENT_M};
use crate::recipe::{Place, Recipe, Span};
use crate::stage::Stage;

/// Lanes leave this much of the road to parked cars on each side where there is room, metres.
const PARKING_M: f64 = 2.2;

/// How far the first walkers keep from the kerb, metres.
const KERB_DISTANCE_M: f64 = 0.3;

/// Space between the widest object of a lane and its edges, metres.
const MARGIN_M: f64 = 0.15;

/// A strip along x.
pub(crate) struct Lane {
    /// Where its middle is.
    pub(crate) y_m: f64,
    /// Half of its width.
    pub(crate) half_m: f64,
    /// Along x, metres a second.
    pub(crate) velocity_m_s: f64,
    /// Which of the recipe's `[[object]]` go in it.
    pub(crate) entries: Vec<usize>,
}

/// The room for lanes on one side of the road.
struct Room<'a> {
    stage: &'a Stage,
    ground: &'a Ground,
    /// 1 or -1.
    side: f64,
    /// Where the next lane may begin, metres from the middle of the road.
    next_m: f64,
}

/// The lanes of a street on `ground`, of what moves in the recipe. What has no room for a lane
/// has none.
pub(crate) fn lanes(stage: &Stage, ground: &Ground, s: &mut Sampler) -> Vec<Lane> {
    let mut lanes = Vec::new();
    for side in [-1.0, 1.0] {
        let mut room = Room { stage, ground, side, next_m: 0.0 };
        for group in groups(stage.recipe(), Place::Road) {
            // The sensor's way is the first on its side.
            let is_first = side > 0.0 && room.next_m == 0.0;
            let end_m = ground.road_half_m - if is_first { 0.0 } else { PARKING_M };
            // Traffic keeps to its side.
            lanes.extend(room.lane(group, -side, end_m, s));
        }
        room.next_m = ground.road_half_m + KERB_DISTANCE_M;
        for direction in [-side, side] {
            for group in groups(stage.recipe(), Place::Pavement) {
                let end_m = ground.road_half_m + PAVEMENT_M[1];
                lanes.extend(room.lane(group, direction, end_m, s));
            }
        }
    }
    lanes
}

/// What moves at `place`, by what can go at one speed: the speeds, and the entries.
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

impl Room<'_> {
    /// A lane for what goes at `speeds`, beside the sensor's way, up to `end_m` from the middle
    /// of the road.
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

    /// How wide an object of this entry is at most.
    fn widest_m(&self, entry: usize) -> f64 {
        let width_m = |variant| self.stage.prop(entry, variant).size_m.y;
        let widest_m = (0..self.stage.variants(entry)).map(width_m).fold(0.0, f64::max);
        widest_m * self.stage.recipe().object[entry].scale.most
    }
}
