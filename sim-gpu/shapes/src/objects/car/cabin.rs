//! The cabin above the lower edge of the windows: screens, side windows, pillars, roof.

use super::body::Body;
use super::form::{Form, Style};
use super::panel::{Column, lid, wall};
use crate::primitives::{Builder, DVec3, Sampler, dvec3};

/// The right half of the cabin, as columns from the middle of the rear window to the middle of the
/// windscreen.
pub struct Cabin {
    columns: Vec<Column>,
    crown_m: f64,
}

struct Roof<'a> {
    form: &'a Form,
    half_y: f64,
    /// How much lower the roof is at its sides and at its ends.
    fall_m: [f64; 2],
}

impl Roof<'_> {
    fn at(&self, x: f64, y: f64) -> DVec3 {
        let [front, rear] = [self.form.screen[1], self.form.rear[1]];
        let along = (x - 0.6 * front - 0.4 * rear) / (front - rear).max(0.5);
        let [side_m, end_m] = self.fall_m;
        let fall_m = side_m * (y / self.half_y).powi(2) + end_m * 2.0 * along * along;
        dvec3(x, y, self.form.height_m - fall_m)
    }
}

impl Cabin {
    pub fn draw(s: &mut Sampler, form: &Form, body: &Body) -> Self {
        let boxy = form.style.is_boxy();
        let fall_m = if boxy {
            [s.uniform(0.05, 0.12), s.uniform(0.01, 0.04)]
        } else {
            [s.uniform(0.04, 0.09), s.uniform(0.02, 0.07)]
        };
        let roof = Roof { form, half_y: form.roof_share * form.half.y, fall_m };
        let mut columns = Vec::new();
        let [rear_foot, rear_head] = form.rear;
        let has_rear_pane = !boxy || s.chance(0.6);
        let rear_band = [s.uniform(0.06, 0.25), s.uniform(0.86, 0.94)];
        let bow_m = s.uniform(0.04, 0.12);
        let pane = has_rear_pane.then_some(rear_band);
        for share in [0.0, 0.5, 1.0] {
            let bow_m = bow_m * share * share;
            let y = -0.8 * share * body.shoulder_y(rear_foot + 0.12).min(form.half.y);
            let foot_x = rear_foot + bow_m;
            let head = roof.at(rear_head + 0.6 * bow_m, -0.84 * share * roof.half_y);
            let foot = dvec3(foot_x, y, form.top_m(foot_x));
            columns.push(Column { foot, head, pane: pane.filter(|_| share < 1.0) });
        }
        columns.extend(side(s, &roof, body, bow_m));
        let bow_m = s.uniform(0.06, 0.2);
        for share in [1.0, 0.5, 0.0] {
            let [foot_x, head_x] = [form.screen[0], form.screen[1]];
            let x = foot_x - bow_m * share * share;
            let foot = dvec3(x, -0.86 * share * body.shoulder_y(foot_x), form.top_m(x) + 0.01);
            let x = head_x - 0.5 * bow_m * share * share;
            let head = roof.at(x, -0.88 * share * roof.half_y);
            columns.push(Column { foot, head, pane: Some([0.02, 0.96]) });
        }
        Self { columns, crown_m: fall_m[0] }
    }

    pub fn build(&self, b: &mut Builder) {
        b.mirrored_y(|b| wall(b, &self.columns));
        let heads: Vec<_> = self.columns.iter().map(|column| column.head).collect();
        lid(b, &heads, 0.7 * self.crown_m);
    }
}

/// The columns of the right side from the rear to the front.
fn side(s: &mut Sampler, roof: &Roof, body: &Body, rear_bow_m: f64) -> Vec<Column> {
    let form = roof.form;
    let feet = [form.rear[0] + rear_bow_m + 0.06, form.screen[0] - 0.22];
    let heads = [form.rear[1] + 0.6 * rear_bow_m + 0.04, form.screen[1] - 0.12];
    let band = [s.uniform(0.04, 0.1), s.uniform(0.84, 0.92)];
    // Pillars between panes are 8 to 15 cm wide with their trim.
    let half_pillar = s.uniform(0.04, 0.075) / (feet[1] - feet[0]);
    let front = 1.0 - s.uniform(0.01, 0.03);
    let middle = ((form.middle_pillar_x() - feet[0]) / (feet[1] - feet[0])).clamp(0.2, 0.75);
    let behind = middle - half_pillar;
    let rear = s.uniform(0.05, 0.22) * middle.min(0.5) * 2.0;
    let quarter = s.uniform(0.4, 0.52) * behind;
    let mut panes = vec![[middle + half_pillar, front]];
    match form.style {
        Style::Sedan | Style::Hatchback => panes.insert(0, [rear, behind]),
        Style::Coupe => panes.insert(0, [0.5 * (rear + behind), behind]),
        Style::Van if s.chance(0.6) => {}
        Style::PickUp if s.chance(0.3) => {}
        Style::PickUp => panes.insert(0, [0.4 * rear, behind]),
        Style::Estate | Style::Suv | Style::Minivan | Style::Van => {
            panes.insert(0, [0.4 * rear, quarter - half_pillar]);
            panes.insert(1, [quarter + half_pillar, behind]);
        }
    }
    let column = |share: f64, pane: Option<[f64; 2]>| {
        let x = feet[0] + share * (feet[1] - feet[0]);
        let foot = dvec3(x, 0.01 - body.shoulder_y(x), form.top_m(x));
        let x = heads[0] + share * (heads[1] - heads[0]);
        Column { foot, head: roof.at(x, -roof.half_y), pane }
    };
    let windows = panes.into_iter().flat_map(|[from, to]| [(from, Some(band)), (to, None)]);
    let all = [(0.0, None)].into_iter().chain(windows).chain([(1.0, None)]);
    all.map(|(share, pane)| column(share, pane)).collect()
}
