//! What a point's colour says, and the bar that explains it.

use std::collections::BTreeMap;

use anyhow::Result;
use formats::Scan;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use super::canvas::{Area, metres, text};
use super::frame::Frame;
use crate::colours;
use crate::view::frame::Labels;

const BAR_LEFT: i32 = 14;
const BAR_THICKNESS: i32 = 18;
const BAR_TOP: i32 = 56;
const BAR_LENGTH: i32 = 360;
const TICKS: i32 = 5;

/// The most entries of a legend.
const MOST_ENTRIES: usize = 20;

/// How values become colours.
pub struct Colours {
    by_range: bool,
    low: f64,
    high: f64,
}

impl Colours {
    /// Colours for `scans`: by range if all of them know it, by height if not.
    /// The first scan with a finite value in `frame` sets the limits.
    pub fn of(scans: &[&Scan], frame: &Frame) -> Self {
        let by_range = scans.iter().all(|scan| scan.range_m.is_some() || scan.is_empty());
        let mut colours = Self { by_range, low: 0.0, high: 1.0 };
        let limits = scans.iter().find_map(|scan| {
            let inside = scan.positions.iter().zip(colours.values(scan));
            let inside = inside.filter(|(point, _)| frame.holds(**point));
            let finite = inside.map(|(_, value)| value).filter(|value| value.is_finite());
            finite.fold(None, |limits, value| {
                let (low, high) = limits.unwrap_or((value, value));
                Some((low.min(value), high.max(value)))
            })
        });
        if let Some((low, high)) = limits {
            // Values that are all one get a bar around them.
            let widen = if high > low { 0.0 } else { 0.5 };
            (colours.low, colours.high) = (low - widen, high + widen);
        }
        colours
    }

    pub fn tints(&self, scan: &Scan) -> Vec<RGBColor> {
        self.values(scan).map(|value| self.tint(value)).collect()
    }

    fn values<'a>(&self, scan: &'a Scan) -> Box<dyn Iterator<Item = f64> + 'a> {
        match &scan.range_m {
            Some(range_m) if self.by_range => Box::new(range_m.iter().map(|&r| f64::from(r))),
            _ => Box::new(scan.positions.iter().map(|point| f64::from(point[2]))),
        }
    }

    fn tint(&self, value: f64) -> RGBColor {
        colours::on_ramp((value - self.low) / (self.high - self.low))
    }

    /// Draws the bar that says which value has which colour.
    pub fn draw_bar(&self, area: &Area<'_>) -> Result<()> {
        let label = if self.by_range { "range (m)" } else { "height (m)" };
        area.draw_text(label, &text(16), (BAR_LEFT, BAR_TOP - 30))?;
        let value_at = |down: i32| {
            self.high + (self.low - self.high) * f64::from(down) / f64::from(BAR_LENGTH)
        };
        for down in 0..BAR_LENGTH {
            let y = BAR_TOP + down;
            let line = [(BAR_LEFT, y), (BAR_LEFT + BAR_THICKNESS, y + 1)];
            area.draw(&Rectangle::new(line, self.tint(value_at(down)).filled()))?;
        }
        let beside = text(14).pos(Pos::new(HPos::Left, VPos::Center));
        let right = BAR_LEFT + BAR_THICKNESS;
        for tick in 0..TICKS {
            let down = BAR_LENGTH * tick / (TICKS - 1);
            let y = BAR_TOP + down;
            area.draw(&PathElement::new([(right, y), (right + 4, y)], BLACK))?;
            // The ticks lie at no round numbers: show a tenth of their distance.
            let step = (self.high - self.low) / 40.0;
            area.draw_text(&metres(value_at(down), step), &beside, (right + 9, y))?;
        }
        Ok(())
    }
}

/// The colour of one of the numbers of `labels`.
pub fn tint(labels: &Labels, value: u32) -> RGBColor {
    match labels.names.as_ref().and_then(|names| names.get(value as usize)) {
        Some(name) => colours::of_class(name),
        None => colours::of_number(value),
    }
}

/// Draws a legend of the most frequent numbers of `labels`.
pub fn draw_legend(area: &Area<'_>, labels: &Labels) -> Result<()> {
    area.draw_text(labels.name, &text(16), (BAR_LEFT, BAR_TOP - 30))?;
    let mut counts = BTreeMap::<u32, usize>::new();
    labels.values.iter().for_each(|value| *counts.entry(*value).or_default() += 1);
    let mut entries: Vec<_> = counts.into_iter().collect();
    entries.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    for (y, (value, _)) in (BAR_TOP..).step_by(22).zip(entries.into_iter().take(MOST_ENTRIES)) {
        let swatch = Circle::new((BAR_LEFT + 6, y), 6, tint(labels, value).filled());
        area.draw(&swatch)?;
        let name = labels.names.as_ref().and_then(|names| names.get(value as usize).cloned());
        let beside = text(14).pos(Pos::new(HPos::Left, VPos::Center));
        area.draw_text(&name.unwrap_or(value.to_string()), &beside, (BAR_LEFT + 20, y))?;
    }
    Ok(())
}
