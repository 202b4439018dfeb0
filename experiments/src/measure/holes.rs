//! Holes: pixels where the reference hits a surface and the candidate shows the background.

use farfield_core::image::SurfaceImage;

/// Which pixels are holes.
///
/// # Panics
/// When the two differ in size.
pub fn hole_mask(reference: &SurfaceImage, candidate: &SurfaceImage) -> Vec<bool> {
    assert_eq!(reference.size, candidate.size, "surfaces of different size are compared");
    reference.object.iter().zip(&candidate.object).map(|(&r, &c)| r != 0 && c == 0).collect()
}

/// The width of the widest hole, pixels: over the hole pixels the largest of the shortest run through it, of the four runs
/// along rows, columns and diagonals (a diagonal step counts sqrt 2). A slit of width w gives w to within a pixel, however
/// long it is. O(pixels).
///
/// # Panics
/// When the mask is not `size[0] * size[1]` long.
pub fn hole_width_px(mask: &[bool], size: [u32; 2]) -> f64 {
    let (w, h) = (size[0] as i64, size[1] as i64);
    assert_eq!(mask.len() as i64, w * h, "the mask does not have one entry a pixel");
    if !mask.contains(&true) {
        return 0.0;
    }
    let mut shortest = vec![f32::INFINITY; mask.len()];
    for (dx, dy, step) in
        [(1, 0, 1.0), (0, 1, 1.0), (1, 1, std::f32::consts::SQRT_2), (-1, 1, std::f32::consts::SQRT_2)]
    {
        let at = |x: i64, y: i64| (y * w + x) as usize;
        let inside = |x: i64, y: i64| (0..w).contains(&x) && (0..h).contains(&y) && mask[at(x, y)];
        for y in 0..h {
            for x in 0..w {
                if !inside(x, y) || inside(x - dx, y - dy) {
                    continue;
                }
                let mut n = 1;
                while inside(x + n * dx, y + n * dy) {
                    n += 1;
                }
                for k in 0..n {
                    let s = &mut shortest[at(x + k * dx, y + k * dy)];
                    *s = s.min(n as f32 * step);
                }
            }
        }
    }
    let widest = mask.iter().zip(&shortest).filter(|(m, _)| **m).map(|(_, s)| *s).fold(0.0, f32::max);
    f64::from(widest)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn width(picture: &str) -> f64 {
        let rows: Vec<&str> = picture.split_whitespace().collect();
        let mask: Vec<bool> = rows.iter().flat_map(|r| r.bytes().map(|b| b == b'#')).collect();
        hole_width_px(&mask, [rows[0].len() as u32, rows.len() as u32])
    }

    #[test]
    fn a_hole_is_as_wide_as_its_narrow_side() {
        assert_eq!(width("..... ..... ....."), 0.0);
        assert_eq!(width("..... .###. ....."), 1.0);
        assert_eq!(width(".##.. .##.. .##.. .##.."), 2.0);
        assert!((width("#..## ..### ..###") - 8f64.sqrt()).abs() < 1e-6);
        assert_eq!(width("#.... .#... ..#.. ...#."), 1.0);
        assert!((width("#..## ..### ..###") - 8f64.sqrt()).abs() < 1e-6);
    }
}
