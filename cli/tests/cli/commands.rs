//! The command line's contract: what each command prints and writes, and with which code it ends.

use crate::common::Folder;

#[test]
fn list_is_an_array_of_everything_registered() {
    let f = Folder::new();
    let all: serde_json::Value = serde_json::from_str(&f.ok(&["list", "--json"])).unwrap();
    let all = all.as_array().unwrap();
    let find = |kind: &str, name: &str| all.iter().find(|e| e["kind"] == kind && e["name"] == name);
    for (kind, name) in [
        ("partition", "hex-cells"),
        ("partition", "single-cell"),
        ("far_field", "cluster-lod"),
        ("far_field", "geometry"),
        ("far_field", "layered-depth-image"),
        ("far_field", "textured-lod-mesh"),
        ("visibility_metric", "self-occlusion"),
        ("simplification_metric", "silhouette-weighted"),
        ("scheduler", "load-on-entry"),
        ("scheduler", "movement-priority"),
        ("scheduler", "near-to-far-lru"),
        ("backend", "cpu"),
        ("backend", "wgpu"),
        ("backend", "vulkan"),
    ] {
        assert!(find(kind, name).is_some_and(|e| e["summary"].is_string() && e["source"].is_string()), "{kind} {name}");
    }
    let edge = &find("partition", "hex-cells").unwrap()["settings"][0];
    assert_eq!((&edge["name"], &edge["unit"]), (&"edge".into(), &"scene units".into()));
    assert!(edge["type"].is_object() && edge["doc"].is_string() && edge.get("default").is_some());
    assert!(f.ok(&["list"]).contains("textured-lod-mesh"));
}

#[test]
fn check_prints_what_resolves_to_itself() {
    let f = Folder::new();
    let once = f.ok(&["check", "experiment.toml"]);
    std::fs::write(f.path("resolved.toml"), &once).unwrap();
    assert_eq!(f.ok(&["check", "resolved.toml"]), once);
    assert!(once.contains("load-on-entry") && once.contains("view_test"), "{once}");
}

#[test]
fn wrong_input_ends_with_2_at_its_line_and_writes_nothing() {
    let f = Folder::new();
    let bad = crate::common::EXPERIMENT.replace("edge = 12.0", "edg = 12.0").replace("every = 2", "every = 0");
    std::fs::write(f.path("bad.toml"), &bad).unwrap();
    let line = |what: &str| bad.lines().position(|l| l.contains(what)).unwrap() + 1;
    for command in [&["check"][..], &["plan"], &["build"], &["run"]] {
        let args: Vec<&str> = command.iter().copied().chain(["bad.toml"]).collect();
        let (code, said) = f.fails(&args);
        assert_eq!(code, 2, "{said}");
        for place in [format!("bad.toml:{}:35", line("edg =")), format!("bad.toml:{}:9", line("every"))] {
            assert!(said.contains(&place), "no {place} in {said}");
        }
        assert!(said.contains("did you mean `edge`?"), "{said}");
    }
    for args in [&["run", "nowhere.toml"][..], &["run", "experiment.toml", "--set", "scene.path=missing.obj"]] {
        assert_eq!(f.fails(args).0, 2);
    }
    std::fs::write(f.path("broken.obj"), "v 0 0 0\nf 1 2 3\n").unwrap();
    let (code, said) = f.fails(&["run", "experiment.toml", "--set", "scene.path=broken.obj"]);
    assert!(code == 2 && said.contains("broken.obj"), "{code} {said}");
    let left: Vec<_> = std::fs::read_dir(f.0.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert_eq!(left.len(), 4, "nothing was written: {left:?}");
}

#[test]
fn plan_says_what_is_built_and_what_is_left_out() {
    let f = Folder::new();
    let plan: serde_json::Value = serde_json::from_str(&f.ok(&["plan", "experiment.toml", "--json"])).unwrap();
    let hybrid = &plan["pipelines"][2];
    let needed = hybrid["cells_needed"].as_u64().unwrap();
    assert!(needed > 1 && needed < hybrid["cells_total"].as_u64().unwrap(), "{hybrid}");
    assert!(hybrid["estimated_texture_bytes"].as_u64().unwrap() > 0);
    assert!(
        hybrid["left_out"].as_array().unwrap().iter().any(|l| l["stage"] == "other cells" && l["decided"] == "plan")
    );
    assert_eq!(plan["pipelines"][0]["cells_built"], 0);
    assert!(f.ok(&["plan", "experiment.toml"]).contains("left out: other cells"));
    assert!(!f.path("store").exists());
}

#[test]
fn run_leaves_results_that_agree_with_each_other() {
    let f = Folder::new();
    let said = f.ok(&["run", "experiment.toml", "--out", "results"]);
    assert!(said.contains("hybrid") && said.contains("results/report.html"), "{said}");
    let text = std::fs::read_to_string(f.path("results/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    let [all, culled, hybrid] = [0, 1, 2].map(|i| &summary["pipelines"][i]);
    assert!(all["error"].is_null());
    assert_eq!(all["triangles"]["near"]["max"].as_f64(), summary["scene"]["triangles"].as_f64());
    // Culling changes no pixel.
    assert_eq!(culled["error"]["equal_frames"], 4);
    assert!(culled["triangles"]["total"]["mean"].as_f64() < all["triangles"]["total"]["mean"].as_f64());
    assert!(hybrid["triangles"]["far"]["max"].as_f64().unwrap() > 0.0);
    assert!(hybrid["triangles"]["total"]["mean"].as_f64() < culled["triangles"]["total"]["mean"].as_f64());
    assert!(hybrid["error"]["psnr_y_db"]["mean"].as_f64().unwrap() > 25.0, "{}", hybrid["error"]);
    assert!(hybrid["preprocess"]["cells_built"].as_u64().unwrap() > 1);
    assert!(
        hybrid["bounds"].as_array().unwrap().iter().any(|b| b["quantity"] == "hole_width_px"),
        "{}",
        hybrid["bounds"]
    );
    let rows = std::fs::read_to_string(f.path("results/frames.csv")).unwrap();
    assert_eq!(rows.lines().count(), 1 + 3 * 8);
    assert!(std::fs::read_dir(f.path("results/frames")).unwrap().count() > 2);
    assert!(std::fs::read_to_string(f.path("results/report.html")).unwrap().contains("<svg"));

    // The resolved experiment gives the same run again, from the store.
    f.ok(&["run", "results/resolved.toml", "--out", "again"]);
    let again: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(f.path("again/summary.json")).unwrap()).unwrap();
    assert_eq!(again["pipelines"][2]["preprocess"]["cells_built"], 0);
    for key in ["error", "triangles", "bounds", "left_out", "strategies"] {
        assert_eq!(again["pipelines"][2][key], hybrid[key], "{key}");
    }

    let joined = f.ok(&["compare", "results", "again"]);
    assert!(joined.contains("results: hybrid") && joined.contains("again: hybrid"), "{joined}");
    assert!(f.path("compare.html").is_file());
    assert_eq!(f.fails(&["compare", "nothing"]).0, 2);
}

#[test]
fn a_budget_makes_counted_holes_and_never_more_than_its_bytes() {
    let f = Folder::new();
    f.ok(&["run", "experiment.toml", "--out", "results", "--set", "budget.memory_bytes=300000"]);
    let text = std::fs::read_to_string(f.path("results/summary.json")).unwrap();
    let summary: serde_json::Value = serde_json::from_str(&text).unwrap();
    for i in [1, 2] {
        assert!(summary["pipelines"][i]["resident_bytes"].as_u64().unwrap() <= 300_000);
    }
    let rows = std::fs::read_to_string(f.path("results/frames.csv")).unwrap();
    let column = rows.lines().next().unwrap().split(',').position(|c| c == "missing_blocks").unwrap();
    let missing: u32 = rows.lines().skip(1).map(|l| l.split(',').nth(column).unwrap().parse::<u32>().unwrap()).sum();
    assert!(missing > 0, "{rows}");
}

#[test]
fn render_writes_pictures_and_refuses_what_is_not_there() {
    let f = Folder::new();
    f.ok(&["render", "experiment.toml", "--pipeline", "hybrid", "--frame", "3", "--out", "a.png"]);
    f.ok(&["render", "experiment.toml", "--pipeline", "hybrid", "--frame", "3", "--out", "a.exr"]);
    let picture = image::open(f.path("a.png")).unwrap().to_rgb8();
    assert_eq!(picture.dimensions(), (96, 96));
    assert!(std::fs::metadata(f.path("a.exr")).unwrap().len() > 1000);
    for args in [["nobody", "3", "b.png"], ["hybrid", "8", "b.png"], ["hybrid", "3", "b.txt"]] {
        let (code, _) =
            f.fails(&["render", "experiment.toml", "--pipeline", args[0], "--frame", args[1], "--out", args[2]]);
        assert_eq!(code, 2, "{args:?}");
    }
}

#[test]
fn a_generated_scene_can_be_loaded_again() {
    let f = Folder::new();
    f.ok(&["scene", "park", "--triangles", "100000", "--out", "park.glb"]);
    let plan = f.ok(&[
        "plan",
        "experiment.toml",
        "--json",
        "--set",
        "scene.path=park.glb",
        "--set",
        "hybrid.partition.edge=50",
    ]);
    let plan: serde_json::Value = serde_json::from_str(&plan).unwrap();
    let triangles = plan["scene_triangles"].as_f64().unwrap();
    assert!((triangles / 100_000.0 - 1.0).abs() < 0.01, "{triangles}");
    assert_eq!(f.fails(&["scene", "park", "--triangles", "5", "--out", "x.glb"]).0, 2);
    assert_eq!(f.fails(&["scene", "park", "--triangles", "100000", "--out", "x.txt"]).0, 2);

    let said = f.ok(&["scene", "pipes", "--triangles", "20000", "--seed", "2", "--out", "pipes.glb"]);
    assert!(said.contains("parts"), "{said}");
    let plan =
        f.ok(&["plan", "experiment.toml", "--json", "--set", "scene.path=pipes.glb", "--set", "view.path=still"]);
    let plan: serde_json::Value = serde_json::from_str(&plan).unwrap();
    let triangles = plan["scene_triangles"].as_f64().unwrap();
    assert!((triangles / 20_000.0 - 1.0).abs() < 0.02, "{triangles}");
    assert_eq!(f.fails(&["scene", "pipes", "--triangles", "9999", "--out", "x.glb"]).0, 2);
    assert_eq!(f.fails(&["scene", "castle", "--out", "x.glb"]).0, 2);
}

#[test]
fn the_example_park_runs() {
    let f = Folder::new();
    let park = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/park.toml");
    let small = [
        "all geometry.backend=cpu",
        "frustum culled.backend=cpu",
        "hybrid.backend=cpu",
        "scene.triangles=100000",
        "view.resolution=64",
        "view.frames=3",
        "measure.every=1",
        "measure.audit_views=4",
    ];
    let mut args = vec!["run", park, "--out", "out"];
    small.iter().for_each(|s| args.extend(["--set", s]));
    let said = f.ok(&args);
    assert!(said.contains("hybrid edge_px=4.5"), "{said}");
    assert!(f.path("out/report.html").is_file());
}

#[test]
fn a_house_keeps_its_textures_in_a_file_and_the_examples_walk_their_routes() {
    let f = Folder::new();
    let said = f.ok(&["scene", "house", "--triangles", "60000", "--out", "house.glb"]);
    assert!(said.contains("objects"), "{said}");
    assert!(std::fs::metadata(f.path("house.glb")).unwrap().len() > 3_000_000, "textures are in it");
    assert_eq!(f.fails(&["scene", "plant", "--triangles", "99999", "--out", "x.glb"]).0, 2);
    for name in ["house", "plant"] {
        let example = format!("{}/../examples/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let small = [
            "all geometry.backend=cpu",
            "levels of detail.backend=cpu",
            "levels of detail.far_field.max_px=8.0",
            "plain depth meshes.backend=cpu",
            "plain depth meshes.far_field.face_px=32",
            "incremental depth meshes.backend=cpu",
            "incremental depth meshes.far_field.face_px=32",
            "incremental depth meshes.far_field.sampling_px=16",
            "scene.triangles=100000",
            "view.resolution=64",
            "view.frames=3",
            "measure.every=1",
            "measure.audit_views=4",
        ];
        let mut args = vec!["run", &example, "--out", name];
        small.iter().for_each(|s| args.extend(["--set", s]));
        let said = f.ok(&args);
        assert!(said.contains("incremental depth meshes"), "{said}");
        assert!(f.path(&format!("{name}/report.html")).is_file());
    }
}

#[test]
fn the_example_pipes_run() {
    let f = Folder::new();
    let pipes = concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/pipes.toml");
    let small = [
        "all geometry.backend=cpu",
        "frustum culled.backend=cpu",
        "scene.triangles=50000",
        "view.resolution=64",
        "view.frames=3",
        "measure.every=1",
        "measure.audit_views=4",
    ];
    let mut args = vec!["run", pipes, "--out", "out"];
    small.iter().for_each(|s| args.extend(["--set", s]));
    let said = f.ok(&args);
    assert!(said.contains("frustum culled"), "{said}");
    assert!(f.path("out/report.html").is_file());
}

#[test]
fn calibrate_tells_what_small_primitives_cost_on_a_backend() {
    let f = Folder::new();
    let said = f.ok(&["calibrate", "--backend", "cpu"]);
    let line: Vec<&str> = said.lines().nth(1).unwrap().split_whitespace().collect();
    let costs: Vec<f64> = line[line.len() - 3..].iter().map(|n| n.parse().unwrap()).collect();
    assert!(said.lines().count() == 2 && line[0] == "cpu" && costs.iter().all(|c| *c > 0.0), "{said}");
    assert_eq!(f.fails(&["calibrate", "--backend", "gl"]).0, 2);
}
