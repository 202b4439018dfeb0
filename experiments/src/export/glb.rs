//! GLB, glTF 2.0 section 4.4: one binary chunk, a mesh with a primitive for each section, a node for each placement.
//!
//! Vertex colours are linear in glTF: they are written as 16-bit normalised integers, which give every sRGB byte back.
//! Transforms are written with all their digits; glTF readers keep 32 bits of them.

use farfield_core::color::linear_of_byte;
use farfield_core::mesh::TriangleMesh;
use glam::DMat4;
use serde_json::{Value, json};

use super::{Export, png};

const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const UNSIGNED_INT: u32 = 5125;

#[derive(Default)]
struct Binary {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
}

impl Binary {
    fn view(&mut self, data: &[u8]) -> usize {
        // Section 3.6.2.4: accessors start at multiples of their component's size, 4 at most.
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(json!({ "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": data.len() }));
        self.bytes.extend_from_slice(data);
        self.views.len() - 1
    }

    fn accessor(&mut self, data: &[u8], component: u32, kind: &str, count: usize) -> usize {
        let view = self.view(data);
        let normalized = component == UNSIGNED_SHORT;
        self.accessors.push(json!({
            "bufferView": view, "componentType": component, "normalized": normalized, "count": count, "type": kind,
        }));
        self.accessors.len() - 1
    }
}

/// The file. `Err` where it would pass 4 GiB.
pub(super) fn bytes(scene: &Export) -> Result<Vec<u8>, String> {
    let mut bin = Binary::default();
    // glTF wants at least one primitive a mesh: meshes without triangles, and their placements, are left out.
    let mut id = vec![None; scene.meshes.len()];
    let mut meshes = vec![];
    for (i, (name, m)) in scene.meshes.iter().enumerate() {
        if !m.indices.is_empty() {
            id[i] = Some(meshes.len());
            meshes.push(mesh(name, m, !scene.materials.is_empty(), &mut bin));
        }
    }
    let nodes: Vec<Value> = scene
        .placements
        .iter()
        .filter_map(|(i, t)| {
            let matrix = DMat4::from(*t).to_cols_array();
            id[*i].map(|mesh| json!({ "name": scene.meshes[*i].0, "mesh": mesh, "matrix": matrix }))
        })
        .collect();
    let materials: Vec<Value> = scene
        .materials
        .iter()
        .map(|m| {
            let mut pbr = json!({ "baseColorFactor": m.base_color, "metallicFactor": 0 });
            if let Some(t) = m.texture {
                pbr["baseColorTexture"] = json!({ "index": t.0 });
            }
            json!({ "name": m.name, "pbrMetallicRoughness": pbr, "doubleSided": m.two_sided })
        })
        .collect();
    let mut images = vec![];
    for t in scene.textures {
        let view = bin.view(&png(t).map_err(|e| format!("texture \"{}\": {e}", t.name))?);
        images.push(json!({ "name": t.name, "bufferView": view, "mimeType": "image/png" }));
    }
    let textures: Vec<Value> = (0..images.len()).map(|i| json!({ "source": i })).collect();
    bin.bytes.resize(bin.bytes.len().next_multiple_of(4), 0);

    let mut root = json!({ "asset": { "version": "2.0", "generator": "farfield" }, "scene": 0 });
    root["scenes"] = json!([{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }]);
    // Section 5.17 and on: lists may be left out, but not be empty.
    for (key, list) in [
        ("nodes", nodes),
        ("meshes", meshes),
        ("materials", materials),
        ("textures", textures),
        ("images", images),
        ("accessors", bin.accessors),
        ("bufferViews", bin.views),
    ] {
        if !list.is_empty() {
            root[key] = list.into();
        }
    }
    if !bin.bytes.is_empty() {
        root["buffers"] = json!([{ "byteLength": bin.bytes.len() }]);
    }
    let mut text = root.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let total = 12 + 8 + text.len() + 8 + bin.bytes.len();
    let word = |n: usize| u32::try_from(n).map(u32::to_le_bytes).map_err(|_| "a GLB holds at most 4 GiB".to_owned());
    let mut out = Vec::with_capacity(total);
    out.extend(b"glTF");
    out.extend(2u32.to_le_bytes());
    out.extend(word(total)?);
    for (kind, chunk) in [(b"JSON", text), (b"BIN\0", bin.bytes)] {
        out.extend(word(chunk.len())?);
        out.extend(kind);
        out.extend(chunk);
    }
    Ok(out)
}

fn mesh(name: &str, m: &TriangleMesh, materials: bool, bin: &mut Binary) -> Value {
    let n = m.positions.len();
    let positions = bin.accessor(bytemuck::cast_slice(&m.positions), FLOAT, "VEC3", n);
    let b = farfield_core::Aabb::of(m.positions.iter().copied());
    bin.accessors[positions]["min"] = json!(b.min.to_array());
    bin.accessors[positions]["max"] = json!(b.max.to_array());
    let mut attributes = json!({ "POSITION": positions });
    if !m.normals.is_empty() {
        attributes["NORMAL"] = bin.accessor(bytemuck::cast_slice(&m.normals), FLOAT, "VEC3", n).into();
    }
    if !m.uvs.is_empty() {
        attributes["TEXCOORD_0"] = bin.accessor(bytemuck::cast_slice(&m.uvs), FLOAT, "VEC2", n).into();
    }
    if !m.colors.is_empty() {
        let wide = |c: u8| (linear_of_byte(c) * 65535.0).round() as u16;
        let colors: Vec<[u16; 4]> =
            m.colors.iter().map(|&[r, g, b, a]| [wide(r), wide(g), wide(b), u16::from(a) * 257]).collect();
        attributes["COLOR_0"] = bin.accessor(bytemuck::cast_slice(&colors), UNSIGNED_SHORT, "VEC4", n).into();
    }
    let primitives: Vec<Value> = m
        .sections
        .iter()
        .filter(|(r, _)| !r.is_empty())
        .map(|(r, material)| {
            let indices = &m.indices[r.start as usize..r.end as usize];
            let at = bin.accessor(bytemuck::cast_slice(indices), UNSIGNED_INT, "SCALAR", indices.len());
            let mut p = json!({ "attributes": attributes, "indices": at });
            if materials {
                p["material"] = material.0.into();
            }
            p
        })
        .collect();
    json!({ "name": name, "primitives": primitives })
}
