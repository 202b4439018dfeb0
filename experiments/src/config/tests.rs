use super::*;

const GOOD: &str = r#"
[scene]
source = "park"
triangles = 200_000

[view]
resolution = 128
frames = 3

[reference]
pipeline = "all geometry"

[[pipeline]]
name = "all geometry"
far_field = { type = "geometry", frustum_culling = false }

[[pipeline]]
name = "hybrid"
backend = "cpu"
partition = { type = "hex-cells", edge = 50 }
far_field = { type = "textured-lod-mesh", edge_px = 4.5 }

[sweep]
"hybrid.far_field.edge_px" = [3, 4.5]
"#;

fn read(text: &str, sets: &[&str]) -> Result<Experiment, Mistakes> {
    let sets: Vec<String> = sets.iter().map(|s| (*s).to_owned()).collect();
    parse("park.toml", text, &sets, Path::new("/nowhere"), &crate::list::entries())
}

/// Every mistake as `line:column message`.
fn told(text: &str, sets: &[&str]) -> Vec<String> {
    read(text, sets).map(|_| ()).unwrap_err().all.iter().map(ToString::to_string).collect()
}

#[test]
fn sweeps_make_pipelines_and_defaults_are_resolved() {
    let e = read(GOOD, &[]).unwrap();
    let names: Vec<&str> = e.pipelines.iter().map(|p| p.name.as_str()).collect();
    assert_eq!(names, ["all geometry", "hybrid edge_px=3", "hybrid edge_px=4.5"]);
    assert_eq!(e.view.resolution, [128, 128]);
    assert_eq!(e.reference, 0);
    let far = &e.pipelines[1].resolved["far_field"];
    assert_eq!(far["edge_px"], serde_json::json!(3.0));
    assert!(far["view_test"]["type"].is_string(), "nested defaults are written out: {far}");
    assert_eq!(e.pipelines[1].resolved["scheduler"]["type"], DEFAULT_SCHEDULER);
}

#[test]
fn what_is_resolved_is_an_experiment_that_resolves_to_itself() {
    let e = read(GOOD, &["hybrid.partition.edge=25", "view.seed = 9"]).unwrap();
    let text = to_toml(&e.resolved);
    let again = read(&text, &[]).unwrap_or_else(|m| panic!("{:?}\n{text}", m.all));
    assert_eq!(to_toml(&again.resolved), text);
    assert_eq!(again.view, e.view);
    assert_eq!(e.pipelines[2].resolved["partition"]["edge"], serde_json::json!(25.0));
}

#[test]
fn every_mistake_is_told_at_its_key() {
    let bad = r#"
[scene]
source = "park"
triangels = 5
[view]
fov_y_deg = "wide"
resolution = [64, 64.5]
pitch_deg = [10, -10]
path = "spiral"
[reference]
pipeline = "geometry"
[[pipeline]]
name = "a"
far_field = { type = "geometri" }
[[pipeline]]
name = "a"
partition = { type = "hex-cells", edge = -1.0 }
far_field = { type = "textured-lod-mesh", view_test = { type = "self-occlusion", max_pxx = 1 } }
[[pipeline]]
name = "c"
[oops]
"#;
    let all = told(bad, &[]).join("\n");
    for expected in [
        "park.toml:4:1: unknown key `triangels`",
        "park.toml:6:13: `fov_y_deg` is a number",
        "park.toml:7:14: `resolution` is two whole numbers",
        "park.toml:8:13: `pitch_deg` is a range",
        "park.toml:9:8: no path is called \"spiral\"",
        "park.toml:11:12: no pipeline is called \"geometry\"",
        "park.toml:14:22: no far_field is called the text \"geometri\"",
        "park.toml:16:8: two pipelines are called \"a\"",
        "park.toml:17:42: `edge` is a number above 0",
        "park.toml:18:82: unknown key `max_pxx`",
        "park.toml:19:1: pipeline \"c\" needs `far_field`",
        "park.toml:21:2: unknown key `oops`",
    ] {
        assert!(all.contains(expected), "no {expected:?} in\n{all}");
    }
    assert_eq!(all.lines().count(), 12, "{all}");
}

#[test]
fn a_mistake_in_the_syntax_and_in_a_set_is_told_at_its_place() {
    assert_eq!(told("[scene]\nsource = \n", &[]).len(), 1);
    assert!(told("[scene]\nsource = \n", &[])[0].starts_with("park.toml:2:"));
    let all = told(GOOD, &["view.frames=0", "hybrid.far_field.edge_px=no", "nothing=1", "view"]).join("\n");
    for expected in [
        "--set:1:13: `frames` is a whole number from 1",
        "--set:1:1: --set: no such setting",
        "--set:1:1: --set takes path=value",
    ] {
        assert!(all.contains(expected), "no {expected:?} in\n{all}");
    }
}

#[test]
fn one_mistake_in_a_swept_pipeline_is_told_once() {
    assert_eq!(told(&GOOD.replace("edge = 50", "edge = 0"), &[]).len(), 1);
    assert_eq!(told(&GOOD.replace("[3, 4.5]", "4"), &[]).len(), 1);
    assert_eq!(told(&GOOD.replace("\"hybrid.far_field.edge_px\"", "\"hybrids.far_field.edge_px\""), &[]).len(), 1);
}

#[test]
fn a_sweep_takes_dotted_keys_and_the_product_of_two() {
    let text =
        GOOD.replace("\"hybrid.far_field.edge_px\"", "hybrid.partition.edge = [40, 60]\nhybrid.far_field.edge_px");
    let names: Vec<String> = read(&text, &[]).unwrap().pipelines.into_iter().map(|p| p.name).collect();
    assert_eq!(
        names[1..],
        [
            "hybrid edge=40 edge_px=3",
            "hybrid edge=40 edge_px=4.5",
            "hybrid edge=60 edge_px=3",
            "hybrid edge=60 edge_px=4.5",
        ]
    );
}

#[test]
fn an_empty_file_says_what_is_missing() {
    let all = told("", &[]).join("\n");
    assert!(all.contains("needs a table `scene`") && all.contains("at least one [[pipeline]]"), "{all}");
}

#[test]
fn pipes_bring_their_own_size_and_eye_height() {
    let text = GOOD.replace("source = \"park\"\ntriangles = 200_000", "source = \"pipes\"");
    let e = read(&text, &[]).unwrap();
    assert_eq!(e.resolved["scene"]["triangles"], serde_json::json!(1_000_000));
    let half = crate::generate::gallery_height(1_000_000);
    assert_eq!(e.view.eye_height, Some([half as f32; 2]));
    let scaled = read(&text, &["scene.scale=2"]).unwrap();
    assert_eq!(scaled.view.eye_height, Some([2.0 * half as f32; 2]));
    let own = read(&text, &["view.eye_height=3"]).unwrap();
    assert_eq!(own.view.eye_height, Some([3.0; 2]));
    let park = read(&GOOD.replace("triangles = 200_000", ""), &[]).unwrap();
    assert_eq!((park.scene.triangles, park.view.eye_height), (Some(2_017_700), None));
    let all = told(&text.replace("\"pipes\"", "\"pipes\"\nmodels = \"/\""), &[]);
    assert_eq!(all, ["park.toml:4:10: `models` makes a park; source \"pipes\" is not made of them"]);
}

#[test]
fn a_house_and_a_plant_bring_an_eye_height_and_a_route_and_others_do_not() {
    for (kind, eye, triangles) in
        [("house", crate::generate::HOUSE_EYE, 262_879), ("plant", crate::generate::PLANT_EYE, 1_000_000)]
    {
        let text = GOOD.replace("source = \"park\"\ntriangles = 200_000", &format!("source = \"{kind}\""));
        let e = read(&text, &["view.path=route"]).unwrap();
        assert_eq!(e.resolved["scene"]["triangles"], serde_json::json!(triangles));
        assert_eq!((e.view.eye_height, e.view.path.as_str()), (Some([eye as f32; 2]), "route"));
    }
    let park = told(GOOD, &["view.path=route"]);
    assert!(park.len() == 1 && park[0].contains("the scene brings no route along"), "{park:?}");
}

#[test]
fn the_reference_is_not_built_on_demand() {
    let text = "[scene]\nsource = \"park\"\n[[pipeline]]\nname = \"a\"\nbuild = \"on-demand\"\nfar_field = { type = \"geometry\" }\n\
                [[pipeline]]\nname = \"b\"\nfar_field = { type = \"geometry\" }\n";
    assert!(told(text, &[])[0].starts_with("park.toml:5:9: the reference is built ahead"), "{:?}", told(text, &[]));
    assert!(read(&format!("{text}[reference]\npipeline = \"b\"\n"), &[]).is_ok());
}

#[test]
fn scenes_out_of_core_are_files_and_have_room_for_chunks() {
    let e = read(GOOD, &[]).unwrap();
    assert_eq!((e.scene.out_of_core, e.scene.memory_bytes), (None, 2 << 30));
    let all = told(GOOD, &["scene.out_of_core=true"]);
    assert!(all.len() == 1 && all[0].contains("a generated park is held in memory"), "{all:?}");
    let all = told(GOOD, &["scene.memory_bytes=1000"]);
    assert!(all.len() == 1 && all[0].contains("`memory_bytes` is a whole number from 16777216 (bytes)"), "{all:?}");
    let all = told(GOOD, &["scene.memory_bytes=33554432"]);
    assert!(all.len() == 1 && all[0].contains("a generated park is held in memory, whatever it takes"), "{all:?}");
}
