//! From rows of texels, as they come back from a device, to images.

use farfield_core::image::{Picture, SurfaceImage};

/// A plane read back: rows of 4-byte texels, each row starting `row_bytes` after the one before.
#[derive(Clone, Copy, Debug)]
pub struct Plane<'a> {
    /// The bytes, from the first row's start.
    pub bytes: &'a [u8],
    /// From row to row.
    pub row_bytes: usize,
}

impl Plane<'_> {
    fn texels(self, size: [u32; 2]) -> impl Iterator<Item = [u8; 4]> {
        let row = 4 * size[0] as usize;
        (0..size[1] as usize)
            .flat_map(move |y| self.bytes[y * self.row_bytes..][..row].chunks_exact(4))
            .map(|t| [t[0], t[1], t[2], t[3]])
    }
}

/// A surface image of its four planes. Where nothing was hit albedo is 0 and depth infinite, whatever was cleared to.
///
/// # Panics
/// When a plane is shorter than its rows.
pub fn surface(
    size: [u32; 2],
    albedo: Plane<'_>,
    normal: Plane<'_>,
    depth: Plane<'_>,
    object: Plane<'_>,
) -> SurfaceImage {
    let object: Vec<u32> = object.texels(size).map(u32::from_le_bytes).collect();
    let or = |hit: &u32, there: [u8; 4], else_: [u8; 4]| if *hit == 0 { else_ } else { there };
    let opaque = |[r, g, b, _]: [u8; 4]| [r, g, b, 255];
    SurfaceImage {
        size,
        albedo: albedo.texels(size).zip(&object).map(|(t, hit)| or(hit, opaque(t), [0; 4])).collect(),
        normal: normal.texels(size).zip(&object).map(|(t, hit)| u32::from_le_bytes(or(hit, t, [0; 4]))).collect(),
        depth: depth
            .texels(size)
            .zip(&object)
            .map(|(t, hit)| f32::from_le_bytes(or(hit, t, f32::INFINITY.to_le_bytes())))
            .collect(),
        object,
    }
}

/// A picture of its plane.
///
/// # Panics
/// When the plane is shorter than its rows.
pub fn picture(size: [u32; 2], plane: Plane<'_>) -> Picture {
    Picture { size, rgba: plane.texels(size).collect() }
}
