//! Small files of every format, what is said of bad ones, and random bytes and damage, which must never panic.

use std::io::Write;
use std::path::PathBuf;

use farfield_core::Aabb;
use farfield_core::color::byte_of_linear;
use proptest::prelude::*;

use super::*;

type Loaded = Result<(TriangleMesh, Vec<Material>, Vec<Texture>), LoadError>;

fn put(dir: &Path, name: &str, data: &[u8]) -> PathBuf {
    let path = dir.join(name);
    std::fs::write(&path, data).unwrap();
    path
}

fn merged(name: &str, data: impl AsRef<[u8]>) -> Loaded {
    let dir = tempfile::tempdir().unwrap();
    load_mesh(&put(dir.path(), name, data.as_ref()), &LoadOptions::default())
}

#[track_caller]
fn check_refused(name: &str, data: impl AsRef<[u8]>, want: &[&str]) {
    let e = merged(name, data).expect_err("is refused").to_string();
    assert!(e.contains(name), "{e}");
    want.iter().for_each(|w| assert!(e.contains(w), "{e} lacks {w}"));
}

fn area(m: &TriangleMesh) -> f32 {
    m.indices.chunks_exact(3).fold(0.0, |s, t| {
        let [a, b, c] = [0, 1, 2].map(|k| m.positions[t[k] as usize]);
        s + (b - a).cross(c - a).length() * 0.5
    })
}

const OBJ: &str = "v 0 0 0\nv 1 0 0 # a corner\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 2\n";

#[test]
fn obj_corners_in_all_four_forms_and_from_the_end() {
    for (face, uvs, normals) in [
        ("1 2 3 4", false, false),
        ("1/1 2/2 3/3 4/1", true, false),
        ("1//1 2//1 3//1 4//1", false, true),
        ("1/1/1 2/2/1 3/3/1 4/1/1", true, true),
        ("-4 -3 -2 -1", false, false),
        ("-4/-3/-1 2/2/1 3/3/1 4/1/1", true, true),
        ("1 2 \\\n 3 4", false, false),
    ] {
        let (m, ..) = merged("a.obj", format!("{OBJ}f {face}\n")).unwrap();
        assert_eq!((m.triangles(), m.positions.len(), area(&m)), (2, 4, 1.0), "{face}");
        assert_eq!((!m.uvs.is_empty(), !m.normals.is_empty()), (uvs, normals), "{face}");
        assert!(m.normals.iter().all(|n| *n == Vec3::Z));
        if !m.uvs.is_empty() {
            assert!(m.uvs.contains(&glam::Vec2::new(0.0, 1.0)), "v is flipped");
        }
    }
}

#[test]
fn obj_attributes_that_only_some_faces_have_stay_with_them() {
    let (m, ..) = merged("a.obj", format!("{OBJ}f 1 2 3\nf 1/3/1 3/3/1 4/3/1\n")).unwrap();
    assert_eq!(m.positions.len(), 6);
    assert_eq!(m.uvs[3..], [glam::Vec2::new(1.0, 0.0); 3]);
    assert!(m.normals.iter().all(|n| *n == Vec3::Z), "missing normals are made: {:?}", m.normals);
}

#[test]
fn obj_groups_materials_and_textures() {
    let dir = tempfile::tempdir().unwrap();
    let mut png = std::io::Cursor::new(vec![]);
    image::RgbaImage::from_pixel(2, 1, image::Rgba([9, 8, 7, 255]))
        .write_to(&mut png, image::ImageFormat::Png)
        .unwrap();
    put(dir.path(), "wood plank.png", &png.into_inner());
    put(
        dir.path(),
        "my lib.mtl",
        b"newmtl a\nKd 0.5 0.5 0.5\nnewmtl b\nKd 0.2 0 0\nmap_Kd -s 1 1 1 wood plank.png\n\
        newmtl c\nKd 1 1 1\nmap_Kd gone.png\n",
    );
    let text = format!(
        "mtllib my lib.mtl\n{OBJ}o one\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\no two\nusemtl c\nf 1 2 4\nusemtl d\nf 2 3 4\no none\n"
    );
    let mut packed = flate2::write::GzEncoder::new(vec![], flate2::Compression::fast());
    packed.write_all(text.as_bytes()).unwrap();
    let path = put(dir.path(), "a.obj.gz", &packed.finish().unwrap());
    let got = load(&path, &LoadOptions { two_sided: Some(false), ..Default::default() }).unwrap();
    assert_eq!((got.counts.meshes, got.counts.parts, got.counts.placed_parts, got.counts.triangles), (2, 4, 4, 4));
    let m = &got.builder.materials;
    assert_eq!(m.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["a", "b", "c", "d"]);
    assert_eq!(byte_of_linear(m[0].base_color[0]), 128, "Kd is sRGB");
    assert_eq!((m[1].base_color, m[1].texture.is_some()), ([1.0; 4], true));
    assert_eq!((m[2].base_color, m[2].texture.is_some()), ([1.0; 4], false));
    assert!(m.iter().all(|m| !m.two_sided));
    assert_eq!(got.builder.textures[0].rgba, [[9, 8, 7, 255]; 2]);
    assert!(
        got.warnings.iter().any(|w| w.contains("my lib.mtl: line 8: texture") && w.contains("gone.png")),
        "{:?}",
        got.warnings
    );
    assert!(got.warnings.iter().any(|w| w.contains("no material \"d\"")), "{:?}", got.warnings);
    let scene = got.builder.build().unwrap();
    assert_eq!(scene.meshes.iter().map(|m| m.name.as_str()).collect::<Vec<_>>(), ["one", "two"]);
}

#[test]
fn obj_errors_name_the_line() {
    check_refused("a.obj", format!("{OBJ}f 1 2 5\n"), &["line 9: ", "vertex 5; 4 are defined"]);
    check_refused("a.obj", format!("{OBJ}f 0 1 2\n"), &["line 9: ", "vertex 0"]);
    check_refused("a.obj", format!("{OBJ}f 1 2 -9223372036854775808\n"), &["line 9: "]);
    check_refused("a.obj", format!("{OBJ}f 1/9 2/1 3/1\n"), &["line 9: ", "texture coordinate 9; 3"]);
    check_refused("a.obj", format!("{OBJ}f 1//2 2//1 3//1\n"), &["line 9: ", "normal 2; 1"]);
    check_refused("a.obj", format!("{OBJ}f 1 2\n"), &["line 9: a face of 2 corners"]);
    check_refused("a.obj", format!("{OBJ}f /1 /2 /3\n"), &["line 9: ", "names no vertex"]);
    check_refused("a.obj", "v 1 2\n", &["line 1: a vertex of 2 numbers"]);
    check_refused("a.obj", "v 1 2 x\n", &["line 1: \"x\" is not a number"]);
    check_refused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 nan 0\nf 1 2 3\n", &["line 4: ", "not finite"]);
    check_refused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1e999 0\nf 1 2 3\n", &["line 4: ", "not finite"]);
    check_refused("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1e20 0\nf 1 2 3\n", &["too large"]);
    check_refused("a.obj", "v 0 0 0\nv 1e-30 0 0\nv 0 1e-30 0\nf 1 2 3\n", &["too small"]);
    check_refused("a.obj", "v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\nf 1 1 2\n", &["all 2 triangles have no area"]);
    check_refused("a.obj", "", &["holds no triangles"]);
}

#[test]
fn unused_vertices_may_be_anything() {
    let (m, ..) = merged("a.obj", format!("v nan inf 1e300\n{OBJ}f 2 3 4\n")).unwrap();
    assert_eq!(m.positions.len(), 3);
}

#[test]
fn far_coordinates_keep_their_digits() {
    // A millimetre grid at UTM coordinates: 32-bit floats would round all of it to half metres.
    let text = "v 5000000 400000.001 0\nv 5000000.002 400000.001 0\nv 5000000 400000.003 0\nf 1 2 3\n";
    let dir = tempfile::tempdir().unwrap();
    let scene =
        load(&put(dir.path(), "a.obj", text.as_bytes()), &LoadOptions::default()).unwrap().builder.build().unwrap();
    let size = scene.bounds.size();
    assert!((size - Vec3::new(0.002, 0.002, 0.0)).abs().max_element() < 1e-8, "{size}");
}

#[test]
fn up_and_scale_turn_z_into_y() {
    let text = "v 0 0 0\nv 1 0 0\nv 0 0 3\nv 0 2 0\nf 1 2 3\nf 1 2 4\n";
    let dir = tempfile::tempdir().unwrap();
    let path = put(dir.path(), "a.obj", text.as_bytes());
    let options = LoadOptions { up: Up::Z, scale: 0.5, two_sided: None };
    let (m, ..) = load_mesh(&path, &options).unwrap();
    let b = Aabb::of(m.positions.iter().copied());
    assert_eq!((b.min, b.max), (Vec3::new(0.0, 0.0, -1.0), Vec3::new(0.5, 1.5, 0.0)));
    let scene = load(&path, &options).unwrap().builder.build().unwrap();
    assert!((scene.bounds.size() - Vec3::new(0.5, 1.5, 1.0)).abs().max_element() < 1e-6);
    let e = load(&path, &LoadOptions { scale: 0.0, ..options }).err().unwrap().to_string();
    assert!(e.contains("a.obj: option scale: 0"), "{e}");
}

const PLY: &str = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
    property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 1\nproperty list uchar int vertex_indices\n\
    end_header\n0 0 0 1 2 3\n1 0 0 1 2 3\n1 1 0 1 2 3\n0 1 0 255 0 9\n4 0 1 2 3\n";

fn ply_binary(big: bool) -> Vec<u8> {
    let order = if big { "big" } else { "little" };
    let f = |v: f32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let i = |v: i32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
    let mut out = format!(
        "ply\r\nformat binary_{order}_endian 1.0\r\nelement vertex 4\r\nproperty float x\r\nproperty float y\r\n\
        property float z\r\nelement extra 2\r\nproperty list uchar float q\r\nelement tristrips 1\r\n\
        property list int int vertex_indices\r\nend_header\r\n"
    )
    .into_bytes();
    for v in [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0]] {
        out.extend(v.map(f).concat());
    }
    out.extend([1]);
    out.extend(f(7.0));
    out.extend([0]);
    out.extend([9, 0, 1, 2, 3, -1, 3, 2, 1, -1].map(i).concat());
    out
}

#[test]
fn ply_in_three_encodings() {
    let (m, materials, _) = merged("a.ply", PLY).unwrap();
    assert_eq!((m.triangles(), area(&m)), (2, 1.0));
    assert_eq!(m.colors[3], [255, 0, 9, 255]);
    assert_eq!(materials[0].base_color, [1.0; 4]);
    for big in [false, true] {
        let (m, ..) = merged("a.ply", ply_binary(big)).unwrap();
        // Strip 0 1 2 3 and, after the restart, 3 2 1.
        let normals: Vec<f32> = m
            .indices
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] = [0, 1, 2].map(|k| m.positions[t[k] as usize]);
                (b - a).cross(c - a).z
            })
            .collect();
        assert_eq!(normals, [1.0; 3], "strips alternate");
    }
}

#[test]
fn ply_errors_name_the_place() {
    let swap = |a: &str, b: &str| PLY.replace(a, b);
    check_refused("a.ply", "", &["header: the file is empty"]);
    check_refused("a.ply", "plx\n", &["line 1: "]);
    check_refused("a.ply", swap("vertex 4", "vertex 99999999999"), &["header, element vertex", "claims 99999999999"]);
    check_refused("a.ply", swap("vertex 4", "vertex 18446744073709551615"), &["header, element vertex"]);
    check_refused("a.ply", swap("face 1", "face 2"), &["face 1: the file ends; 2 were announced"]);
    check_refused("a.ply", swap("4 0 1 2 3", "4 0 1 2 7"), &["face 0: names vertex 7; 4 are listed"]);
    check_refused("a.ply", swap("4 0 1 2 3", "4 0 1 2 -1"), &["face 0: names vertex -1"]);
    check_refused("a.ply", swap("4 0 1 2 3", "2 0 1"), &["face 0: a face of 2 corners"]);
    check_refused("a.ply", swap("1 1 0 1 2 3", "1 one 0 1 2 3"), &["line 15 (vertex 2)"]);
    check_refused("a.ply", swap("property float z\n", ""), &["element vertex: has no properties x, y and z"]);
    let whole = ply_binary(false);
    check_refused("a.ply", &whole[..whole.len() - 3], &["tristrips 0 (byte "]);
    let mut lying = whole.clone();
    let at = lying.len() - 40;
    lying[at..at + 4].copy_from_slice(&i32::MAX.to_le_bytes());
    check_refused("a.ply", lying, &["tristrips 0 (byte "]);
}

#[test]
fn stl_ascii_with_two_solids_and_binary() {
    let facet = |z: i32| {
        format!("facet normal 0 0 1\nouter loop\nvertex 0 0 {z}\nvertex 1 0 {z}\nvertex 0 1 {z}\nendloop\nendfacet\n")
    };
    let text = format!("solid a b\n{}endsolid\nsolid\n{}endsolid\n", facet(0), facet(1));
    assert_eq!(merged("a.stl", &text).unwrap().0.triangles(), 2);
    check_refused("a.stl", text.replace("vertex 1 0 1", "vertex 1 0"), &["line 14: \"vertex 1 0\""]);
    check_refused("a.stl", text.replace("vertex 1 0 1\n", ""), &["line 16: a facet of 2 corners"]);
    check_refused("a.stl", &text[..text.len() - 10], &["the end of the file"]);
    check_refused("a.stl", "solid x\nhello\n", &["line 2: \"hello\""]);
    check_refused("a.stl", [0; 20], &["header: 20 bytes"]);
    let mut binary = vec![b's'; 80];
    binary[..5].copy_from_slice(b"solid");
    binary.extend(2u32.to_le_bytes());
    for z in [0.0f32, 1.0] {
        let v = [0.0, 0.0, 1.0, 0.0, 0.0, z, 1.0, 0.0, z, 0.0, 1.0, z];
        binary.extend(v.map(f32::to_le_bytes).concat());
        binary.extend([0, 0]);
    }
    let (m, ..) = merged("a.stl", &binary).unwrap();
    assert_eq!((m.triangles(), m.positions.len()), (2, 6));
    binary[..5].copy_from_slice(b"xxxxx");
    binary[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
    check_refused("a.stl", binary, &["header: claims 4294967295 facets"]);
}

/// A triangle strip of quantised positions, a fan, a sparse accessor, a data URI and nested nodes, one of them mirrored.
fn gltf() -> String {
    let mut data: Vec<u8> = vec![];
    // 0: positions, normalised 16-bit integers with 8 bytes a vertex.
    for v in [[0, 0], [32767, 0], [0, 32767], [32767, 32767]] {
        data.extend([v[0], v[1], 0, 0i16].map(i16::to_le_bytes).concat());
    }
    // 32: sparse index 2 (u8, padded), and its value.
    data.extend([2, 0, 0, 0]);
    data.extend([3.0f32, 4.0, 0.0].map(f32::to_le_bytes).concat());
    // 48: colours, linear floats.
    for c in [[0.0f32, 0.214_041_14, 1.0]; 4] {
        data.extend(c.map(f32::to_le_bytes).concat());
    }
    let text = base64::Engine::encode(&base64::prelude::BASE64_STANDARD, &data);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"extensionsRequired":["KHR_mesh_quantization"],"scene":0,
        "scenes":[{{"nodes":[0]}}],
        "nodes":[{{"children":[1,2],"translation":[10,0,0]}},{{"mesh":0,"scale":[-2,2,2]}},{{"mesh":1}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[0.5,0.25,0,1]}},"doubleSided":true}}],
        "meshes":[{{"name":"strip","primitives":[{{"attributes":{{"POSITION":0,"COLOR_0":2}},"mode":5,"material":0}}]}},
                  {{"name":"fan","primitives":[{{"attributes":{{"POSITION":1}},"mode":6}}]}}],
        "buffers":[{{"byteLength":{n},"uri":"data:application/octet-stream;base64,{text}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":32,"byteStride":8}},{{"buffer":0,"byteOffset":32,"byteLength":4}},
                       {{"buffer":0,"byteOffset":36,"byteLength":12}},{{"buffer":0,"byteOffset":48,"byteLength":48}}],
        "accessors":[{{"bufferView":0,"componentType":5122,"normalized":true,"type":"VEC3","count":4,"min":[0,0,0],"max":[1,1,0]}},
          {{"bufferView":0,"componentType":5122,"normalized":true,"type":"VEC3","count":4,"min":[0,0,0],"max":[1,1,0]}},
          {{"bufferView":3,"componentType":5126,"type":"VEC3","count":4}}]}}"#,
        n = data.len()
    )
}

#[test]
fn gltf_strips_fans_quantised_positions_and_nodes() {
    let (m, materials, _) = merged("a.gltf", gltf()).unwrap();
    // Strip: 2 triangles of a unit square, twice as large; fan of 0 1 2 3: 2 triangles, area 0.5 + 0.5.
    assert_eq!(m.triangles(), 4);
    assert!((area(&m) - (4.0 + 1.0)).abs() < 1e-5, "{}", area(&m));
    let b = Aabb::of(m.positions.iter().copied());
    assert_eq!((b.min, b.max), (Vec3::new(8.0, 0.0, 0.0), Vec3::new(11.0, 2.0, 0.0)));
    assert_eq!(m.colors[0], [0, 128, 255, 255]);
    assert_eq!((materials[0].base_color, materials[0].two_sided), ([0.5, 0.25, 0.0, 1.0], true));
    let strip: Vec<f32> = m.indices[..6]
        .chunks_exact(3)
        .map(|t| {
            let [a, b, c] = [0, 1, 2].map(|k| m.positions[t[k] as usize]);
            (b - a).cross(c - a).z
        })
        .collect();
    assert!(strip.iter().all(|z| *z > 0.0), "mirrored triangles are turned back: {strip:?}");
}

#[test]
fn gltf_attributes_of_an_application_are_skipped() {
    let text = gltf().replace(r#"{"POSITION":1}"#, r#"{"POSITION":1,"_WEIGHT":1}"#);
    assert_eq!(merged("a.gltf", text).unwrap().0.triangles(), 4);
}

#[test]
fn gltf_sparse_accessors_replace_values() {
    let text = gltf().replace(
        r#"{"bufferView":3,"componentType":5126,"type":"VEC3","count":4}"#,
        r#"{"bufferView":3,"componentType":5126,"type":"VEC3","count":4},
           {"componentType":5126,"type":"VEC3","count":4,"min":[0,0,0],"max":[3,4,0],
            "sparse":{"count":1,"indices":{"bufferView":1,"componentType":5121},"values":{"bufferView":2}}}"#,
    );
    let far = text.replace(r#"{"POSITION":1}"#, r#"{"POSITION":3}"#);
    let (m, ..) = merged("a.gltf", far).unwrap();
    assert_eq!(m.triangles(), 2, "the fan has no area now: its corners are 0 but one");
    let sparse = text
        .replace(r#""count":1,"indices""#, r#""count":9,"indices""#)
        .replace(r#"{"POSITION":1}"#, r#"{"POSITION":3}"#);
    check_refused("a.gltf", sparse, &["accessor 3: claims more items"]);
}

#[test]
fn gltf_errors_name_the_place() {
    let swap = |a: &str, b: &str| {
        assert!(gltf().contains(a), "{a}");
        gltf().replace(a, b)
    };
    check_refused("a.gltf", "{", &["line 1, column 1"]);
    check_refused(
        "a.gltf",
        swap("KHR_mesh_quantization", "KHR_draco_mesh_compression"),
        &["extensionsRequired", "draco", "supported are"],
    );
    check_refused("a.gltf", swap(r#""mesh":1"#, r#""mesh":5"#), &["nodes[2].mesh"]);
    check_refused(
        "a.gltf",
        swap(r#"{"POSITION":1}"#, r#"{"POSITION":7}"#),
        &["meshes[1].primitives[0]: an attribute names accessor 7 of 3"],
    );
    check_refused("a.gltf", swap("[1,2]", "[1,0]"), &["nodes[0]: is reached twice"]);
    check_refused(
        "a.gltf",
        swap(r#""type":"VEC3","count":4}]"#, r#""type":"VEC3","count":400000000}]"#),
        &["bufferView 3: 400000000 items"],
    );
    check_refused("a.gltf", swap(r#""byteOffset":48"#, r#""byteOffset":49"#), &["bufferView 3: 48 bytes at 49"]);
    check_refused(
        "a.gltf",
        swap(r#""byteLength":96"#, r#""byteLength":97"#),
        &["buffer 0: has 96 bytes, 97 were announced"],
    );
    check_refused(
        "a.gltf",
        swap("data:application/octet-stream;base64,", "no%20such.bin?"),
        &["buffer 0: ", "no such.bin"],
    );
    check_refused("a.gltf", swap(r#""translation":[10,0,0]"#, r#""translation":[1e39,0,0]"#), &["a.gltf"]);
    check_refused("a.glb", b"glTF\x02\0\0\0\xff\0\0\0", &["GLB header: announces 255 bytes"]);
    check_refused("a.glb", b"glTF\x01\0\0\0\x0c\0\0\0", &["GLB header: version 1"]);
    check_refused("a.glb", b"glTF\x02\0\0\0\x0c\0\0\0", &["has no JSON chunk"]);
}

#[test]
fn what_is_not_a_model_is_refused() {
    check_refused("a.off", "OFF\n353535235358 6 0\n", &["format .off: cannot be loaded", FORMATS]);
    check_refused("model", "", &["a name without extension"]);
    let e = load(Path::new("/nowhere/a.obj"), &LoadOptions::default()).err().unwrap().to_string();
    assert!(e.contains("/nowhere/a.obj: cannot be read"), "{e}");
}

fn read_any(kind: usize, data: &[u8]) {
    let path = Path::new("/nowhere/fuzz");
    let readers = [obj::read, ply::read, stl::read, gltf::read];
    if let Ok(model) = readers[kind](path, data) {
        drop(model.check(path));
    }
}

fn seeds() -> Vec<(usize, Vec<u8>)> {
    let mut glb = gltf().into_bytes();
    glb.resize(glb.len().next_multiple_of(4), b' ');
    let mut whole = b"glTF\x02\0\0\0".to_vec();
    whole.extend((20 + glb.len() as u32).to_le_bytes());
    whole.extend((glb.len() as u32).to_le_bytes());
    whole.extend(b"JSON");
    whole.extend(glb);
    let mut stl = vec![0; 80];
    stl.extend(1u32.to_le_bytes());
    stl.extend([0.5f32; 12].map(f32::to_le_bytes).concat());
    stl.extend([0, 0]);
    vec![
        (0, format!("mtllib x.mtl\n{OBJ}o a\nusemtl b\nf 1/1/1 2/2/1 3/3/1 -1/1/1\nf 1 2 3\n").into_bytes()),
        (1, PLY.into()),
        (1, ply_binary(false)),
        (1, ply_binary(true)),
        (2, stl),
        (2, b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\nendsolid\n".to_vec()),
        (3, gltf().into()),
        (3, whole),
    ]
}

/// What damage is made of: digits, signs and words that the formats know, beside any byte.
const WORDS: [&str; 12] =
    ["-1", "0", "4294967295", "99999999999999999999", "1e39", "nan", "inf", "\n", "/", "null", "\"\"", "[]"];

proptest! {
    #![proptest_config(ProptestConfig { cases: 8192, ..Default::default() })]

    #[test]
    fn random_bytes_never_panic(kind in 0usize..4, data in prop::collection::vec(any::<u8>(), 0..400), seed in 0usize..8, keep in 0usize..80) {
        read_any(kind, &data);
        // The same behind a beginning that gets past the magic numbers.
        let (kind, start) = seeds().swap_remove(seed);
        read_any(kind, &[&start[..keep.min(start.len())], &data].concat());
    }

    #[test]
    fn damaged_files_never_panic(
        seed in 0usize..8,
        hits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0usize..16), 1..8),
        cut in any::<prop::sample::Index>(), cuts in any::<bool>(),
    ) {
        let (kind, mut data) = seeds().swap_remove(seed);
        for (at, byte, how) in hits {
            let i = at.index(data.len());
            match WORDS.get(how) {
                Some(word) => { data.splice(i..i + 1, word.bytes()); }
                None => data[i] = byte,
            }
        }
        if cuts {
            data.truncate(cut.index(data.len()));
        }
        read_any(kind, &data);
    }
}

#[test]
fn shared_accessors_cannot_fill_the_memory() {
    // 2,000 primitives of the same 30,000 indices: 60 million triangles' corners out of a file of 200 kB.
    let indices: Vec<u8> = (0..30_000u32).flat_map(|i| ((i % 3) as u16).to_le_bytes()).collect();
    let mut data: Vec<u8> = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_le_bytes).concat();
    data.extend(&indices);
    let text = base64::Engine::encode(&base64::prelude::BASE64_STANDARD, &data);
    let primitives = vec![r#"{"attributes":{"POSITION":0},"indices":1}"#; 2_000].join(",");
    let json = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],"meshes":[{{"primitives":[{primitives}]}}],
        "buffers":[{{"byteLength":{},"uri":"data:x;base64,{text}"}}],
        "bufferViews":[{{"buffer":0,"byteLength":36}},{{"buffer":0,"byteOffset":36,"byteLength":{}}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"type":"VEC3","count":3,"min":[0,0,0],"max":[1,1,0]}},
                     {{"bufferView":1,"componentType":5123,"type":"SCALAR","count":30000}}]}}"#,
        data.len(),
        indices.len()
    );
    check_refused("a.gltf", json, &["meshes[0].primitives[34]", "share their indices too often"]);
}

#[test]
fn devices_are_not_read() {
    let dir = tempfile::tempdir().unwrap();
    let path = put(dir.path(), "a.obj", format!("mtllib /dev/zero\n{OBJ}f 1 2 3\n").as_bytes());
    let warnings = load(&path, &LoadOptions::default()).unwrap().warnings;
    assert!(warnings.iter().any(|w| w.contains("/dev/zero")), "{warnings:?}");
}

#[test]
fn a_folder_is_its_model_files_in_one_frame() {
    let dir = tempfile::tempdir().unwrap();
    let refused = load(dir.path(), &LoadOptions::default()).err().unwrap().to_string();
    assert!(refused.contains("holds no model file"), "{refused}");
    put(dir.path(), "b.obj", format!("mtllib b.mtl\n{OBJ}usemtl red\nf 1 2 3\n").as_bytes());
    put(dir.path(), "b.mtl", b"newmtl red\nKd 1 0 0\n");
    put(dir.path(), "a.obj", format!("{OBJ}f 1 2 3 4\n").as_bytes());
    put(dir.path(), "notes.txt", b"no model");
    let all = load(dir.path(), &LoadOptions::default()).unwrap();
    assert_eq!((all.counts.meshes, all.counts.triangles), (2, 3));
    let scene = all.builder.build().unwrap();
    let colors: Vec<[f32; 4]> = scene
        .chunks
        .iter()
        .enumerate()
        .map(|(i, _)| scene.materials[scene.material_of(farfield_core::id::ChunkId(i as u32)).index()].base_color)
        .collect();
    assert_eq!(scene.triangles(), 3);
    assert_eq!(colors[1], [1.0, 0.0, 0.0, 1.0], "b's material is its own: {colors:?}");
    // One bad file refuses the folder, by its name.
    put(dir.path(), "c.obj", b"v 0 0 0\nf 1 2 3\n");
    let refused = load(dir.path(), &LoadOptions::default()).err().unwrap().to_string();
    assert!(refused.contains("c.obj"), "{refused}");
}
