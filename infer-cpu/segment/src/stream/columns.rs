//! The returns of the current turn, and the obstacles of its latest columns.

use std::ops::Range;

use crate::image::{Cells, Columns, Return};
use crate::link::{MOST_COLUMNS, MOST_IN_CELL};

/// Columns that are kept for steps: those within reach of a return, on both sides.
pub const WINDOW: usize = 2 * MOST_COLUMNS + 2;
/// The image's number of a column that is counted clockwise.
pub fn image_column(place: u64, n_columns: usize) -> usize {
    n_columns - 1 - (place % n_columns as u64) as usize
}

/// All returns of a turn, sorted by column and row.
pub struct Turn {
    pub returns: Vec<Return>,
    /// Where each column is among them.
    pub columns: Vec<Range<usize>>,
}

/// The obstacles in the latest columns.
pub struct Window {
    n_columns: usize,
    elevations: Vec<f32>,
    columns: Vec<WindowColumn>,
    /// The place of the newest one.
    newest: u64,
}

#[derive(Clone, Default)]
struct WindowColumn {
    returns: Vec<Return>,
    /// Where each row begins, and the end of the last.
    starts: Vec<u32>,
}

impl Turn {
    pub fn new(n_columns: usize, capacity: usize) -> Self {
        Self { returns: Vec::with_capacity(capacity), columns: vec![0..0; n_columns] }
    }

    pub fn clear(&mut self) {
        self.returns.clear();
        self.columns.fill(0..0);
    }
}

impl Columns for Turn {
    fn n_columns(&self) -> usize {
        self.columns.len()
    }

    fn column(&self, column: usize) -> &[Return] {
        &self.returns[self.columns[column].clone()]
    }
}

impl Window {
    pub fn new(n_columns: usize, elevations: Vec<f32>) -> Self {
        let n_rows = elevations.len();
        let column = || WindowColumn {
            returns: Vec::with_capacity(MOST_IN_CELL * n_rows),
            starts: vec![0; n_rows + 1],
        };
        let columns = (0..WINDOW).map(|_| column()).collect();
        Self { n_columns, elevations, columns, newest: 0 }
    }

    pub fn clear(&mut self) {
        self.columns.iter_mut().for_each(WindowColumn::clear);
    }

    /// Begins a column, in the place of the oldest one.
    pub fn begin(&mut self, place: u64) {
        self.newest = place;
        self.columns[place as usize % WINDOW].clear();
    }

    /// Adds a return to the newest column; returns false if there is no room for it.
    pub fn push(&mut self, row: u16, this: Return) -> bool {
        let column = &mut self.columns[self.newest as usize % WINDOW];
        let has_room = column.returns.len() < column.returns.capacity();
        if has_room {
            column.returns.push(this);
            column.starts[usize::from(row) + 1] += 1;
        }
        has_room
    }

    /// Ends the newest column, whose returns came by rows.
    pub fn finish(&mut self) {
        let column = &mut self.columns[self.newest as usize % WINDOW];
        let mut end = 0;
        for start in &mut column.starts {
            end += *start;
            *start = end;
        }
    }
}

impl WindowColumn {
    fn clear(&mut self) {
        self.returns.clear();
        self.starts.fill(0);
    }
}

impl Cells for Window {
    fn n_columns(&self) -> usize {
        self.n_columns
    }

    fn elevations(&self) -> &[f32] {
        &self.elevations
    }

    fn cell(&self, column: usize, row: usize) -> &[Return] {
        // How many columns ago this column was the newest.
        let newest = image_column(self.newest, self.n_columns);
        let age = if column >= newest { column - newest } else { column + self.n_columns - newest };
        if age >= WINDOW || age as u64 > self.newest {
            return &[];
        }
        let column = &self.columns[(self.newest as usize - age) % WINDOW];
        &column.returns[column.starts[row] as usize..column.starts[row + 1] as usize]
    }
}
