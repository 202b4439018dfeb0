//! `sample`: what its files hold, and what it refuses.

use std::collections::BTreeMap;
use std::path::Path;

use exr::prelude::{FlatSamples, read_all_flat_layers_from_file};

use crate::common::{EXPERIMENT, Folder, tree};

const LAYERS: [&str; 6] = ["+x", "-x", "+y", "-y", "+z", "-z"];
const CHANNELS: [&str; 9] = ["A", "B", "G", "N.X", "N.Y", "N.Z", "R", "Z", "id"];

/// Every channel of a file by its name; ids are whole numbers.
fn channels(file: &Path) -> BTreeMap<String, Vec<f64>> {
    let back = read_all_flat_layers_from_file(file).unwrap();
    assert_eq!(back.layer_data.len(), 1);
    let values = |s: &FlatSamples| match s {
        FlatSamples::F32(v) => v.iter().map(|&v| f64::from(v)).collect(),
        FlatSamples::U32(v) => v.iter().map(|&v| f64::from(v)).collect(),
        FlatSamples::F16(_) => panic!("halves"),
    };
    back.layer_data[0].channel_data.list.iter().map(|c| (c.name.to_string(), values(&c.sample_data))).collect()
}

#[test]
fn a_sample_of_the_scene_shows_what_stands_around() {
    let f = Folder::new();
    let said = f.ok(&["sample", "experiment.toml", "--at", "0,2,0", "--face-px", "64", "--out", "a.exr"]);
    assert!(said.starts_with("a.exr: at 0,2,0,"), "{said}");
    let found = channels(&f.path("a.exr"));
    let names: Vec<String> = LAYERS.iter().flat_map(|l| CHANNELS.map(|c| format!("{l}.{c}"))).collect();
    let mut sorted = names.clone();
    sorted.sort();
    assert_eq!(found.keys().cloned().collect::<Vec<_>>(), sorted);
    let at = |name: &str, x: usize, y: usize| found[name][y * 64 + x];
    // A ball of radius 2.16 towards the eye stands 16 ahead and 16 behind; between them nothing.
    for (layer, id, toward) in [("-z", 1.0, 1.0), ("+z", 2.0, -1.0)] {
        let get = |c: &str| at(&format!("{layer}.{c}"), 32, 32);
        assert!((get("Z") - if id == 1.0 { 13.84 } else { 14.16 }).abs() < 0.1, "{layer} {}", get("Z"));
        assert_eq!((get("A"), get("id")), (1.0, id));
        assert!(get("N.Z") * toward > 0.8, "{layer}: {}", get("N.Z"));
    }
    let nothing = |i: usize| CHANNELS.map(|c| found[&format!("+y.{c}")][i]);
    for i in 0..64 * 64 {
        assert_eq!(nothing(i), [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, f64::INFINITY, 0.0]);
    }
    // Seven pairs along +x; towards -x stands none.
    assert!(found["+x.id"].iter().any(|&id| id > 2.0) && found["-x.id"].iter().all(|&id| id <= 2.0));
    // The place is one of the world: a scene that stands elsewhere is asked for there.
    let far = ["--set", "scene.offset=[-4096,0,0]", "--at", "-4096,2,0", "--face-px", "64"];
    f.ok(&[&["sample", "experiment.toml", "--out", "b.exr"], &far[..]].concat());
    assert_eq!(channels(&f.path("b.exr"))["-z.id"], found["-z.id"]);
    assert!(!f.path("store").exists(), "nothing is built");
}

/// The experiment with another far field, in cells so large that balls stand in them.
fn with(f: &Folder, far_field: &str) {
    let line = EXPERIMENT.lines().find(|l| l.contains("textured-lod-mesh")).unwrap();
    let text = EXPERIMENT.replace(line, &format!("far_field = {far_field}")).replace("edge = 12.0", "edge = 30.0");
    std::fs::write(f.path("other.toml"), text).unwrap();
}

#[test]
fn the_samples_of_a_far_field_show_only_what_is_far() {
    let fields = [
        ("{ type = \"textured-lod-mesh\" }", 1),
        ("{ type = \"layered-depth-image\", construction_images = 1, max_px = 32 }", 1),
        ("{ type = \"textured-depth-mesh\", grid = 2, face_px = 16 }", 4),
        ("{ type = \"incremental-tdm\", face_px = 16, sampling_px = 16, max_samples = 1 }", 2),
    ];
    for (field, least) in fields {
        let f = Folder::new();
        with(&f, field);
        let args = ["sample", "other.toml", "--pipeline", "hybrid", "--face-px", "24", "--out", "samples"];
        let said = f.ok(&args);
        let lines: Vec<&str> = said.lines().collect();
        let files = tree(&f.path("samples"));
        assert!(lines.len() >= least && files.len() == lines.len(), "{field}: {said}");
        let (mut seen, mut near) = (0, 0);
        for (i, line) in lines.iter().enumerate() {
            let name = format!("{i:03}.exr");
            let (place, _) = line.split_once("at ").unwrap().1.split_once(", ").unwrap();
            f.ok(&["sample", "other.toml", "--at", place, "--face-px", "24", "--out", "all.exr"]);
            let (far, all) = (channels(&f.path("samples").join(name)), channels(&f.path("all.exr")));
            for layer in LAYERS {
                let of = |c: &BTreeMap<String, Vec<f64>>, n: &str| c[&format!("{layer}.{n}")].clone();
                let (z, all_z, id, all_id) = (of(&far, "Z"), of(&all, "Z"), of(&far, "id"), of(&all, "id"));
                for p in 0..24 * 24 {
                    assert!(all_z[p] <= z[p], "{field}: what is far is part of all");
                    assert!(z[p] > all_z[p] || id[p] == all_id[p], "{field}");
                    seen += usize::from(id[p] != 0.0);
                    near += usize::from(all_z[p] < z[p]);
                }
            }
        }
        assert!(seen > 0 && near > 0, "{field}: {seen} {near}");
        // The same again, from the store; and from another where cells are built on demand: to the same bytes.
        let on_demand = ["--set", "hybrid.build=on-demand", "--store", "other"];
        for more in [&[][..], &on_demand] {
            f.ok(&[&args, more].concat());
            assert_eq!(tree(&f.path("samples")), files, "{field}: {more:?}");
        }
    }
}

#[test]
fn what_cannot_be_sampled_is_refused_and_nothing_is_written() {
    let f = Folder::new();
    for args in [
        &["--at", "0,2", "--out", "a.exr"][..],
        &["--at", "0,two,0", "--out", "a.exr"],
        &["--at", "0,inf,0", "--out", "a.exr"],
        &["--at", "0,2,0", "--out", "a.png"],
        &["--at", "0,2,0", "--out", "nowhere/a.exr"],
        &["--at", "0,2,0", "--face-px", "0", "--out", "a.exr"],
        &["--at", "0,2,0", "--pipeline", "hybrid", "--out", "a.exr"],
        &["--at", "0,2,0", "--cell", "0", "--out", "a.exr"],
        &["--out", "a.exr"],
        &["--pipeline", "nobody", "--out", "samples"],
        &["--pipeline", "hybrid", "--cell", "99999", "--out", "samples"],
        &["--pipeline", "hybrid", "--out", "spheres.obj"],
    ] {
        let (code, said) = f.fails(&[&["sample", "experiment.toml"], args].concat());
        assert_eq!(code, 2, "{args:?}: {said}");
    }
    let (code, said) = f.fails(&["sample", "experiment.toml", "--pipeline", "frustum culled", "--out", "samples"]);
    assert!(code == 2 && said.contains("takes no pictures"), "{code} {said}");
    let left: Vec<_> = std::fs::read_dir(f.0.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 2, "nothing was written: {left:?}");
}
