//! Points and lines drawn over what was cast, by their depths: [`farfield_core::covered`] says which pixels they cover.
//!
//! A ray has no chance to meet what is as large as a pixel wherever it stands, so they are drawn, not cast. The nearest wins; of
//! equally near ones what was there first, in the order in which they are drawn. O(points and lines + pixels that they cover), on one
//! thread: the reference.

use farfield_core::Camera;
use farfield_core::covered::{Screen, faces};
use farfield_core::image::{SurfaceImage, from_octahedral, octahedral};

use crate::block::{Lines, Points};
use crate::frame::Placed;
use crate::texel;

/// Draws points over a surface image.
pub(crate) fn points(into: &mut SurfaceImage, camera: &Camera, draws: &[Placed<'_, Points>]) {
    let screen = Screen::new(camera);
    let width = camera.size[0] as usize;
    for &Placed { part, from_eye, object } in draws {
        for v in &part.vertices {
            let seen = v.position + from_eye;
            let normal = from_octahedral(v.normal);
            let front = faces(normal, seen);
            if !(front || part.two_sided) {
                continue;
            }
            let Some(splat) = screen.splat(seen, part.radius) else { continue };
            let normal = octahedral(if part.two_sided && normal.dot(seen) > 0.0 { -normal } else { normal });
            let [r, g, b, _] = v.albedo;
            for row in splat.rows {
                let row = row as usize * width;
                for i in row + splat.columns.start as usize..row + splat.columns.end as usize {
                    if splat.depth < into.depth[i] {
                        into.depth[i] = splat.depth;
                        into.albedo[i] = [r, g, b, 255];
                        into.normal[i] = normal;
                        into.object[i] = object;
                    }
                }
            }
        }
    }
}

/// Draws lines over a surface image.
pub(crate) fn lines(into: &mut SurfaceImage, camera: &Camera, draws: &[Placed<'_, Lines>]) {
    let screen = Screen::new(camera);
    for &Placed { part, from_eye, object } in draws {
        for pair in part.indices.chunks_exact(2) {
            let ends = [pair[0], pair[1]].map(|i| &part.vertices[i as usize]);
            let Some(line) = screen.line(ends.map(|v| v.position + from_eye)) else { continue };
            let [normal, other_normal] = ends.map(|v| from_octahedral(v.normal));
            let [albedo, other_albedo] = ends.map(|v| texel::decode(v.albedo));
            for p in line.pixels() {
                let i = into.at(p.pixel[0], p.pixel[1]);
                if p.depth < into.depth[i] {
                    into.depth[i] = p.depth;
                    into.albedo[i] = texel::encode(albedo * (1.0 - p.weight) + other_albedo * p.weight);
                    into.normal[i] = octahedral(normal * (1.0 - p.weight) + other_normal * p.weight);
                    into.object[i] = object;
                }
            }
        }
    }
}
