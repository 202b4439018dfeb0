//! `budget.upload_bytes_per_frame`: what a frame uploads stays within it, but for a single block; nothing is lost, and what was
//! not there yet is counted as missing.

use farfield_experiments::config::BackendName;
use farfield_experiments::measure::Rendered;
use farfield_experiments::walk::{Device, Tour, Walked, Walker, device};
use farfield_integration_tests::lab::Lab;
use farfield_integration_tests::stones;

const PIPELINE: &str = r#"
[[pipeline]]
name = "hybrid"
partition = { type = "hex-cells", edge = 3.0 }
far_field = { type = "textured-lod-mesh", edge_px = 1.0 }
"#;

/// Frames of an eye that stands still, and what the last one shows.
fn walk(lab: &Lab, limit: Option<u64>, frames: usize) -> (Vec<Walked>, Rendered) {
    let (e, p) = (&lab.experiment, &lab.prepared);
    let cameras = vec![p.cameras[0]; frames];
    let tour = Tour {
        scene: &p.scene,
        views: &p.views,
        lit: &|frame| p.lit(frame),
        cameras: &cameras,
        frames_per_s: e.view.frames_per_s,
        measure: &e.measure,
    };
    let budget = farfield_experiments::config::BudgetSettings { upload_bytes_per_frame: limit, ..Default::default() };
    let mut device = Device::new(device::open(BackendName::Cpu, &p.scene).unwrap());
    let mut walker = Walker::new(&tour, lab.opened(0).unwrap(), None, &mut device, &budget);
    let frames = cameras.iter().map(|c| walker.step(c).unwrap()).collect();
    (frames, walker.read().unwrap())
}

#[test]
fn a_frame_uploads_no_more_than_the_limit_or_one_block_and_all_arrives() {
    let folder = stones::folder();
    let text = stones::experiment([160, 120], PIPELINE) + "[measure]\nrepeats = 1\nwarm_up = 0\n";
    let lab = Lab::new(&text, folder.path()).unwrap();
    let uploaded = |w: &[Walked]| w.iter().map(|f| f.uploaded_bytes).collect::<Vec<_>>();

    let (at_once, whole) = walk(&lab, None, 2);
    let all = at_once[0].uploaded_bytes;
    assert_eq!((at_once[0].missing, at_once[1].uploaded_bytes), (0, 0), "without a limit all comes in the first frame");

    // A limit that nothing fits: a block a frame, whatever its size.
    let (single, _) = walk(&lab, Some(1), 40);
    let blocks: Vec<u64> = uploaded(&single).into_iter().filter(|&b| b > 0).collect();
    assert_eq!(blocks.iter().sum::<u64>(), all, "{blocks:?}");
    assert!(blocks.len() > 5 && single[0].missing > 0, "{blocks:?}");
    let (largest, least) = (*blocks.iter().max().unwrap(), *blocks.iter().min().unwrap());

    for limit in [all / 2, all / 4, 3 * least, all, all - 1] {
        let (limited, last) = walk(&lab, Some(limit), blocks.len() + 1);
        let bytes = uploaded(&limited);
        println!("limit {limit}: {bytes:?}");
        assert!(bytes.iter().all(|&b| b <= limit || blocks.contains(&b)), "limit {limit}: {bytes:?}");
        assert_eq!(bytes.iter().sum::<u64>(), all, "limit {limit}: {bytes:?}");
        assert!(limit >= all || limited[0].missing > 0 || bytes[1] > 0, "limit {limit} changes nothing");
        assert!(limited.windows(2).all(|w| w[1].missing <= w[0].missing), "limit {limit}: blocks went again");
        assert_eq!(limited.last().unwrap().missing, 0, "limit {limit}");
        // As few frames as that takes: two in a row never fit one.
        let busy: Vec<u64> = bytes.into_iter().filter(|&b| b > 0).collect();
        assert!(busy.windows(2).all(|w| w[0] + w[1] > limit), "limit {limit}: {busy:?}");
        assert!(limit < largest || busy.len() <= 2 * all.div_ceil(limit) as usize, "limit {limit}: {busy:?}");
        assert_eq!(last.picture, whole.picture, "limit {limit}");
    }
}
