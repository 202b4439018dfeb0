//! Visibility and simplification metrics.
