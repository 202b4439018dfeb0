//! Layered depth images as they are baked: their samples, and how many pictures are enough.

mod common;
mod enough;
mod images;
