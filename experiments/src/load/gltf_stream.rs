//! Primitives of glTF meshes, a window of their accessors at a time.

use glam::{DVec3, Vec2, Vec3};
use gltf::json::mesh::Mode;

use super::LoadError;
use super::gltf::{Shape, placement, srgb};
use super::gltf_accessor::Document;
use super::sink::Sink;

/// Gives a primitive's vertices and triangles to `sink`. `vertices` counts those of all primitives, `triangles` those of the mesh.
/// Of accessors that primitives share, each takes the range that it uses.
pub(super) fn primitive(
    doc: &Document,
    shape: &Shape<'_>,
    place: &str,
    batch: u64,
    (vertices, triangles): (&mut u32, &mut u32),
    sink: &mut impl Sink<u32>,
) -> Result<(), LoadError> {
    let bad = |cause: String| LoadError::data(doc.path, place, cause);
    let n = doc.count(shape.positions);
    let corners = shape.indices.map_or(n, |i| doc.count(i));
    let indices = |window: std::ops::Range<u64>| match shape.indices {
        Some(id) => doc.some_indices(id, window),
        None => Ok((window.start as u32..window.end as u32).collect()),
    };
    let windows = |n: u64| (0..n).step_by(batch as usize).map(move |at| at..(at + batch).min(n));
    let (mut low, mut high) = (u32::MAX, 0);
    for w in windows(corners) {
        for (at, v) in (w.start..).zip(indices(w)?) {
            if u64::from(v) >= n {
                return Err(bad(format!("index {at} names vertex {v} of {n}")));
            }
            (low, high) = (low.min(v), high.max(v));
        }
    }
    if corners < 3 {
        return Ok(());
    }
    let first = *vertices;
    let used = u64::from(low)..u64::from(high) + 1;
    if u64::from(first) + used.end - used.start > u64::from(u32::MAX) {
        return Err(bad("there are more than 2^32 vertices".into()));
    }
    let placed = placement(shape.info);
    for w in windows(used.end - used.start) {
        let w = used.start + w.start..used.start + w.end;
        let normals = shape.normals.map(|a| doc.some_numbers::<3>(a, 0.0, w.clone())).transpose()?;
        let uvs = shape.uvs.map(|a| doc.some_numbers::<2>(a, 0.0, w.clone())).transpose()?;
        let colors = shape.colors.map(|a| doc.some_numbers::<4>(a, 1.0, w.clone())).transpose()?;
        for (i, p) in doc.some_numbers::<3>(shape.positions, 0.0, w)?.into_iter().enumerate() {
            sink.position(DVec3::from(p.map(f64::from)))?;
            sink.normal(normals.as_ref().map(|n| Vec3::from(n[i])))?;
            sink.uv(uvs.as_ref().map(|uv| placed(Vec2::from(uv[i]))))?;
            sink.color(colors.as_ref().map(|c| srgb([c[i][0], c[i][1], c[i][2]])))?;
        }
    }
    *vertices += (used.end - used.start) as u32;
    // The last two corners of a strip, and the first of a fan with its last, begin what comes in the next window.
    let (mut held, mut start): (Vec<u32>, Option<u32>) = (vec![], None);
    let mut odd = false;
    let mut face = |t: [u32; 3]| {
        *triangles += 1;
        sink.face(&t.map(|v| v - low + first), shape.material, *triangles - 1)
    };
    for w in windows(corners) {
        held.extend(indices(w)?);
        let centre = *start.get_or_insert(held[0]);
        match shape.mode {
            Mode::TriangleStrip => {
                for w in held.windows(3) {
                    face(if odd { [w[1], w[0], w[2]] } else { [w[0], w[1], w[2]] })?;
                    odd = !odd;
                }
                held.drain(..held.len().saturating_sub(2));
            }
            // Section 3.7.2.1: (v[i+1], v[i+2], v[0]).
            Mode::TriangleFan => {
                let skip = usize::from(!std::mem::replace(&mut odd, true));
                held.windows(2).skip(skip).try_for_each(|w| face([w[0], w[1], centre]))?;
                held.drain(..held.len() - 1);
            }
            _ => {
                let whole = held.len() / 3 * 3;
                held[..whole].chunks_exact(3).try_for_each(|t| face([t[0], t[1], t[2]]))?;
                held.drain(..whole);
            }
        }
    }
    Ok(())
}
