//! From an experiment file to a report.

pub mod audit;
pub mod build;
pub mod calibrate;
pub mod chunks;
pub mod config;
pub mod export;
pub mod failure;
pub mod floor;
pub mod gallery;
pub mod generate;
pub mod images;
pub mod list;
pub mod load;
pub mod measure;
pub mod path;
pub mod plan;
pub mod progress;
pub mod report;
pub mod results;
pub mod run;
pub mod sample;
pub mod scene;
pub mod store;
pub mod walk;
