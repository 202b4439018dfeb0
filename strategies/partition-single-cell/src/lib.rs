//! One cell for every viewpoint, or for a box of them.
