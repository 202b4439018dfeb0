//! From an experiment file to a report.

pub mod audit;
pub mod config;
pub mod failure;
pub mod export;
pub mod generate;
pub mod list;
pub mod load;
pub mod measure;
pub mod path;
pub mod report;
pub mod results;
pub mod scene;
pub mod store;
