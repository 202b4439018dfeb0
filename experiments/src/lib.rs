//! From an experiment file to a report.

pub mod audit;
pub mod build;
pub mod config;
pub mod export;
pub mod failure;
pub mod generate;
pub mod list;
pub mod load;
pub mod measure;
pub mod path;
pub mod progress;
pub mod report;
pub mod results;
pub mod scene;
pub mod store;
pub mod walk;
