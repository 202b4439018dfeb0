//! Hexagonal cells of viewpoints on the ground plane.
