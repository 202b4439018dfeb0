use super::*;
use glam::DVec3;
use proptest::prelude::*;

/// 40 x 30 pixels, off-axis, turned.
fn camera() -> Camera {
    let mut c = Camera::looking(DVec3::ZERO, Vec3::new(0.3, -0.2, -1.0), Vec3::Y, 1.0, [40, 30], 0.1);
    c.left *= 1.3;
    c.top *= 0.7;
    c
}

/// From the eye to the place of the picture at (x, y) pixels, at depth z.
fn at(c: &Camera, x: f32, y: f32, z: f32) -> Vec3 {
    c.ray(x, y) * z
}

fn covered(s: &Splat) -> Vec<[u32; 2]> {
    s.rows.clone().flat_map(|y| s.columns.clone().map(move |x| [x, y])).collect()
}

proptest! {
    /// Against every pixel's centre, projected the camera's own way.
    #[test]
    fn a_splat_covers_the_centres_within_its_edges(
        x in -10f32..50.0, y in -10f32..40.0, z in 0.05f32..50.0, radius in 0f32..3.0
    ) {
        let c = camera();
        let p = at(&c, x, y, z);
        let splat = Screen::new(&c).splat(p, radius);
        let half_x = (radius / z * 40.0 / (c.right_tan - c.left)).max(0.5);
        let half_y = (radius / z * 30.0 / (c.top - c.bottom)).max(0.5);
        let px = c.project(p).unwrap();
        let pixels = splat.as_ref().map_or(vec![], covered);
        for v in 0..30 {
            for u in 0..40 {
                let (dx, dy) = ((u as f32 + 0.5 - px.x).abs(), (v as f32 + 0.5 - px.y).abs());
                // Nothing is asked of what lies on an edge as closely as numbers are rounded.
                let edge = 1e-3 * (1.0 + half_x.max(half_y));
                let (within, outside) = (dx < half_x - edge && dy < half_y - edge, dx > half_x + edge || dy > half_y + edge);
                if z > 0.101 && within {
                    prop_assert!(pixels.contains(&[u, v]), "{u}, {v} of {px} +- {half_x}, {half_y}");
                }
                if z < 0.099 || outside {
                    prop_assert!(!pixels.contains(&[u, v]), "{u}, {v} of {px} +- {half_x}, {half_y}");
                }
            }
        }
        if let Some(s) = splat {
            prop_assert!((s.depth - z).abs() < 1e-5 * z);
        }
    }

    /// However small, and wherever in the picture its point lies, a splat of least size is one pixel.
    #[test]
    fn a_small_splat_is_the_pixel_that_holds_the_point(x in 0.01f32..39.99, y in 0.01f32..29.99, z in 0.2f32..1e4) {
        let c = camera();
        prop_assume!((x - x.round()).abs() > 0.01 && (y - y.round()).abs() > 0.01);
        let s = Screen::new(&c).splat(at(&c, x, y, z), 0.0).unwrap();
        prop_assert_eq!(covered(&s), vec![[x as u32, y as u32]]);
    }

    /// A brute force walks the line in small steps of the scene and marks the pixels that hold it.
    #[test]
    fn a_line_is_whole_and_one_pixel_wide(
        x in [-20f32..60.0, -20f32..60.0], y in [-20f32..50.0, -20f32..50.0], z in [0.2f32..20.0, 0.2f32..20.0]
    ) {
        let c = camera();
        let ends = [at(&c, x[0], y[0], z[0]), at(&c, x[1], y[1], z[1])];
        let pixels: Vec<LinePixel> = Screen::new(&c).line(ends).map_or(vec![], |l| l.pixels().collect());
        let steep = (y[1] - y[0]).abs() > (x[1] - x[0]).abs();
        prop_assume!(((y[1] - y[0]).abs() - (x[1] - x[0]).abs()).abs() > 1e-2);
        let main = |p: &LinePixel| p.pixel[usize::from(steep)];
        for pair in pixels.windows(2) {
            prop_assert_eq!(main(&pair[0]) + 1, main(&pair[1]), "one a step");
            let other = |p: &LinePixel| p.pixel[usize::from(!steep)];
            prop_assert!(other(&pair[0]).abs_diff(other(&pair[1])) <= 1);
        }
        // Every pixel has the line within half a pixel of its centre, across the longer axis, and its depth.
        let d = Vec2::new(x[1] - x[0], y[1] - y[0]);
        for p in &pixels {
            let centre = Vec2::new(p.pixel[0] as f32 + 0.5, p.pixel[1] as f32 + 0.5);
            let from = centre - Vec2::new(x[0], y[0]);
            let t = if steep { from.y / d.y } else { from.x / d.x };
            let off = (from - d * t).abs().max_element();
            prop_assert!(off < 0.51, "{:?}: {off} px off", p.pixel);
            let t = t.clamp(0.0, 1.0);
            // Of the point of the line in the scene that is seen there: 1 / z is linear in the picture.
            let depth = 1.0 / ((1.0 - t) / z[0] + t / z[1]);
            prop_assert!((p.depth - depth).abs() < 2e-3 * depth, "{} for {depth}", p.depth);
            let seen = ends[0] + (ends[1] - ends[0]) * p.weight;
            prop_assert!((seen.dot(c.forward) - depth).abs() < 2e-3 * depth, "the weight's depth");
        }
        // And where the line goes through the middle of a step within the picture, there is its pixel.
        let n = if steep { 30 } else { 40 };
        for step in 0..n {
            let (from, along) = if steep { (y[0], d.y) } else { (x[0], d.x) };
            let t = (step as f32 + 0.5 - from) / along;
            let there = if steep { x[0] + d.x * t } else { y[0] + d.y * t };
            let others = if steep { 40.0 } else { 30.0 };
            if (0.0..=1.0).contains(&t) && there > 0.01 && there < others - 0.01 {
                prop_assert!(pixels.iter().any(|p| main(p) == step), "step {step} of {x:?} {y:?}");
            }
        }
    }

    /// Lines that share a vertex leave no gap between them, whatever their directions.
    #[test]
    fn lines_that_share_a_vertex_touch(x in [4f32..36.0, 4f32..36.0, 4f32..36.0], y in [4f32..26.0, 4f32..26.0, 4f32..26.0]) {
        let c = camera();
        let p = [0, 1, 2].map(|i: usize| at(&c, x[i], y[i], 3.0));
        let screen = Screen::new(&c);
        let of = |a, b| screen.line([a, b]).unwrap().pixels().map(|p| p.pixel).collect::<Vec<_>>();
        let (one, two) = (of(p[0], p[1]), of(p[1], p[2]));
        let touch = |a: &[u32; 2], b: &[u32; 2]| a[0].abs_diff(b[0]) <= 1 && a[1].abs_diff(b[1]) <= 1;
        let near = |a: &[u32; 2]| (a[0] as f32 + 0.5 - x[1]).abs() < 1.6 && (a[1] as f32 + 0.5 - y[1]).abs() < 1.6;
        prop_assert!(one.iter().filter(|a| near(a)).any(|a| two.iter().any(|b| touch(a, b))), "{one:?} {two:?}");
    }

    /// Both ways round the same pixels, but for steps where rounding decides.
    #[test]
    fn a_line_and_its_reverse_are_the_same(x in [1f32..39.0, 1f32..39.0], y in [1f32..29.0, 1f32..29.0]) {
        let c = camera();
        let (a, b) = (at(&c, x[0], y[0], 2.0), at(&c, x[1], y[1], 3.0));
        let of = |ends| Screen::new(&c).line(ends).unwrap().pixels().map(|p| p.pixel).collect::<Vec<_>>();
        let (there, back) = (of([a, b]), of([b, a]));
        let differ = there.iter().zip(&back).filter(|(a, b)| a != b).count() + there.len().abs_diff(back.len());
        prop_assert!(differ <= 1 + there.len() / 20, "{there:?} {back:?}");
    }
}

#[test]
fn an_end_before_the_near_distance_is_cut_off() {
    let c = Camera::looking(DVec3::ZERO, -Vec3::Z, Vec3::Y, 1.0, [40, 40], 1.0);
    let screen = Screen::new(&c);
    // From a place behind the eye straight under it to one far ahead.
    let ends = [Vec3::new(0.01, -0.4, 3.0), Vec3::new(0.01, -0.4, -9.0)];
    let pixels: Vec<_> = screen.line(ends).unwrap().pixels().collect();
    assert!(pixels.len() > 10 && pixels.iter().all(|p| p.depth >= 0.999 && p.depth <= 9.001), "{pixels:?}");
    // The image runs from the nearest row, at depth 1, up to that of depth 9; the weight says which place is seen.
    assert!((pixels.last().unwrap().depth - 1.0).abs() < 0.05);
    for p in &pixels {
        assert!((3.0 - 12.0 * p.weight + p.depth).abs() < 1e-3, "{p:?}");
    }
    assert_eq!(screen.line([Vec3::Z, Vec3::Z * 2.0]), None);
    assert_eq!(screen.line([Vec3::new(0.0, 0.0, -0.9), Vec3::new(0.1, 0.0, -0.5)]), None);
}

#[test]
fn a_line_of_no_length_is_a_pixel() {
    let c = camera();
    let p = at(&c, 7.3, 9.8, 4.0);
    let pixels: Vec<_> = Screen::new(&c).line([p, p]).unwrap().pixels().map(|p| p.pixel).collect();
    assert_eq!(pixels, [[7, 9]]);
}

#[test]
fn what_overflows_or_is_no_number_covers_nothing() {
    let c = camera();
    let screen = Screen::new(&c);
    let [far, odd] = [Vec3::splat(-3e38), Vec3::new(f32::NAN, 0.0, -1.0)];
    assert_eq!(screen.splat(odd, 1.0), None);
    assert_eq!(screen.splat(c.forward * 2.0, f32::NAN).map(|s| covered(&s).len()), Some(1), "the least size");
    assert_eq!(screen.splat(c.forward * 2.0, 3e38), None);
    for ends in [[odd, c.forward], [c.forward, odd], [odd, odd], [far, c.forward]] {
        let pixels = screen.line(ends).map_or(0, |l| l.pixels().count());
        assert!(pixels <= 80, "{ends:?}: {pixels} pixels");
    }
    // A large radius covers all and no more.
    let all = screen.splat(at(&c, -500.0, 3.0, 2.0), 1e20).unwrap();
    assert_eq!((all.columns, all.rows), (0..40, 0..30));
}

#[test]
fn a_point_faces_the_eye_before_its_plane() {
    assert!(faces(Vec3::Z, -Vec3::Z));
    assert!(!faces(Vec3::Z, Vec3::Z));
    assert!(!faces(Vec3::Z, Vec3::X), "seen from its side");
}
