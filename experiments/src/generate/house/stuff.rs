//! What things are made of: materials with textures in metres, and meshes of several of them.
//!
//! Texture coordinates are laid on as a box lays them: each triangle takes the two axes that its plane is nearest to, in metres over the
//! texture's width; vertices whose triangles disagree are doubled. Pictures and the backs of books take a rectangle of the
//! atlas instead, seen along -z. O(triangles).

use farfield_core::id::{MaterialId, TextureId};
use farfield_core::mesh::TriangleMesh;
use farfield_core::scene::{Material, Texture};
use glam::{DAffine3, Vec2, Vec3};

use super::textures;
use crate::generate::noise::fbm;
use crate::generate::solid::Solid;

/// A material; all but paint have a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stuff {
    /// The backs of books and pictures on walls: rectangles of one texture.
    Atlas,
    /// Outside walls.
    Brick,
    /// Rugs, carpets, leaves: short and fuzzy.
    Carpet,
    /// Woven cloth.
    Fabric,
    /// Lawn.
    Grass,
    /// Anything smooth: metal, porcelain, lacquer.
    Paint,
    /// Floor boards.
    Planks,
    /// Walls and ceilings.
    Plaster,
    /// The roof.
    Roof,
    /// Glazed tiles.
    Tiles,
    /// Furniture; the grain runs along x and y.
    Wood,
}

impl Stuff {
    /// All, in alphabetical order; `as usize` is the material's number.
    pub(super) const ALL: [Stuff; 11] = [
        Stuff::Atlas,
        Stuff::Brick,
        Stuff::Carpet,
        Stuff::Fabric,
        Stuff::Grass,
        Stuff::Paint,
        Stuff::Planks,
        Stuff::Plaster,
        Stuff::Roof,
        Stuff::Tiles,
        Stuff::Wood,
    ];

    /// Its name.
    pub(super) fn name(self) -> &'static str {
        match self {
            Stuff::Atlas => "books and pictures",
            Stuff::Brick => "brick",
            Stuff::Carpet => "carpet",
            Stuff::Fabric => "fabric",
            Stuff::Grass => "grass",
            Stuff::Paint => "paint",
            Stuff::Planks => "planks",
            Stuff::Plaster => "plaster",
            Stuff::Roof => "roof tiles",
            Stuff::Tiles => "tiles",
            Stuff::Wood => "wood",
        }
    }

    /// Width of its texture on a surface, metres.
    fn tile(self) -> f32 {
        match self {
            Stuff::Atlas | Stuff::Paint | Stuff::Carpet | Stuff::Wood => 1.0,
            Stuff::Brick => 2.0,
            Stuff::Fabric => 0.3,
            Stuff::Grass => 2.5,
            Stuff::Planks | Stuff::Plaster => 2.4,
            Stuff::Roof => 1.6,
            Stuff::Tiles => 1.2,
        }
    }
}

/// The materials in the order of [`Stuff::ALL`], and their textures.
pub(super) fn materials(seed: u64) -> (Vec<Material>, Vec<Texture>) {
    let textured = Stuff::ALL.into_iter().filter(|s| *s != Stuff::Paint);
    let textures: Vec<Texture> = textured.map(|s| textures::texture(s, seed)).collect();
    let material = |s: Stuff| Material {
        name: s.name().into(),
        base_color: [1.0; 4],
        texture: textures.iter().position(|t| t.name == s.name()).map(|i| TextureId(i as u32)),
        two_sided: false,
    };
    (Stuff::ALL.map(material).to_vec(), textures)
}

/// A mesh in the making, at a level of detail.
pub(super) struct Model {
    mesh: TriangleMesh,
    level: u32,
}

impl Model {
    /// An empty one.
    pub(super) fn new(level: u32) -> Self {
        Self { mesh: TriangleMesh::default(), level }
    }

    /// The level, 1 or more.
    pub(super) fn level(&self) -> u32 {
        self.level
    }

    /// Chords of a hard edge's rounding; 0 on low levels.
    pub(super) fn edge(&self) -> u32 {
        self.level / 4
    }

    /// Chords of a soft thing's rounding.
    pub(super) fn soft(&self) -> u32 {
        self.level.div_ceil(2)
    }

    /// Sides of something round.
    pub(super) fn sides(&self) -> u32 {
        6 + 2 * self.level
    }

    /// Adds a part of one material.
    pub(super) fn part(&mut self, stuff: Stuff, make: impl FnOnce(&mut Solid)) {
        let mut solid = Solid::default();
        make(&mut solid);
        let tile = stuff.tile();
        let source = &solid.mesh;
        let mut known = vec![[u32::MAX; 3]; source.positions.len()];
        let first = self.mesh.indices.len() as u32;
        for t in source.indices.chunks_exact(3) {
            let [a, b, c] = [0, 1, 2].map(|k| source.positions[t[k] as usize]);
            let n = (b - a).cross(c - a).abs();
            let axis = if n.y >= n.x && n.y >= n.z {
                1
            } else if n.x > n.z {
                0
            } else {
                2
            };
            for &i in t {
                let p = source.positions[i as usize];
                let uv = match axis {
                    0 => Vec2::new(p.z, -p.y),
                    1 => Vec2::new(p.x, p.z),
                    _ => Vec2::new(p.x, -p.y),
                };
                let spot = &mut known[i as usize][axis];
                if *spot == u32::MAX {
                    *spot = self.vertex(source, i, uv / tile);
                }
                self.mesh.indices.push(*spot);
            }
        }
        self.section(stuff, first);
    }

    /// Adds a part that shows a rectangle (low and high, 0..1) of the atlas to +z, its rim at its other sides.
    pub(super) fn shown(&mut self, [low, high]: [Vec2; 2], make: impl FnOnce(&mut Solid)) {
        let mut solid = Solid::default();
        make(&mut solid);
        let source = &solid.mesh;
        let (min, max) =
            source.positions.iter().fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |b, &p| (b.0.min(p), b.1.max(p)));
        let (base, first) = (self.mesh.positions.len() as u32, self.mesh.indices.len() as u32);
        for (i, &p) in source.positions.iter().enumerate() {
            let f = (p - min) / (max - min);
            self.vertex(source, i as u32, low + (high - low) * Vec2::new(f.x, 1.0 - f.y));
        }
        self.mesh.indices.extend(source.indices.iter().map(|i| i + base));
        self.section(Stuff::Atlas, first);
    }

    fn vertex(&mut self, source: &TriangleMesh, i: u32, uv: Vec2) -> u32 {
        let i = i as usize;
        self.mesh.positions.push(source.positions[i]);
        self.mesh.normals.push(source.normals[i]);
        self.mesh.colors.push(source.colors[i]);
        self.mesh.uvs.push(uv);
        self.mesh.positions.len() as u32 - 1
    }

    fn section(&mut self, stuff: Stuff, first: u32) {
        let (last, id) = (self.mesh.indices.len() as u32, MaterialId(stuff as u32));
        match self.mesh.sections.last_mut() {
            Some(s) if s.1 == id => s.0.end = last,
            _ if last > first => self.mesh.sections.push((first..last, id)),
            _ => {}
        }
    }

    /// The mesh as it is.
    pub(super) fn bare(self) -> TriangleMesh {
        self.mesh
    }

    /// The mesh of something that stands on y = 0, with light baked into its colours: darker near the ground and where it
    /// faces down, and not quite even.
    pub(super) fn finish(mut self, seed: u32) -> TriangleMesh {
        let m = &mut self.mesh;
        for ((p, n), c) in m.positions.iter().zip(&m.normals).zip(&mut m.colors) {
            let near = (p.y / 0.6).clamp(0.0, 1.0);
            let down = 1.0 - 0.3 * (-n.y).max(0.0);
            let uneven = 1.0 + 0.06 * fbm(*p, 0.7, 2, 0.0, seed);
            tint(c, (0.74 + 0.26 * near.sqrt()) * down * uneven);
        }
        self.mesh
    }
}

/// Scales a colour.
pub(super) fn tint(c: &mut [u8; 4], by: f32) {
    c[..3].iter_mut().for_each(|x| *x = (f32::from(*x) * by).round().clamp(0.0, 255.0) as u8);
}

/// Makes a thing's mesh at a level.
pub(super) type Make = Box<dyn Fn(u32) -> TriangleMesh + Send + Sync>;

/// A thing and where it is.
pub(super) struct Thing {
    /// Its mesh's name.
    pub(super) name: String,
    /// Its mesh.
    pub(super) make: Make,
    /// Where it is placed: from its space to the house's.
    pub(super) at: Vec<DAffine3>,
}

/// A thing that stands on floors or hangs from walls, light baked in.
pub(super) fn thing(name: &str, at: Vec<DAffine3>, make: impl Fn(&mut Model) + Send + Sync + 'static) -> Thing {
    let seed = name.bytes().fold(7u32, |h, b| h.wrapping_mul(31).wrapping_add(u32::from(b)));
    let make = move |level| {
        let mut model = Model::new(level);
        make(&mut model);
        model.finish(seed)
    };
    Thing { name: name.into(), make: Box::new(make), at }
}
