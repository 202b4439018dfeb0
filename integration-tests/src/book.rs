//! The Rust snippets of the README and of the book, compiled and run as doc-tests. `tests/book.rs` holds that no page is
//! missing here. A code block without a language counts as Rust: text says `text`.

#[doc = include_str!("../../README.md")]
struct Readme;

#[doc = include_str!("../../CONTRIBUTING.md")]
struct Contributing;

#[doc = include_str!("../../book/src/cluster-lod.md")]
struct ClusterLod;

#[doc = include_str!("../../book/src/depth-meshes.md")]
struct DepthMeshes;

#[doc = include_str!("../../book/src/edge-collapse.md")]
struct EdgeCollapse;

#[doc = include_str!("../../book/src/experiments.md")]
struct Experiments;

#[doc = include_str!("../../book/src/first-run.md")]
struct FirstRun;

#[doc = include_str!("../../book/src/introduction.md")]
struct Introduction;

#[doc = include_str!("../../book/src/layered-depth-images.md")]
struct LayeredDepthImages;

#[doc = include_str!("../../book/src/measuring.md")]
struct Measuring;

#[doc = include_str!("../../book/src/point-polygon-hlod.md")]
struct PointPolygonHlod;

#[doc = include_str!("../../book/src/reference.md")]
struct Reference;

#[doc = include_str!("../../book/src/scenes.md")]
struct Scenes;

#[doc = include_str!("../../book/src/textured-lod-meshes.md")]
struct TexturedLodMeshes;
