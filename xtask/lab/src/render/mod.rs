//! How results are shown: tables for terminals and pages, charts, and pages.

pub mod chart;
pub mod page;
pub mod table;
