//! Payloads as the store keeps them: meshes through meshoptimizer's codecs (Kapoulkine; indices by the order of vertices, vertices byte by
//! byte as differences), everything else as it is.
//!
//! Lossless, and no strategy has to know of it: positions on a grid (whole multiples of a power of two) are kept as whole
//! numbers, normals that are some octahedral code's vector as that code, albedo that is the same all over once; what is on no grid
//! is kept as floats. Triangles are put in an order that their neighbours' vertices profit from, each counter-clockwise as before; vertices in the order of
//! their first use, those that no triangle uses go.

use farfield_core::Fault;
use farfield_core::octahedral;
use farfield_core::payload::{MeshPart, Part, Payload};
use glam::{IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::{decode, encode};

/// A mesh, packed. What is not there takes no bytes.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Packed {
    vertices: u32,
    triangles: u32,
    indices: Vec<u8>,
    positions: Positions,
    normals: Normals,
    albedo: Albedo,
}

#[derive(Debug, Serialize, Deserialize)]
enum Positions {
    Floats(Vec<u8>),
    /// (base + number) * 2^exponent.
    Grid {
        exponent: i16,
        base: [i32; 3],
        wide: bool,
        bytes: Vec<u8>,
    },
}

#[derive(Debug, Serialize, Deserialize)]
enum Normals {
    Floats(Vec<u8>),
    Codes(Vec<u8>),
}

#[derive(Debug, Serialize, Deserialize)]
enum Albedo {
    One([u8; 4]),
    Many(Vec<u8>),
}

impl Default for Positions {
    fn default() -> Self {
        Self::Floats(vec![])
    }
}
impl Default for Normals {
    fn default() -> Self {
        Self::Floats(vec![])
    }
}
impl Default for Albedo {
    fn default() -> Self {
        Self::One([0; 4])
    }
}

/// A payload as bytes.
///
/// # Errors
/// [`Fault::Data`], which no whole payload gives.
pub fn pack(payload: &Payload) -> Result<Vec<u8>, Fault> {
    let mut rest = payload.clone();
    let mut packed: Vec<Option<Packed>> = vec![];
    for part in &mut rest.parts {
        let Part::Mesh(m) = part else {
            packed.push(None);
            continue;
        };
        let whole = m.indices.iter().all(|&i| (i as usize) < m.positions.len())
            && [m.normals.len(), m.albedo.len()] == [m.positions.len(); 2];
        packed.push(if whole && !m.indices.is_empty() { Some(packed_mesh(m)?) } else { None });
        if packed.last().is_some_and(Option::is_some) {
            *m = MeshPart { two_sided: m.two_sided, ..MeshPart::default() };
        }
    }
    encode(&(rest, packed))
}

/// Back from [`pack`].
///
/// # Errors
/// [`Fault::Data`] where the bytes are of something else.
pub fn unpack(bytes: &[u8]) -> Result<Payload, Fault> {
    let (mut payload, packed): (Payload, Vec<Option<Packed>>) = decode(bytes)?;
    for (part, packed) in payload.parts.iter_mut().zip(packed) {
        if let (Part::Mesh(m), Some(p)) = (part, packed) {
            *m = MeshPart { two_sided: m.two_sided, ..unpacked_mesh(&p)? };
        }
    }
    Ok(payload)
}

fn coded<T>(result: meshopt::Result<T>) -> Result<T, Fault> {
    result.map_err(|e| Fault::Data { place: "mesh in the store".into(), cause: e.to_string() })
}

fn packed_mesh(m: &MeshPart) -> Result<Packed, Fault> {
    let mut indices = meshopt::optimize_vertex_cache(&m.indices, m.positions.len());
    // Vertices by their first use.
    let (mut remap, mut order) = (vec![u32::MAX; m.positions.len()], vec![]);
    for i in &mut indices {
        let new = &mut remap[*i as usize];
        if *new == u32::MAX {
            *new = order.len() as u32;
            order.push(*i as usize);
        }
        *i = *new;
    }
    let vertices = order.len();
    let positions: Vec<Vec3> = order.iter().map(|&i| m.positions[i]).collect();
    let normals: Vec<Vec3> = order.iter().map(|&i| m.normals[i]).collect();
    let albedo: Vec<[u8; 4]> = order.iter().map(|&i| m.albedo[i]).collect();
    Ok(Packed {
        vertices: vertices as u32,
        triangles: (indices.len() / 3) as u32,
        indices: coded(meshopt::encode_index_buffer(&indices, vertices))?,
        positions: pack_positions(&positions)?,
        normals: pack_normals(&normals)?,
        albedo: match albedo.first() {
            Some(&first) if albedo.iter().all(|a| *a == first) => Albedo::One(first),
            _ => Albedo::Many(coded(meshopt::encode_vertex_buffer(&albedo))?),
        },
    })
}

fn unpacked_mesh(p: &Packed) -> Result<MeshPart, Fault> {
    let n = p.vertices as usize;
    let floats = |bytes: &[u8]| -> Result<Vec<Vec3>, Fault> {
        Ok(coded(meshopt::decode_vertex_buffer::<[f32; 3]>(bytes, n))?.into_iter().map(Vec3::from).collect())
    };
    let positions = match &p.positions {
        Positions::Floats(bytes) => floats(bytes)?,
        Positions::Grid { exponent, base, wide, bytes } => {
            let step = f32::from(*exponent).exp2();
            let at = |v: [u32; 3]| (IVec3::from(*base) + glam::UVec3::from(v).as_ivec3()).as_vec3() * step;
            if *wide {
                coded(meshopt::decode_vertex_buffer::<[u32; 3]>(bytes, n))?.into_iter().map(at).collect()
            } else {
                let narrow = coded(meshopt::decode_vertex_buffer::<[u16; 4]>(bytes, n))?;
                narrow.into_iter().map(|v| at([v[0], v[1], v[2]].map(u32::from))).collect()
            }
        }
    };
    let normals = match &p.normals {
        Normals::Floats(bytes) => floats(bytes)?,
        Normals::Codes(bytes) => {
            let codes = coded(meshopt::decode_vertex_buffer::<[i16; 2]>(bytes, n))?;
            codes.into_iter().map(|c| octahedral::vector(c, octahedral::FINE_BITS)).collect()
        }
    };
    let albedo = match &p.albedo {
        Albedo::One(a) => vec![*a; n],
        Albedo::Many(bytes) => coded(meshopt::decode_vertex_buffer(bytes, n))?,
    };
    let indices: Vec<u32> = coded(meshopt::decode_index_buffer(&p.indices, 3 * p.triangles as usize))?;
    if indices.iter().any(|&i| i as usize >= n) {
        return Err(Fault::Data { place: "mesh in the store".into(), cause: "an index without a vertex".into() });
    }
    Ok(MeshPart { positions, normals, albedo, indices, two_sided: false })
}

/// The exponent of the largest power of two that a finite number is a multiple of; `None` for 0, which is one of all.
fn exponent(v: f32) -> Option<i32> {
    let bits = v.to_bits();
    let (raw, mantissa) = ((bits >> 23 & 255) as i32, bits & 0x7f_ffff);
    match (raw, mantissa) {
        (0, 0) => None,
        (0, m) => Some(m.trailing_zeros() as i32 - 149),
        (_, m) => Some(raw - 150 + (m | 1 << 23).trailing_zeros() as i32),
    }
}

fn pack_positions(positions: &[Vec3]) -> Result<Positions, Fault> {
    let floats = || {
        let raw: Vec<[f32; 3]> = positions.iter().map(|p| p.to_array()).collect();
        Ok(Positions::Floats(coded(meshopt::encode_vertex_buffer(&raw))?))
    };
    let all = || positions.iter().flat_map(|p| p.to_array());
    // -0 is no whole number.
    if all().any(|v| !v.is_finite() || v.to_bits() == (-0f32).to_bits()) {
        return floats();
    }
    let exponent = all().filter_map(exponent).min().unwrap_or(0);
    let step = (exponent as f32).exp2();
    // Numbers of more than 24 bits are not exact as floats.
    if step == 0.0 || all().any(|v| (v / step).abs() >= (1 << 24) as f32) {
        return floats();
    }
    let whole: Vec<IVec3> = positions.iter().map(|p| (*p / step).as_ivec3()).collect();
    let base = whole.iter().copied().reduce(IVec3::min).unwrap_or_default();
    let wide = whole.iter().any(|w| (*w - base).max_element() > i32::from(u16::MAX));
    let bytes = if wide {
        let v: Vec<[u32; 3]> = whole.iter().map(|w| (*w - base).as_uvec3().to_array()).collect();
        coded(meshopt::encode_vertex_buffer(&v))?
    } else {
        let narrow = |w: &IVec3| (*w - base).as_u16vec3();
        let v: Vec<[u16; 4]> = whole.iter().map(|w| narrow(w).extend(0).to_array()).collect();
        coded(meshopt::encode_vertex_buffer(&v))?
    };
    Ok(Positions::Grid { exponent: exponent as i16, base: base.to_array(), wide, bytes })
}

fn pack_normals(normals: &[Vec3]) -> Result<Normals, Fault> {
    let bits = octahedral::FINE_BITS;
    let codes: Vec<[i16; 2]> = normals.iter().map(|n| octahedral::code(*n, bits)).collect();
    let same = |(n, c): (&Vec3, &[i16; 2])| {
        octahedral::vector(*c, bits).to_array().map(f32::to_bits) == n.to_array().map(f32::to_bits)
    };
    if normals.iter().zip(&codes).all(same) {
        return Ok(Normals::Codes(coded(meshopt::encode_vertex_buffer(&codes))?));
    }
    let raw: Vec<[f32; 3]> = normals.iter().map(|n| n.to_array()).collect();
    Ok(Normals::Floats(coded(meshopt::encode_vertex_buffer(&raw))?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use farfield_core::Aabb;
    use glam::DVec3;
    use proptest::prelude::*;

    /// The triangles with all they wear, whatever their order and first corner.
    fn triangles(m: &MeshPart) -> Vec<[[u32; 7]; 3]> {
        let corner = |i: u32| {
            let (p, n) = (m.positions[i as usize], m.normals[i as usize]);
            let bits = [p.x, p.y, p.z, n.x, n.y, n.z].map(f32::to_bits);
            [bits[0], bits[1], bits[2], bits[3], bits[4], bits[5], u32::from_le_bytes(m.albedo[i as usize])]
        };
        let turned = |t: &[u32]| {
            let c = [t[0], t[1], t[2]].map(corner);
            (0..3).map(|k| [c[k], c[(k + 1) % 3], c[(k + 2) % 3]]).min().unwrap()
        };
        let mut all: Vec<_> = m.indices.chunks_exact(3).map(turned).collect();
        all.sort_unstable();
        all
    }

    fn mesh(
        places: Vec<(f32, f32, f32)>,
        corners: Vec<usize>,
        step: Option<f32>,
        rounded: bool,
        coloured: bool,
    ) -> MeshPart {
        let n = places.len();
        let place = |(x, y, z): (f32, f32, f32)| {
            let p = Vec3::new(x, y, z);
            step.map_or(p, |s| (p / s).round() * s + Vec3::ZERO)
        };
        let normal = |(x, y, z): (f32, f32, f32)| {
            let n = Vec3::new(y, z, x).normalize_or(Vec3::X);
            if rounded { octahedral::rounded(n, octahedral::FINE_BITS) } else { n }
        };
        MeshPart {
            normals: places.iter().copied().map(normal).collect(),
            albedo: (0..n).map(|i| if coloured { [i as u8, 2, 3, 255] } else { [7, 7, 7, 255] }).collect(),
            positions: places.into_iter().map(place).collect(),
            indices: corners.chunks_exact(3).flatten().map(|c| (c % n) as u32).collect(),
            two_sided: coloured,
        }
    }

    proptest! {
        #[test]
        fn every_mesh_comes_back_bit_for_bit(
            places in prop::collection::vec((-90f32..90.0, -90f32..90.0, -90f32..90.0), 1..60),
            corners in prop::collection::vec(0usize..60, 0..200),
            step in prop::option::of(-20i32..6), rounded: bool, coloured: bool
        ) {
            let m = mesh(places, corners, step.map(|s| (s as f32).exp2()), rounded, coloured);
            let payload = Payload { origin: DVec3::ONE, bounds: Aabb::of([Vec3::ONE]), parts: vec![Part::Mesh(m.clone())] };
            let back = unpack(&pack(&payload).unwrap()).unwrap();
            let Part::Mesh(b) = &back.parts[0] else { panic!("no mesh") };
            prop_assert_eq!(triangles(b), triangles(&m));
            prop_assert_eq!((b.two_sided, back.origin, back.bounds), (m.two_sided, payload.origin, payload.bounds));
        }

        #[test]
        fn exponents_are_those_of_the_grid(m in -8_000_000i32..8_000_000, e in -60i32..60) {
            let v = m as f32 * (e as f32).exp2();
            match exponent(v) {
                None => prop_assert_eq!(v, 0.0),
                Some(x) => {
                    let whole = f64::from(v) / f64::from(x).exp2();
                    prop_assert!(whole.fract() == 0.0 && (whole as i64) % 2 != 0);
                }
            }
        }
    }

    #[test]
    fn what_is_on_a_grid_takes_a_few_bytes_a_triangle() {
        let n = 64u32;
        let at = |i: u32| {
            let (x, y) = ((i % (n + 1)) as f32 / 64.0, (i / (n + 1)) as f32 / 64.0);
            Vec3::new(x, y, ((x * 7.0).sin() * 64.0).round() / 1024.0)
        };
        let positions: Vec<Vec3> = (0..(n + 1) * (n + 1)).map(at).collect();
        let square = |i: u32| {
            let a = i % n + i / n * (n + 1);
            [a, a + 1, a + n + 1, a + 1, a + n + 2, a + n + 1]
        };
        let mut m = MeshPart {
            normals: vec![Vec3::Z; positions.len()],
            albedo: vec![[9; 4]; positions.len()],
            indices: (0..n * n).flat_map(square).collect(),
            positions,
            two_sided: false,
        };
        let bytes = |m: &MeshPart| {
            let payload = Payload { origin: DVec3::ZERO, bounds: Aabb::EMPTY, parts: vec![Part::Mesh(m.clone())] };
            pack(&payload).unwrap().len() as f64 / f64::from(2 * n * n)
        };
        let on_grid = bytes(&m);
        assert!(on_grid < 3.0, "{on_grid}");
        // Off the grid all bits of floats are kept.
        m.positions[0].x = 0.1;
        assert!(bytes(&m) > on_grid);
    }
}
