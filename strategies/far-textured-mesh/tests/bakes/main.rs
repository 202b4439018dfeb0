//! Textured meshes as they are baked, on generated objects and on a scan.

mod bake;
mod bunny;
mod common;
mod splits;
mod view_test;
