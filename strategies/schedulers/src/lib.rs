//! What is loaded, in which order, and what goes.
