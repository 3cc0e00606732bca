//! How results are shown: tables for a terminal, charts, and pages.

pub mod chart;
pub mod page;
pub mod table;
pub mod text_table;
