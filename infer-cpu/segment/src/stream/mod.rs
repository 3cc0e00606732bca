//! The hierarchy of a continuous stream of returns: each cluster as soon as it is complete.

//!
//! A return passes three stages. It waits in its column until the beams have passed that column
//! ([`Stream::push`], [`Stream::advance`]). Then the column is closed: its returns are sorted into the
//! turn, from which the ground of the next turn is found, and those above the present ground enter
//! the window of the latest columns. When the last column within reach of a column is there, the
//! steps from it are found, which join returns to sets; a set to which no later column can add is
//! complete (`complete`).

mod columns;
mod complete;

use std::f32::consts::{PI, TAU};

use crate::ground::{GroundFinder, sector};
use crate::height_grid::HeightGrid;
use crate::hierarchy::{find_steps, most_columns};
use crate::image::{self, Columns, Return};
use crate::link::MOST_COLUMNS;
use crate::look::Look;
use crate::open_sets::{NONE, OpenSets};
use crate::settings::{Settings, SettingsError};
use columns::{Turn, WINDOW, Window, image_column};
use complete::Complete;
pub use complete::{StreamCluster, StreamNode};

/// Finds the [`Hierarchy`](crate::Hierarchy) of the returns of a sensor that turns clockwise, as they
/// arrive, up to the clusters of [`Settings::max_size_m`].
///
/// A tree of clusters is complete, and reported, when the beams have passed it by the widest step
/// and by what the search for steps spans: 12.6 degrees at 10 m. Links to wider clusters are reported up
/// to ten degrees of turn later. The ground is that of the previous turn; the clusters of the first
/// turn are reported at its end. A set that extends all around the sensor, such as the walls of a
/// small room, never ends and is not a cluster.
///
/// ```
/// use edgepuck_segment::{Settings, Stream};
///
/// let mut settings = Settings::default();
/// settings.ring_elevations_deg = Some((-10..6).map(|degrees| degrees as f32).collect());
/// let mut stream = Stream::new(settings, 100_000)?;
/// let mut n_clusters = 0;
/// for turn in 0..2 {
///     for degrees in 0..360 {
///         // All returns before this azimuth have come.
///         let azimuth_rad = (degrees as f32).to_radians();
///         stream.advance(azimuth_rad, |cluster| {
///             n_clusters += 1;
///             assert_eq!(cluster.points.len(), 16);
///             assert_eq!(cluster.nodes[0].points, 0..16);
///         });
///         if degrees == 90 {
///             // A post on the right, seen by every ring.
///             for (ring, elevation) in (-10..6).enumerate() {
///                 let z = 5.0 * (elevation as f32).to_radians().tan();
///                 stream.push([0.0, -5.0, z], ring as u16, turn);
///             }
///         }
///     }
/// }
/// stream.end(|_| n_clusters += 1);
/// assert_eq!(n_clusters, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct Stream<T> {
    settings: Settings,
    /// The row of each ring.
    rows: Vec<u16>,
    /// The first column that may still get returns. Columns are counted as the sensor turns,
    /// clockwise; in images they are numbered the other way round.
    front: Option<u64>,
    /// The last column that has a return.
    newest: u64,
    /// The first column of the current turn.
    turn_start: u64,
    n_turns: u64,
    points: OpenSets<T>,
    /// The first point of each column that is not closed; the others follow by their links.
    waiting: Vec<u32>,
    turn: Turn,
    window: Window,
    /// The number of columns between the newest one and that from which steps are found.
    lag: u64,
    /// For each column of the window, the first of the points that no later column can be linked
    /// to.
    due: [u32; WINDOW],
    finder: GroundFinder,
    ground: Option<HeightGrid>,
    /// The ground of the turn before last, whose memory is reused.
    spare_ground: HeightGrid,
    column: Vec<(u16, u64, u32)>,
    look: Look,
    complete: Complete<T>,
    dropped: Dropped,
}

/// The number of dropped returns, by cause.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// They came after their column was closed, or before the first call of [`Stream::advance`].
    pub late: u64,
    /// There was no room for them.
    pub overflow: u64,
}

impl Dropped {
    /// The number of all.
    #[must_use]
    pub fn total(&self) -> u64 {
        self.late + self.overflow
    }
}

impl<T: Copy + Default> Stream<T> {
    /// A stream with these settings, for up to `capacity` returns at a time: 1.5 times as many as
    /// the sensor sends in a turn are enough. `T` is a tag that comes with each return.
    ///
    /// # Errors
    /// An invalid setting. `ring_elevations_deg` is required, and `radius_m` must be `None`.
    pub fn new(settings: Settings, capacity: u32) -> Result<Self, SettingsError> {
        settings.check()?;
        let wrong = |name, expected| SettingsError { name, expected, found: f64::NAN };
        let no_elevations = || wrong("ring_elevations_deg", "one for each ring");
        let degrees = settings.ring_elevations_deg.as_deref().ok_or_else(no_elevations)?;
        if let Some(radius_m) = settings.radius_m {
            return Err(SettingsError {
                found: f64::from(radius_m),
                ..wrong("radius_m", "none in a stream")
            });
        }
        let mut order: Vec<_> = (0..degrees.len()).collect();
        order.sort_by(|&a, &b| degrees[a].total_cmp(&degrees[b]).then(a.cmp(&b)));
        let elevations: Vec<_> = order.iter().map(|&ring| degrees[ring].to_radians()).collect();
        let mut rows = vec![0; order.len()];
        order.iter().zip(0..).for_each(|(&ring, row)| rows[ring] = row);
        let n_columns = image::n_columns(&settings);
        Ok(Self {
            window: Window::new(n_columns, elevations),
            rows,
            front: None,
            newest: 0,
            turn_start: 0,
            n_turns: 0,
            points: OpenSets::new(capacity),
            waiting: vec![NONE; n_columns],
            turn: Turn::new(n_columns, capacity as usize),
            // With few columns, the window must not reach the same column from both sides.
            lag: MOST_COLUMNS.min((n_columns - 1) / 2) as u64,
            due: [NONE; WINDOW],
            finder: GroundFinder::default(),
            ground: None,
            spare_ground: HeightGrid::default(),
            column: Vec::new(),
            look: Look::new(capacity),
            complete: Complete::new(capacity as usize),
            dropped: Dropped::default(),
            settings,
        })
    }

    /// Adds a return at `position`, metres in the sensor's frame. A point out of range, or of a
    /// ring that the settings do not have, is ignored.
    pub fn push(&mut self, position: [f32; 3], ring: u16, tag: T) {
        let [x, y, z] = position;
        let square = x * x + y * y + z * z;
        let squares = self.settings.min_range_m.powi(2)..=self.settings.max_range_m.powi(2);
        if !squares.contains(&square) || square == 0.0 || usize::from(ring) >= self.rows.len() {
            return;
        }
        let Some(front) = self.front else {
            self.dropped.late += 1;
            return;
        };
        let n_columns = self.waiting.len();
        let column = n_columns - 1 - usize::from(image::column(n_columns, x, y));
        let ahead = ahead(front, column, n_columns);
        // Columns are modulo a turn: a return up to a quarter of a turn behind the front is late, and
        // any other is ahead, such as those of rings whose beams lead the packet's azimuth.
        if ahead >= n_columns - n_columns / 4 {
            self.dropped.late += 1;
            return;
        }
        let (row, place) = (self.rows[usize::from(ring)], front + ahead as u64);
        match self.points.insert(position, row, tag, place) {
            None => self.dropped.overflow += 1,
            Some(point) => {
                *self.points.link_mut(point) = std::mem::replace(&mut self.waiting[column], point);
                self.newest = self.newest.max(place);
            }
        }
    }

    /// States that all returns before `azimuth_rad` (clockwise from x) have come, and passes the
    /// clusters that this completes to `each`. An azimuth behind the previous one has no effect. The
    /// first call marks where the stream begins.
    pub fn advance(&mut self, azimuth_rad: f32, mut each: impl FnMut(StreamCluster<'_, T>)) {
        let ahead = self.columns_to(azimuth_rad);
        // More than half a turn ahead is behind: azimuths of packets may go back a little.
        if ahead <= self.waiting.len() / 2 {
            (0..ahead).for_each(|_| self.close(&mut each));
        }
    }

    /// The same over a gap in the data of up to a turn: packets were lost, or the sensor does not send a
    /// sector (`is_unsent`), whose end is where its turns begin.
    pub fn skip(
        &mut self,
        azimuth_rad: f32,
        is_unsent: bool,
        mut each: impl FnMut(StreamCluster<'_, T>),
    ) {
        (0..self.columns_to(azimuth_rad)).for_each(|_| self.close(&mut each));
        // A sector begins with any of the firings near its start: some degrees more or less.
        let n_columns = self.waiting.len() as u64;
        let near = n_columns / 36;
        let turned = self.front.unwrap_or(self.turn_start) - self.turn_start;
        if is_unsent && turned > n_columns - near {
            self.end_turn(&mut each);
        } else if is_unsent && turned > near && self.ground.is_some() {
            // The ground stays: a part of a turn tells too little of it.
            self.n_turns += 1;
            self.begin_turn();
        }
    }

    /// The number of columns from the front to an azimuth; the first one is the front.
    fn columns_to(&mut self, azimuth_rad: f32) -> usize {
        let n_columns = self.waiting.len();
        // A margin for rounding: the error of `angle::atan2` is at most 2e-5.
        const ROUNDING: f32 = 1e-4;
        let turned = (azimuth_rad - ROUNDING + PI).rem_euclid(TAU) / TAU;
        let column = ((turned * n_columns as f32) as usize).min(n_columns - 1);
        let Some(front) = self.front else {
            self.front = Some(column as u64);
            self.turn_start = column as u64;
            return 0;
        };
        ahead(front, column, n_columns)
    }

    /// Reports all clusters so far, complete or not. The stream begins anew at the next call of
    /// [`Stream::advance`], with the ground that it knows.
    pub fn end(&mut self, mut each: impl FnMut(StreamCluster<'_, T>)) {
        if self.front.is_none() {
            return;
        }
        while self.front.is_some_and(|front| front <= self.newest) {
            self.close(&mut each);
        }
        // The first turn has waited for its ground.
        if self.ground.is_none() {
            self.end_turn(&mut each);
        }
        // Empty columns move the last returns through the window, which completes their sets.
        (0..WINDOW).for_each(|_| self.close_column(&mut each));
        self.turn.clear();
        self.window.clear();
        (self.front, self.newest) = (None, 0);
    }

    /// The number of turns that have ended.
    #[must_use]
    pub fn n_turns(&self) -> u64 {
        self.n_turns
    }

    /// The number of returns dropped so far.
    #[must_use]
    pub fn dropped(&self) -> Dropped {
        self.dropped
    }

    /// Closes the front column, and the turn after its last column.
    fn close(&mut self, each: &mut impl FnMut(StreamCluster<'_, T>)) {
        self.close_column(each);
        if self.front == Some(self.turn_start + self.waiting.len() as u64) {
            self.end_turn(each);
        }
    }

    fn close_column(&mut self, each: &mut impl FnMut(StreamCluster<'_, T>)) {
        let Some(place) = self.front else { return };
        self.front = Some(place + 1);
        self.sort_column(place);
        if self.ground.is_some() {
            self.open(place, each);
        }
    }

    /// Moves the waiting returns of a column into the turn.
    fn sort_column(&mut self, place: u64) {
        let Self { waiting, column, points, turn, .. } = self;
        let n_columns = waiting.len();
        let at = (place % n_columns as u64) as usize;
        column.clear();
        let mut next = std::mem::replace(&mut waiting[at], NONE);
        while next != NONE {
            let slot = points.slot(next);
            column.push((slot.row, slot.order, next));
            next = slot.link;
        }
        // By row, and within a row in the order of arrival, so that the result does not depend on the
        // order of the links.
        column.sort_unstable();
        let start = turn.returns.len();
        for &(_, _, point) in column.iter() {
            if turn.returns.len() == turn.returns.capacity() {
                self.dropped.overflow += 1;
                points.remove(point);
                continue;
            }
            let slot = points.slot(point);
            let [x, y, _] = slot.position;
            turn.returns.push(Return {
                position: slot.position,
                range_m: (x * x + y * y).sqrt(),
                height_m: f32::NAN,
                point,
            });
        }
        turn.columns[n_columns - 1 - at] = start..turn.returns.len();
    }

    /// Copies the obstacles of a column from the turn into the window, finds the steps from the
    /// column whose last neighbour this is, and reports the clusters that this completes.
    fn open(&mut self, place: u64, each: &mut impl FnMut(StreamCluster<'_, T>)) {
        let Self { ground: Some(ground), points, turn, window, settings, .. } = self else {
            return;
        };
        let n_columns = self.waiting.len();
        let column = image_column(place, n_columns);
        let sector = sector(n_columns, column);
        let width = settings.column_width_deg.to_radians();
        window.begin(place);
        for this in turn.column(column) {
            let mut this = *this;
            this.height_m = ground.above_ground_m(sector, this.range_m, this.position);
            if this.height_m <= settings.ground_clearance_m {
                points.remove(this.point);
                continue;
            }
            let row = points.slot(this.point).row;
            // A column of the window has room for the usual number of returns alone.
            if !window.push(row, this) {
                self.dropped.overflow += 1;
                points.remove(this.point);
                continue;
            }
            // The nearer a return, the more columns a step from it can span.
            let last_place = place + most_columns(&this, width) as u64;
            points.wait_until(this.point, last_place);
            let due = &mut self.due[last_place as usize % WINDOW];
            *points.link_mut(this.point) = std::mem::replace(due, this.point);
        }
        window.finish();
        // A step may go to later columns, too: steps are found `lag` columns behind the newest, where
        // all columns within reach, on both sides, are in the window.
        if let Some(before) = place.checked_sub(self.lag) {
            let column = image_column(before, n_columns);
            find_steps(window, column, width, |level, pair| points.step(level, pair));
            self.report_complete(before, each);
        }
    }

    /// Finds the ground of the turn, for the next one. Then opens the columns of the first turn,
    /// which waited for it.
    fn end_turn(&mut self, each: &mut impl FnMut(StreamCluster<'_, T>)) {
        // Two grounds take turns, so that neither allocates memory again.
        let mut ground = std::mem::take(&mut self.spare_ground);
        self.finder.find(&self.turn, &self.settings, &mut ground);
        self.n_turns += 1;
        match self.ground.replace(ground) {
            Some(before) => self.spare_ground = before,
            None => {
                let end = self.front.unwrap_or(self.turn_start);
                (self.turn_start..end).for_each(|place| self.open(place, each));
            }
        }
        self.begin_turn();
    }

    fn begin_turn(&mut self) {
        self.turn_start = self.front.unwrap_or(0);
        self.turn.clear();
    }
}

/// The number of columns from `front` to `column`, clockwise.
fn ahead(front: u64, column: usize, n_columns: usize) -> usize {
    let front = (front % n_columns as u64) as usize;
    if column >= front { column - front } else { column + n_columns - front }
}
