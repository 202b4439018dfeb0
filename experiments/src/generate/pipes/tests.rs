//! What must be true of pipes.

use std::collections::BTreeSet;

use farfield_core::Aabb;
use glam::{IVec3, Vec3};

use super::parts::{LONGEST, Piece, SYSTEMS};
use super::*;

fn of(triangles: u64, seed: u64) -> PipesScene {
    pipes(&PipesSettings { triangles, seed }).unwrap()
}

/// Each part's box in the scene.
fn boxes(scene: &PipesScene) -> Vec<Aabb> {
    let own: Vec<Aabb> = scene.meshes.iter().map(|m| Aabb::of(m.1.positions.iter().copied())).collect();
    scene.placements.iter().map(|(mesh, at)| own[*mesh].transformed(at)).collect()
}

#[test]
fn totals_are_met_within_two_percent() {
    for asked in [LEAST_PIPES, 14_000, 25_000, 60_000, 150_000, 400_000, PIPES_1M, 2_500_000, 7_000_000, MOST_PIPES] {
        for seed in 1..=3 {
            let total = of(asked, seed).triangles();
            let off = total as f64 / asked as f64 - 1.0;
            assert!(off.abs() <= 0.02, "{asked} with seed {seed}: {total} is {:.2} % off", 100.0 * off);
        }
    }
}

#[test]
fn totals_out_of_range_are_refused_with_the_range() {
    let text = |triangles| pipes(&PipesSettings { triangles, seed: 1 }).unwrap_err().to_string();
    assert_eq!(text(9_999), "pipes of 9999 triangles: the total must be between 10000 and 16000000");
    assert!(text(u64::MAX).contains("16000000"));
}

#[test]
fn same_settings_same_bytes_on_any_number_of_threads() {
    let on = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| of(100_000, 4))
    };
    assert_eq!(on(1), on(4));
    assert_ne!(of(100_000, 4).placements, of(100_000, 5).placements, "the seed matters");
}

#[test]
fn parts_are_small_rigid_and_inside_the_box() {
    for (triangles, seed) in [(LEAST_PIPES, 1), (100_000, 2), (PIPES_1M, 1), (MOST_PIPES, 3)] {
        let scene = of(triangles, seed);
        let half = scene.size * DVec3::new(0.5, 0.0, 0.5);
        let all = Aabb { min: (-half).as_vec3(), max: (scene.size - half).as_vec3() };
        for ((mesh, at), b) in scene.placements.iter().zip(boxes(&scene)) {
            let name = &scene.meshes[*mesh].0;
            assert!(at.is_finite() && (at.matrix3.determinant() - 1.0).abs() < 1e-9, "{name} at {at}");
            assert!(all.min.cmple(b.min + 1e-4).all() && b.max.cmple(all.max + 1e-4).all(), "{name} leaves: {b:?}");
            assert!(b.size().max_element() <= 4.0 + 1e-4, "{name} is {} long", b.size());
        }
        let ratio = scene.size.y / scene.size.x;
        assert!(scene.size.x == scene.size.z && (0.9..1.2).contains(&ratio), "{}", scene.size);
    }
}

#[test]
fn a_million_triangles_are_thousands_of_placed_parts_of_few_meshes() {
    let scene = of(PIPES_1M, 1);
    assert!((5_000..20_000).contains(&scene.placements.len()), "{} parts", scene.placements.len());
    assert!(scene.meshes.len() < 120, "{} meshes", scene.meshes.len());
    let stored: usize = scene.meshes.iter().map(|m| m.1.triangles()).sum();
    assert!(stored < 50_000, "{stored} triangles are stored");
    let largest = scene.meshes.iter().max_by_key(|m| m.1.triangles()).unwrap();
    let most = farfield_core::scene::MAX_CHUNK_TRIANGLES;
    assert!(largest.1.triangles() <= most, "{} is more than a chunk", largest.0);
    let names: BTreeSet<&String> = scene.meshes.iter().map(|m| &m.0).collect();
    assert_eq!(names.len(), scene.meshes.len());
    for part in ["tube 3", "bend", "joint", "valve", "tee", "end", "reducer"] {
        let kinds = names.iter().filter(|n| n.ends_with(part)).count();
        // Reducers are rare: a system of few pipes may have none.
        let least = if part == "reducer" { SYSTEMS.len() / 2 } else { SYSTEMS.len() };
        assert!(kinds >= least, "only {kinds} kinds of {part}");
    }
}

/// Each ninth of the box's 27 holds between a third and twice its share of the triangles.
#[test]
fn triangles_fill_the_whole_box() {
    for (triangles, seed) in [(100_000, 1), (PIPES_1M, 1), (PIPES_1M, 2), (8_000_000, 1)] {
        let scene = of(triangles, seed);
        let mut parts = [0u64; 27];
        for ((mesh, _), b) in scene.placements.iter().zip(boxes(&scene)) {
            let at = (b.centre().as_dvec3() / scene.size + DVec3::new(0.5, 0.0, 0.5)) * 3.0;
            let [x, y, z] = at.to_array().map(|v| (v as usize).min(2));
            parts[9 * y + 3 * z + x] += scene.meshes[*mesh].1.triangles() as u64;
        }
        for n in parts {
            let share = 27.0 * n as f64 / triangles as f64;
            assert!((0.33..2.0).contains(&share), "{triangles}, seed {seed}: {parts:?}");
        }
    }
}

#[test]
fn meshes_face_outward() {
    let piece = |system, narrow, piece| Part::Pipe { system, narrow, piece };
    let mut parts = vec![Part::Drum, Part::Tower];
    parts.extend((1..=LONGEST).map(Part::Beam));
    for system in 0..SYSTEMS.len() as u8 {
        for narrow in [false, true] {
            parts.extend((1..=LONGEST).map(|n| piece(system, narrow, Piece::Tube(n))));
            let others = [Piece::Bend, Piece::Joint, Piece::Valve, Piece::Tee, Piece::End];
            parts.extend(others.map(|p| piece(system, narrow, p)));
        }
        parts.push(piece(system, false, Piece::Reducer));
    }
    for part in parts {
        for sides in [5, 8, 13, 30] {
            let (mesh, name) = (part.mesh(sides), part.name());
            assert!(mesh.normals.iter().all(|n| n.is_normalized()), "{name}");
            assert_eq!(mesh.colors.len(), mesh.positions.len());
            for t in mesh.indices.chunks_exact(3) {
                let [a, b, c] = [0, 1, 2].map(|k| mesh.positions[t[k] as usize]);
                let face = (b - a).cross(c - a);
                let normal: Vec3 = t.iter().map(|&v| mesh.normals[v as usize]).sum();
                // Every triangle has an area and looks where its vertices say.
                assert!(face.dot(normal) > 1e-8, "{name}, {sides} sides: {a} {b} {c}, {normal}");
            }
        }
    }
}

/// The orientation itself, not only that it agrees with the normals.
#[test]
fn beams_and_tubes_enclose_their_volume() {
    let closed = |part: Part| {
        let mesh = part.mesh(24);
        let corner = |i: u32| mesh.positions[i as usize];
        mesh.indices.chunks_exact(3).map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0).sum::<f32>()
    };
    // Three closed boxes.
    let beam = closed(Part::Beam(1));
    assert!((beam - (2.0 * 0.036 * 0.22 + 0.204 * 0.028)).abs() < 1e-5, "{beam}");
    // An open tube of radius r and length 3 gives two thirds of r^2 pi 3.
    let tube = closed(Part::Pipe { system: 0, narrow: false, piece: Piece::Tube(3) });
    let r = SYSTEMS[0].radii[0];
    assert!((tube / (2.0 * r * r * std::f32::consts::PI) - 1.0).abs() < 0.02, "{tube}");
}

/// The pipes of a lattice, before parts are made of them.
fn routed(edge: i32, seed: u64) -> (Lattice, Vec<route::Vessel>, Vec<route::Line>) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut lattice = Lattice::new(edge, &mut rng);
    let vessels = route::vessels(&mut lattice, &mut rng);
    let lines = route::lines(&mut lattice, &vessels, &mut rng);
    (lattice, vessels, lines)
}

#[test]
fn pipes_keep_apart_and_cross_galleries_upright() {
    for (edge, seed) in [(7, 1), (13, 2), (22, 3), (30, 4)] {
        let (lattice, vessels, lines) = routed(edge, seed);
        let mut taken = BTreeSet::new();
        for line in &lines {
            for (i, c) in line.cells.iter().enumerate() {
                let (into, out) = line.through(i);
                assert!(taken.insert(c.to_array()), "{c} is taken twice");
                assert!(c.cmpge(IVec3::ZERO).all() && c.cmplt(lattice.size).all(), "{c} is outside");
                assert!(into.abs().element_sum() == 1 && out.abs().element_sum() == 1, "a jump at {c}");
                assert!(
                    !lattice.gallery(*c) || into == out && into.y != 0 && lattice.riser(*c) == *c,
                    "along a gallery"
                );
            }
            assert!(line.cells.len() >= 4);
        }
        for v in &vessels {
            let inside = |c: &[i32; 3]| {
                let c = IVec3::from_array(*c);
                c.cmpge(v.low).all() && c.cmplt(v.low + v.cells).all()
            };
            assert!(!taken.iter().any(inside), "a pipe runs through a vessel");
        }
        let share = taken.len() as f64 / f64::from(lattice.size.element_product());
        assert!((0.4..0.7).contains(&share), "{share} of {edge}^3 cells hold pipe");
    }
}

#[test]
fn every_cell_of_a_pipe_has_its_part() {
    let (mut lattice, _, lines) = routed(16, 5);
    let mut rng = ChaCha8Rng::seed_from_u64(6);
    let mut turned = 0;
    for line in &lines {
        let parts = fittings::pipe(&mut lattice, line, &mut rng);
        let cells = |p: &Placed| match p.0 {
            Part::Pipe { piece: Piece::Tube(n), .. } => usize::from(n),
            _ => 1,
        };
        assert_eq!(parts.iter().map(cells).sum::<usize>(), line.cells.len());
        let is =
            |want: Piece| parts.iter().filter(|p| matches!(p.0, Part::Pipe { piece, .. } if piece == want)).count();
        assert_eq!(is(Piece::Tee), line.tees.len());
        assert_eq!(is(Piece::End), 1 + usize::from(line.from.is_none()));
        let bends = (1..line.cells.len() - 1).filter(|&i| line.through(i).0 != line.through(i).1).count();
        let first = usize::from(line.from.is_some() && line.through(0).0 != line.through(0).1);
        assert_eq!(is(Piece::Bend), bends + first);
        turned += bends;
    }
    assert!(turned > lines.len(), "pipes bend: {turned} bends in {} pipes", lines.len());
}

/// Where nothing is said, a tour flies through the middle gallery, at any size.
#[test]
fn a_tour_leads_through_the_middle_of_the_pipes() {
    let file = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../examples/pipes.toml"));
    for (triangles, seed) in [(LEAST_PIPES, 1), (100_000, 1), (PIPES_1M, 1), (PIPES_1M, 2), (4_000_000, 3)] {
        let sets = [format!("scene.triangles={triangles}"), format!("scene.seed={seed}")];
        let experiment = crate::config::load(file, &sets, &crate::list::entries()).unwrap();
        let scene = crate::scene::scene(&experiment, &crate::run::nothing_kept()).unwrap().scene;
        let views = crate::path::views(&experiment.view, &scene);
        let path = crate::path::cameras(&experiment.view, &views, &scene, None).unwrap();
        let (low, high) = (scene.bounds.min.y, scene.bounds.max.y);
        let height = (path[0].eye.y as f32 - low) / (high - low);
        assert!((height - 0.5).abs() < 0.01, "{triangles}: an eye at {height} of the height");
        assert!(path.iter().all(|c| scene.bounds.contains(c.eye.as_vec3())), "{triangles}: it leaves the box");
        assert!(path[0].eye.distance(path[path.len() / 4].eye) > 1.0, "{triangles}: it hardly moves");
    }
}
