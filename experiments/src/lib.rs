//! From an experiment file to a report.
pub mod generate;
pub mod load;
pub mod audit;
pub mod measure;
pub mod report;
pub mod results;
