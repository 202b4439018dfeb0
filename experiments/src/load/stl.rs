//! STL, ascii (any number of solids) and binary, welded where positions are equal. Facet normals and colours are not used.
//! O(n).

use std::collections::HashMap;
use std::path::Path;

use glam::{DAffine3, Vec3};

use super::part::{Model, Part};
use super::{LoadError, bytes, plain};

pub(super) fn read(path: &Path, data: &[u8]) -> Result<Model, LoadError> {
    let mut weld = Weld { part: Part { place: "facet", ..Default::default() }, index: HashMap::new() };
    // Binary files may start with "solid" too: what tells them apart is that their size follows from their count.
    let count = data.get(80..84).map(|b| u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])));
    let binary = count.is_some_and(|n| 84 + 50 * n == data.len() as u64);
    if !binary && data.trim_ascii_start().starts_with(b"solid") {
        ascii(path, data, &mut weld)?;
    } else {
        let Some(n) = count else {
            return Err(LoadError::data(path, "header", format!("{} bytes hold no STL header", data.len())));
        };
        if 84 + 50 * n > data.len() as u64 {
            let cause = format!("claims {n} facets, which take {} bytes; the file has {}", 84 + 50 * n, data.len());
            return Err(LoadError::data(path, "header", cause));
        }
        weld.part.name = "solid".into();
        for facet in data[84..].chunks_exact(50).take(n as usize) {
            let f = |i: usize| f32::from_le_bytes([facet[i], facet[i + 1], facet[i + 2], facet[i + 3]]);
            weld.facet([12, 24, 36].map(|i| Vec3::new(f(i), f(i + 4), f(i + 8))));
        }
    }
    Ok(Model {
        materials: vec![plain("default")],
        placements: vec![(0, DAffine3::IDENTITY)],
        parts: vec![weld.part],
        flat: true,
        ..Default::default()
    })
}

struct Weld {
    part: Part,
    index: HashMap<[u32; 3], u32>,
}

impl Weld {
    fn facet(&mut self, corners: [Vec3; 3]) {
        let t = corners.map(|p| {
            // + 0.0: -0 is 0.
            *self.index.entry((p + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert_with(|| {
                self.part.positions.push(p.as_dvec3());
                self.part.positions.len() as u32 - 1
            })
        });
        self.part.triangles.push(t);
        self.part.materials.push(0);
    }
}

fn ascii(path: &Path, data: &[u8], weld: &mut Weld) -> Result<(), LoadError> {
    weld.part.place = "line";
    let text = bytes::text(data);
    let mut corners: Vec<Vec3> = vec![];
    let mut open = false;
    for (i, line) in text.lines().enumerate() {
        let bad = |cause: String| LoadError::data(path, format!("line {}", i + 1), cause);
        let mut words = line.split_whitespace();
        match words.next().map(str::to_ascii_lowercase).as_deref() {
            Some("solid") => {
                if weld.part.name.is_empty() {
                    weld.part.name = words.collect::<Vec<_>>().join(" ");
                }
                open = true;
            }
            Some("vertex") => {
                let v: Vec<f32> = words.map_while(|w| w.parse().ok()).collect();
                let &[x, y, z] = v.as_slice() else {
                    return Err(bad(format!("\"{}\" is not a vertex of three numbers", bytes::excerpt(line, 60))));
                };
                corners.push(Vec3::new(x, y, z));
            }
            Some("endfacet") => {
                let &[a, b, c] = corners.as_slice() else {
                    return Err(bad(format!("a facet of {} corners, not 3", corners.len())));
                };
                weld.facet([a, b, c]);
                weld.part.places.push(i as u32 + 1);
                corners.clear();
            }
            Some("endsolid") => open = false,
            None | Some("facet" | "outer" | "endloop") => {}
            Some(_) => return Err(bad(format!("\"{}\" is not part of an STL file", bytes::excerpt(line, 60)))),
        }
    }
    if open || !corners.is_empty() {
        return Err(LoadError::data(path, "the end of the file", "comes before \"endsolid\""));
    }
    Ok(())
}
