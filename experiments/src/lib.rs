//! From an experiment file to a report.
