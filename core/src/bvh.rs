//! Bounding volume hierarchies over triangles and boxes.
