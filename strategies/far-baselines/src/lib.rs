//! Baseline far fields: all geometry, with and without frustum culling.
