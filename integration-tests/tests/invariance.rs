//! Units and places change nothing: a scene scaled by 1e-3 and by 1e6 with all its settings, and one moved by 1e7, have the same
//! pictures and triangle counts.
//!
//! Not bit for bit: factors that are no power of two round coordinates otherwise, and a collapse whose cost ties with another's may go
//! before it. So: the PSNR against all geometry changes by less than 0.1 dB, and
//! triangles by less than 1 %. A power of two changes not one pixel.

use farfield_core::id::CellId;
use farfield_experiments::config::BackendName;
use farfield_integration_tests::lab::{Lab, backends, errors};
use farfield_integration_tests::stones;

const FRAMES: [usize; 3] = [0, 1, 3];
/// Edge of a cell: one for which no viewpoint stands on the border of two cells, where rounding would choose.
const EDGE: f64 = 3.17;
/// Most that PSNR may change, dB.
const MAX_DB: f64 = 0.1;
/// Most that a count of triangles may change, as a share.
const MAX_COUNT: f64 = 0.01;

/// What is compared of a pipeline: pooled PSNR of luminance against all geometry, dB; triangles stored and drawn.
#[derive(Debug)]
struct Found {
    psnr_db: f64,
    stored: u64,
    drawn: u64,
    cells: Vec<Option<CellId>>,
    pictures: Vec<farfield_core::image::Picture>,
}

fn experiment(scale: f64, offset: f64) -> String {
    let hybrid = |name: &str, more: &str| {
        format!(
            "[[pipeline]]\nname = \"{name}\"\npartition = {{ type = \"hex-cells\", edge = {:?} }}\n\
             far_field = {{ type = \"textured-lod-mesh\", edge_px = 1.0, {more} }}\n",
            EDGE * scale
        )
    };
    let alone = |name: &str, far_field: &str, more: &str| {
        format!("[[pipeline]]\nname = \"{name}\"\nfar_field = {{ type = \"{far_field}\", {more} }}\n")
    };
    format!(
        "[scene]\npath = \"stones.glb\"\nscale = {scale:?}\noffset = [{offset:?}, {:?}, {:?}]\n\
         [view]\nresolution = [160, 120]\neye_height = [{eye:?}, {eye:?}]\nnear = {:?}\npath = \"line\"\nframes = 9\n\
         max_speed = {:?}\nframes_per_s = 10\n\
         [[pipeline]]\nname = \"all geometry\"\nfar_field = {{ type = \"geometry\", frustum_culling = false }}\n{}{}{}{}{}{}",
        -offset,
        0.5 * offset,
        0.05 * scale,
        60.0 * scale,
        hybrid("one view", "view_test = { type = \"self-occlusion\", max_px = 1e9 }"),
        hybrid("several views", "view_test = { type = \"self-occlusion\", max_px = 0.0 }"),
        hybrid("quadric", "collapse = { type = \"quadric\" }"),
        hybrid("appearance", "collapse = { type = \"appearance\" }"),
        alone("clusters", "cluster-lod", "cluster_triangles = 32, group_clusters = 8, max_px = 1.0"),
        alone("nodes", "point-polygon-hlod", "node_triangles = 500, resolution = 64, max_px = 8.0, grid_steps = 4096"),
        eye = 1.5 * scale,
    )
}

fn found(folder: &tempfile::TempDir, scale: f64, offset: f64, on: BackendName) -> Vec<Found> {
    let lab = Lab::new(&experiment(scale, offset), folder.path()).unwrap();
    let mut device = lab.device(on).unwrap();
    let reference = lab.frames(0, &FRAMES, &mut device).unwrap();
    let one = |i: usize| {
        let frames = lab.frames(i, &FRAMES, &mut device).unwrap();
        let pooled = reference.iter().zip(&frames).map(|(r, f)| errors(r, f).luminance).reduce(|a, b| a.joined(b));
        Found {
            psnr_db: pooled.unwrap().psnr_db(),
            stored: lab
                .with(i, |o| {
                    let cells = o.built.cells.values().flat_map(|c| &c.manifest);
                    cells.chain(o.built.shared.iter().map(|s| &s.1)).map(|m| m.triangles()).sum()
                })
                .unwrap(),
            drawn: frames.iter().map(|f| f.near_triangles + f.far_triangles).sum(),
            cells: frames.iter().map(|f| f.cell).collect(),
            pictures: frames.into_iter().map(|f| f.rendered.picture).collect(),
        }
    };
    (0..lab.experiment.pipelines.len()).map(one).collect()
}

#[test]
fn scale_and_place_change_neither_pictures_nor_counts() {
    let folder = stones::folder();
    for on in backends("invariance").into_iter().filter(|b| *b != BackendName::Vulkan) {
        let home = found(&folder, 1.0, 0.0, on);
        assert!(
            home[1..].iter().all(|h| h.stored > 1000 && (25.0..60.0).contains(&h.psnr_db)),
            "nothing is tried: {:?}",
            home.iter().map(|h| (h.psnr_db, h.stored)).collect::<Vec<_>>()
        );
        for (what, scale, offset) in
            [("2^-10", 1.0 / 1024.0, 0.0), ("1e-3", 1e-3, 0.0), ("1e6", 1e6, 0.0), ("moved by 1e7", 1.0, 1e7)]
        {
            for (i, (h, f)) in home.iter().zip(found(&folder, scale, offset, on)).enumerate() {
                let pixels: usize = h.pictures.iter().map(|p| p.rgba.len()).sum();
                let other = |(a, b): (&farfield_core::image::Picture, &farfield_core::image::Picture)| {
                    a.rgba.iter().zip(&b.rgba).filter(|(a, b)| a != b).count()
                };
                let differ: usize = h.pictures.iter().zip(&f.pictures).map(other).sum();
                println!(
                    "{} {what}, pipeline {i}: {:.3} dB beside {:.3}, {} and {} triangles beside {} and {}, {differ} of {pixels} pixels differ",
                    on.name(),
                    f.psnr_db,
                    h.psnr_db,
                    f.stored,
                    f.drawn,
                    h.stored,
                    h.drawn
                );
                assert_eq!(f.cells, h.cells, "{what}: other cells");
                if scale.log2().fract() == 0.0 && offset == 0.0 {
                    assert!(differ == 0 && f.stored == h.stored, "{what}, pipeline {i}: a power of two rounds nothing");
                }
                let off = |a: u64, b: u64| a.abs_diff(b) as f64 / b.max(1) as f64;
                assert!((f.psnr_db - h.psnr_db).abs() < MAX_DB, "{what}, pipeline {i}: another PSNR");
                assert!(
                    off(f.stored, h.stored) < MAX_COUNT && off(f.drawn, h.drawn) < MAX_COUNT,
                    "{what}: {i}: counts"
                );
            }
        }
    }
}
