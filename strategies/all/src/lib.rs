//! Every strategy, registered by name.
