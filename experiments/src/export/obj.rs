//! OBJ with an MTL and PNG textures beside it: every placement is a group `g`, its vertices in world space with nine
//! significant digits (which give 32-bit floats back), colours behind the coordinates as MeshLab writes them.

use std::io::{BufWriter, Error, Result, Write};
use std::path::Path;

use farfield_core::color::srgb_of_linear;
use glam::DVec3;

use super::{Export, png};
use crate::load::merge;

pub(super) fn write(path: &Path, scene: &Export) -> Result<()> {
    let mut f = BufWriter::new(std::fs::File::create(path)?);
    if !scene.materials.is_empty() {
        let mtl = path.with_extension("mtl");
        writeln!(f, "mtllib {}", mtl.file_name().unwrap_or_default().to_string_lossy())?;
        library(&mtl, scene)?;
    }
    let (mut vertices, mut uvs, mut normals) = (0, 0, 0);
    for (number, (i, transform)) in scene.placements.iter().enumerate() {
        let (name, mesh) = &scene.meshes[*i];
        // One placement at a time: winding and normals as `merge` turns them, positions with all 64 bits.
        let m = merge(&[(mesh, *transform)]);
        writeln!(f, "g {}_{number}", word(name))?;
        for (k, p) in mesh.positions.iter().enumerate() {
            let p: DVec3 = transform.transform_point3(p.as_dvec3());
            write!(f, "v {:.8e} {:.8e} {:.8e}", p.x, p.y, p.z)?;
            match m.colors.get(k) {
                Some(&[r, g, b, _]) => {
                    let [r, g, b] = [r, g, b].map(|c| f64::from(c) / 255.0);
                    writeln!(f, " {r:.4} {g:.4} {b:.4}")?;
                }
                None => writeln!(f)?,
            }
        }
        m.uvs.iter().try_for_each(|uv| writeln!(f, "vt {} {}", uv.x, 1.0 - uv.y))?;
        m.normals.iter().try_for_each(|n| writeln!(f, "vn {} {} {}", n.x, n.y, n.z))?;
        for (range, material) in &m.sections {
            if let Some(mat) = scene.materials.get(material.index()) {
                writeln!(f, "usemtl {}_{}", word(&mat.name), material.0)?;
            }
            for t in m.indices[range.start as usize..range.end as usize].chunks_exact(3) {
                write!(f, "f")?;
                for &v in t {
                    let v = v as usize + 1;
                    match (m.uvs.is_empty(), m.normals.is_empty()) {
                        (true, true) => write!(f, " {}", vertices + v)?,
                        (false, true) => write!(f, " {}/{}", vertices + v, uvs + v)?,
                        (true, false) => write!(f, " {}//{}", vertices + v, normals + v)?,
                        (false, false) => write!(f, " {}/{}/{}", vertices + v, uvs + v, normals + v)?,
                    }
                }
                writeln!(f)?;
            }
        }
        vertices += m.positions.len();
        uvs += m.uvs.len();
        normals += m.normals.len();
    }
    f.flush()
}

fn library(path: &Path, scene: &Export) -> Result<()> {
    let mut f = BufWriter::new(std::fs::File::create(path)?);
    let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    for (i, m) in scene.materials.iter().enumerate() {
        let [r, g, b, _] = m.base_color.map(srgb_of_linear);
        writeln!(f, "newmtl {}_{i}\nKd {r} {g} {b}", word(&m.name))?;
        if let Some(t) = m.texture {
            let file = format!("{stem}_{}.png", t.0);
            writeln!(f, "map_Kd {file}")?;
            let data = png(&scene.textures[t.index()]).map_err(Error::other)?;
            std::fs::write(path.with_file_name(file), data)?;
        }
    }
    f.flush()
}

/// A name without white space.
fn word(name: &str) -> String {
    name.split_whitespace().collect::<Vec<_>>().join("_")
}
