//! From an experiment file to a report.
pub mod generate;
