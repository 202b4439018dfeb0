//! Payloads as the store keeps them: triangles through meshoptimizer's index codec (Kapoulkine), vertices as what a prediction leaves, everything
//! else as it is.
//!
//! Lossless, and no strategy has to know of it: positions on a grid (whole multiples of a power of two) are kept as whole
//! numbers, normals that are some octahedral code's vector as that code, albedo that is the same all over once; what is on no grid
//! is kept as floats. Triangles are put in an order that their neighbours' vertices profit from, each counter-clockwise as before; vertices in the order of
//! their first use, those that no triangle uses go.
//!
//! A position is predicted by the parallelogram that the triangle across its edge spans (Touma and Gotsman, *Triangle mesh compression*,
//! 1998), a normal by the triangles round its vertex. Where most positions are on a coarser grid than the rest, as in a node whose border
//! is finer than its inside, these are kept as numbers of that grid. Differences are kept byte by byte, each byte through zstd's Huffman coder.

use farfield_core::Fault;
use farfield_core::octahedral;
use farfield_core::payload::{MeshPart, Part, Payload, PointsPart};
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
    /// Whole numbers times 2^exponent.
    Grid {
        exponent: i16,
        /// Of so many bits the last ones are 0 where `coarse` says so, a bit a vertex; where it is empty, everywhere.
        zeros: u8,
        coarse: Vec<u8>,
        /// Differences from the prediction.
        off: Vec<Vec<u8>>,
        off_fine: Vec<Vec<u8>>,
    },
}

#[derive(Debug, Serialize, Deserialize)]
enum Normals {
    Floats(Vec<u8>),
    /// Of so many bits a coordinate; differences from the prediction.
    Codes {
        bits: u8,
        off: Vec<Vec<u8>>,
    },
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
        if let Part::Points(p) = part
            && [p.normals.len(), p.albedo.len()] == [p.positions.len(); 2]
        {
            packed.push(Some(packed_vertices(
                p.positions.len(),
                &chain(p.positions.len()),
                &p.positions,
                &p.normals,
                &p.albedo,
            )?));
            *p = PointsPart { radius: p.radius, two_sided: p.two_sided, ..PointsPart::default() };
            continue;
        }
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
        match (part, packed) {
            (Part::Mesh(m), Some(p)) => *m = MeshPart { two_sided: m.two_sided, ..unpacked_mesh(&p)? },
            (Part::Points(m), Some(p)) => {
                (m.positions, m.normals, m.albedo) = unpacked_vertices(&p, &chain(p.vertices as usize))?;
            }
            (part, _) => fit(part),
        }
    }
    payload.parts.shrink_to_fit();
    Ok(payload)
}

/// Gives back what arrays have grown beyond their length.
fn fit(part: &mut Part) {
    let mesh = |m: &mut MeshPart| {
        [&mut m.positions, &mut m.normals].into_iter().for_each(Vec::shrink_to_fit);
        m.albedo.shrink_to_fit();
        m.indices.shrink_to_fit();
    };
    match part {
        Part::Mesh(m) => mesh(m),
        Part::Projected(p) => {
            mesh(&mut p.mesh);
            p.views.shrink_to_fit();
            p.projectors.shrink_to_fit();
        }
        Part::Atlas(a) => [&mut a.albedo, &mut a.normal].into_iter().for_each(Vec::shrink_to_fit),
        Part::Layered(l) => {
            l.counts.shrink_to_fit();
            l.depth.shrink_to_fit();
            l.albedo.shrink_to_fit();
            l.normal.shrink_to_fit();
            l.object.shrink_to_fit();
            l.objects.shrink_to_fit();
        }
        Part::Points(p) => {
            [&mut p.positions, &mut p.normals].into_iter().for_each(Vec::shrink_to_fit);
            p.albedo.shrink_to_fit();
        }
        Part::Lines(l) => {
            [&mut l.positions, &mut l.normals].into_iter().for_each(Vec::shrink_to_fit);
            l.albedo.shrink_to_fit();
            l.indices.shrink_to_fit();
        }
    }
}

fn coded<T>(result: meshopt::Result<T>) -> Result<T, Fault> {
    result.map_err(|e| Fault::Data { place: "mesh in the store".into(), cause: e.to_string() })
}

fn packed_mesh(m: &MeshPart) -> Result<Packed, Fault> {
    let mut indices = meshopt::optimize_vertex_cache_strip(&m.indices, m.positions.len());
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
    let coded_indices = coded(meshopt::encode_index_buffer(&indices, vertices))?;
    // The codec turns triangles: predictions go by what comes back.
    let indices: Vec<u32> = coded(meshopt::decode_index_buffer(&coded_indices, indices.len()))?;
    let packed = packed_vertices(vertices, &indices, &positions, &normals, &albedo)?;
    Ok(Packed { triangles: (indices.len() / 3) as u32, indices: coded_indices, ..packed })
}

/// Triangles without area that make each vertex follow the one before.
fn chain(n: usize) -> Vec<u32> {
    (0..n as u32).flat_map(|v| [v, v.saturating_sub(1), v.saturating_sub(1)]).collect()
}

fn packed_vertices(
    n: usize,
    indices: &[u32],
    positions: &[Vec3],
    normals: &[Vec3],
    albedo: &[[u8; 4]],
) -> Result<Packed, Fault> {
    Ok(Packed {
        vertices: n as u32,
        positions: pack_positions(positions, indices)?,
        normals: pack_normals(normals, positions, indices)?,
        albedo: match albedo.first() {
            Some(&first) if albedo.iter().all(|a| *a == first) => Albedo::One(first),
            _ => Albedo::Many(coded(meshopt::encode_vertex_buffer(albedo))?),
        },
        ..Packed::default()
    })
}

fn unpacked_mesh(p: &Packed) -> Result<MeshPart, Fault> {
    let n = p.vertices as usize;
    let indices: Vec<u32> = coded(meshopt::decode_index_buffer(&p.indices, 3 * p.triangles as usize))?;
    // By their first use, so that none is asked for before it is there.
    let mut next = 0;
    for &i in &indices {
        if i > next || i as usize >= n {
            return Err(damaged("an index without a vertex"));
        }
        next = next.max(i + 1);
    }
    if next as usize != n {
        return Err(damaged("a vertex without a triangle"));
    }
    let (positions, normals, albedo) = unpacked_vertices(p, &indices)?;
    Ok(MeshPart { positions, normals, albedo, indices, two_sided: false })
}

/// Positions, normals and albedo.
type Vertices = (Vec<Vec3>, Vec<Vec3>, Vec<[u8; 4]>);

/// Those of vertices that `indices` use in their order.
fn unpacked_vertices(p: &Packed, indices: &[u32]) -> Result<Vertices, Fault> {
    let n = p.vertices as usize;
    let floats = |bytes: &[u8]| -> Result<Vec<Vec3>, Fault> {
        Ok(coded(meshopt::decode_vertex_buffer::<[f32; 3]>(bytes, n))?.into_iter().map(Vec3::from).collect())
    };
    let positions = match &p.positions {
        Positions::Floats(bytes) => floats(bytes)?,
        Positions::Grid { exponent, zeros, coarse, off, off_fine } => {
            let step = f32::from(*exponent).exp2();
            if *zeros > 31 || !(coarse.is_empty() || coarse.len() == n.div_ceil(8)) {
                return Err(damaged("its grid"));
            }
            let is_coarse = |v: usize| coarse.is_empty() || coarse[v / 8] >> (v % 8) & 1 != 0;
            let of_coarse = (0..n).filter(|&v| is_coarse(v)).count();
            let mut off = whole(off, 3 * of_coarse)?.into_iter();
            let mut off_fine = whole(off_fine, 3 * (n - of_coarse))?.into_iter();
            let mut out: Vec<IVec3> = vec![IVec3::ZERO; n];
            predict(indices, &mut out, &mut |v, guess, _| {
                let (zeros, off) = if is_coarse(v) { (*zeros, &mut off) } else { (0, &mut off_fine) };
                let mut next = || off.next().unwrap_or_default();
                let off = IVec3::new(next(), next(), next());
                rounded_down(guess, zeros).wrapping_add(off) << IVec3::splat(zeros.into())
            });
            out.into_iter().map(|v| v.as_vec3() * step).collect()
        }
    };
    let normals = match &p.normals {
        Normals::Floats(bytes) => floats(bytes)?,
        Normals::Codes { bits, off } => {
            if !(2..=16).contains(bits) {
                return Err(damaged("its normals"));
            }
            let (bits, off) = (u32::from(*bits), whole(off, 2 * n)?);
            let guesses = normals_of(&positions, indices);
            let code = |(guess, off): (&Vec3, &[i32])| {
                let [x, y] = octahedral::code(*guess, bits);
                octahedral::vector([x.wrapping_add(off[0] as i16), y.wrapping_add(off[1] as i16)], bits)
            };
            guesses.iter().zip(off.chunks_exact(2)).map(code).collect()
        }
    };
    let albedo = match &p.albedo {
        Albedo::One(a) => vec![*a; n],
        Albedo::Many(bytes) => coded(meshopt::decode_vertex_buffer(bytes, n))?,
    };
    Ok((positions, normals, albedo))
}

fn damaged(what: &str) -> Fault {
    Fault::Data { place: "mesh in the store".into(), cause: what.into() }
}

/// Triangles whose edges are remembered.
const RECENT: usize = 32;

/// Asks for the vertices in the order of their first use, each with a guess from those before it: the fourth corner of the parallelogram over the
/// triangle across its edge where one of the last few is that, else the vertex before.
fn predict(indices: &[u32], at: &mut [IVec3], next: &mut dyn FnMut(usize, IVec3, IVec3) -> IVec3) {
    let mut recent = [[u32::MAX; 3]; RECENT];
    let mut known = 0u32;
    for (i, t) in indices.chunks_exact(3).enumerate() {
        for k in 0..3 {
            let (v, a, b) = (t[k], t[(k + 1) % 3], t[(k + 2) % 3]);
            if v < known {
                continue;
            }
            let mut guess = known.checked_sub(1).map_or(IVec3::ZERO, |v| at[v as usize]);
            if a < known && b < known {
                // Across the edge from a to b the triangle that runs from b to a, the last one first.
                let across = (1..=RECENT.min(i)).find_map(|back| {
                    let r = recent[(i - back) % RECENT];
                    (0..3).find(|&j| r[j] == b && r[(j + 1) % 3] == a).map(|j| r[(j + 2) % 3])
                });
                guess = at[a as usize];
                if let Some(d) = across {
                    guess = guess.wrapping_add(at[b as usize]).wrapping_sub(at[d as usize]);
                }
            } else if a < known {
                guess = at[a as usize];
            } else if b < known {
                guess = at[b as usize];
            }
            at[v as usize] = next(v as usize, guess, at[v as usize]);
            known = v + 1;
        }
        recent[i % RECENT] = [t[0], t[1], t[2]];
    }
}

/// A guess in steps of 2^zeros, the nearest.
fn rounded_down(guess: IVec3, zeros: u8) -> IVec3 {
    if zeros == 0 { guess } else { guess.wrapping_add(IVec3::splat(1 << (zeros - 1))) >> IVec3::splat(zeros.into()) }
}

/// Normals as the triangles have them, weighted by area; zero where there is none.
fn normals_of(positions: &[Vec3], indices: &[u32]) -> Vec<Vec3> {
    let mut out = vec![Vec3::ZERO; positions.len()];
    for t in indices.chunks_exact(3) {
        let [a, b, c] = [t[0], t[1], t[2]].map(|i| positions[i as usize]);
        let area = (b - a).cross(c - a);
        t.iter().for_each(|&v| out[v as usize] += area);
    }
    out
}

/// Whole numbers, small ones mostly: their bytes, the lowest of all first, each coded apart; without the highest where those are 0.
fn bytes_of(numbers: &[i32]) -> Result<Vec<Vec<u8>>, Fault> {
    let folded: Vec<u32> = numbers.iter().map(|&v| (v << 1 ^ v >> 31) as u32).collect();
    let bits = 32 - folded.iter().fold(0, |a, b| a | b).leading_zeros();
    (0..bits.div_ceil(8))
        .map(|k| {
            let plane: Vec<u8> = folded.iter().map(|v| (v >> (8 * k)) as u8).collect();
            zstd::bulk::compress(&plane, PLANES).map_err(|e| damaged(&e.to_string()))
        })
        .collect()
}

/// zstd's level for single bytes: there is hardly a match to be found, the Huffman coder does the work.
const PLANES: i32 = 1;

/// Back from [`bytes_of`].
fn whole(planes: &[Vec<u8>], count: usize) -> Result<Vec<i32>, Fault> {
    let mut folded = vec![0u32; count];
    if planes.len() > 4 {
        return Err(damaged("numbers of more than 32 bits"));
    }
    for (k, plane) in planes.iter().enumerate() {
        let plane = zstd::bulk::decompress(plane, count).map_err(|e| damaged(&e.to_string()))?;
        if plane.len() != count {
            return Err(damaged(&format!("{} numbers for {count}", plane.len())));
        }
        folded.iter_mut().zip(plane).for_each(|(v, byte)| *v |= u32::from(byte) << (8 * k));
    }
    Ok(folded.into_iter().map(|v| (v >> 1) as i32 ^ -((v & 1) as i32)).collect())
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

fn pack_positions(positions: &[Vec3], indices: &[u32]) -> Result<Positions, Fault> {
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
    let mut whole: Vec<IVec3> = positions.iter().map(|p| (*p / step).as_ivec3()).collect();
    let zeros_of = |v: &IVec3| (v.x | v.y | v.z).trailing_zeros().min(24);
    let mut with = [0usize; 25];
    whole.iter().for_each(|v| (0..=zeros_of(v)).for_each(|z| with[z as usize] += 1));
    let zeros = (0..25).max_by_key(|&z| (3 * z * with[z], std::cmp::Reverse(z))).unwrap_or(0) as u8;
    let coarse: Vec<bool> = whole.iter().map(|v| zeros_of(v) >= zeros.into()).collect();
    let (mut off, mut off_fine) = (vec![], vec![]);
    predict(indices, &mut whole, &mut |v, guess, own| {
        let (zeros, off) = if coarse[v] { (zeros, &mut off) } else { (0, &mut off_fine) };
        off.extend(((own >> IVec3::splat(zeros.into())).wrapping_sub(rounded_down(guess, zeros))).to_array());
        own
    });
    let mut bits = vec![];
    if !coarse.iter().all(|&c| c) {
        let byte = |run: &[bool]| run.iter().enumerate().fold(0, |b, (k, &c)| b | u8::from(c) << k);
        bits = coarse.chunks(8).map(byte).collect();
    }
    let (off, off_fine) = (bytes_of(&off)?, bytes_of(&off_fine)?);
    Ok(Positions::Grid { exponent: exponent as i16, zeros, coarse: bits, off, off_fine })
}

fn pack_normals(normals: &[Vec3], positions: &[Vec3], indices: &[u32]) -> Result<Normals, Fault> {
    let raw = || -> Vec<[f32; 3]> { normals.iter().map(|n| n.to_array()).collect() };
    let bits_of = |bits: u32| {
        let same =
            |n: &Vec3| octahedral::rounded(*n, bits).to_array().map(f32::to_bits) == n.to_array().map(f32::to_bits);
        normals.iter().all(same)
    };
    let Some(bits) = (8..=octahedral::FINE_BITS).find(|&b| bits_of(b)) else {
        return Ok(Normals::Floats(coded(meshopt::encode_vertex_buffer(&raw()))?));
    };
    let mut off = vec![];
    for (n, guess) in normals.iter().zip(normals_of(positions, indices)) {
        let ([x, y], [a, b]) = (octahedral::code(*n, bits), octahedral::code(guess, bits));
        off.extend([i32::from(x.wrapping_sub(a)), i32::from(y.wrapping_sub(b))]);
    }
    Ok(Normals::Codes { bits: bits as u8, off: bytes_of(&off)? })
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
            let points = PointsPart {
                positions: m.positions.clone(), normals: m.normals.clone(), albedo: m.albedo.clone(), radius: 0.5, two_sided: rounded
            };
            let cloud = Payload { origin: DVec3::ONE, bounds: Aabb::EMPTY, parts: vec![Part::Points(points)] };
            prop_assert_eq!(unpack(&pack(&cloud).unwrap()).unwrap(), cloud);
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
