//! The WGSL that every GPU backend runs, and its SPIR-V by way of naga.
