//! Edge collapse.
