//! Candidates against enumerations that know no triangulation, and against dense sampling of the region.

use farfield_core::Aabb;
use farfield_core::region::Region;
use glam::{DVec2, DVec3, Vec3};
use proptest::prelude::*;

use super::*;

fn rectangle() -> Vec<[f32; 2]> {
    vec![[-2.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-2.0, 1.0]]
}

fn hexagon() -> Vec<[f32; 2]> {
    (0..6).map(|k| (k as f32 * std::f32::consts::FRAC_PI_3).sin_cos()).map(|(s, c)| [2.0 * c, 2.0 * s]).collect()
}

fn ball() -> Region {
    Region::Sphere { centre: Vec3::new(0.25, 0.0, -0.125), radius: 1.5 }
}

fn polygons() -> [Vec<[f32; 2]>; 3] {
    [rectangle(), hexagon(), ball().footprint()]
}

fn double(polygon: &[[f32; 2]]) -> Vec<DVec2> {
    polygon.iter().map(|p| DVec2::new(p[0].into(), p[1].into())).collect()
}

fn holds(polygon: &[DVec2], p: DVec2, slack: f64) -> bool {
    (0..polygon.len()).all(|i| {
        let (a, b) = (polygon[i], polygon[(i + 1) % polygon.len()]);
        (b - a).normalize().perp_dot(p - a) >= -slack
    })
}

fn nearest(p: DVec2, samples: &[DVec2]) -> f64 {
    samples.iter().map(|s| s.distance(p)).fold(f64::INFINITY, f64::min)
}

/// All circumcentres with an empty circle inside, all crossings of bisectors with sides that have one, by enumeration.
fn oracle(polygon: &[DVec2], samples: &[DVec2], slack: f64) -> Vec<DVec2> {
    let mut out = vec![];
    let mut keep = |p: DVec2, r: f64, slack: f64| {
        if p.is_finite() && holds(polygon, p, slack) && nearest(p, samples) >= r - slack {
            out.push(p);
        }
    };
    for (i, &a) in samples.iter().enumerate() {
        for (j, &b) in samples.iter().enumerate().skip(i + 1) {
            for &c in &samples[j + 1..] {
                // The circumcentre in barycentric weights of squared sides.
                let (x, y, z) = (b.distance_squared(c), c.distance_squared(a), a.distance_squared(b));
                let w = [x * (y + z - x), y * (z + x - y), z * (x + y - z)];
                let p = (a * w[0] + b * w[1] + c * w[2]) / (w[0] + w[1] + w[2]);
                if (b - a).perp_dot(c - a).abs() > 1e-6 {
                    keep(p, p.distance(a), slack);
                }
            }
            for k in 0..polygon.len() {
                let (from, to) = (polygon[k], polygon[(k + 1) % polygon.len()]);
                // |p - a| = |p - b| by bisection: the difference of squares is linear along the side.
                let f = |t: f64| {
                    let p = from.lerp(to, t);
                    p.distance_squared(a) - p.distance_squared(b)
                };
                if f(0.0) * f(1.0) < 0.0 {
                    let (mut low, mut high) = (0.0, 1.0);
                    for _ in 0..60 {
                        let t = 0.5 * (low + high);
                        if f(t) * f(0.0) > 0.0 { low = t } else { high = t }
                    }
                    let p = from.lerp(to, low);
                    keep(p, p.distance(a), slack);
                }
            }
        }
    }
    out
}

/// What must hold of candidates in a polygon, whatever the samples.
fn check(polygon: &[[f32; 2]], samples: &[DVec2]) {
    let found = planar(polygon, samples);
    let region = double(polygon);
    for must in oracle(&region, samples, 0.0) {
        let sampled = nearest(must, samples) < 1e-5;
        assert!(
            sampled || found.iter().any(|f| f.distance(must) < 1e-5),
            "{must} is missing in {found:?} of {samples:?}"
        );
    }
    let may = oracle(&region, samples, 1e-5);
    for (i, &f) in found.iter().enumerate() {
        assert!(holds(&region, f, 1e-6), "{f} outside");
        assert!(nearest(f, samples) > 0.0 && found[..i].iter().all(|g| g.distance(f) > 1e-7));
        let corner = region.iter().any(|c| c.distance(f) < 1e-6);
        assert!(corner || may.iter().any(|m| m.distance(f) < 1e-3), "{f} is no candidate of {samples:?}");
    }
    let farthest = found.iter().map(|&f| nearest(f, samples)).fold(0.0, f64::max);
    for i in 0..40 {
        for j in 0..40 {
            let p = DVec2::new(f64::from(i) / 39.0 * 4.0 - 2.0, f64::from(j) / 39.0 * 4.0 - 2.0);
            if holds(&region, p, 0.0) {
                assert!(
                    nearest(p, samples) <= farthest + 1e-5,
                    "{p} is farther than all of {found:?} from {samples:?}"
                );
            }
        }
    }
}

prop_compose! {
    fn anywhere()(x in -2.5f64..2.5, y in -2.5f64..2.5) -> DVec2 { DVec2::new(x, y) }
}
prop_compose! {
    /// On a coarse grid: collinear, cocircular, coincident, on the border.
    fn on_grid()(x in -4i32..=4, y in -4i32..=4) -> DVec2 { DVec2::new(x.into(), y.into()) / 2.0 }
}
prop_compose! {
    fn in_space()(x in -1.2f64..1.2, y in -1.2f64..1.2, z in -1.2f64..1.2) -> DVec3 { DVec3::new(x, y, z) }
}
prop_compose! {
    fn in_lattice()(x in -2i32..=2, y in -2i32..=2, z in -2i32..=2) -> DVec3 {
        DVec3::new(x.into(), y.into(), z.into()) / 2.0
    }
}

proptest! {
    #[test]
    fn the_diagram_is_that_of_an_enumeration(which in 0usize..3, samples in prop::collection::vec(anywhere(), 1..10)) {
        check(&polygons()[which], &samples);
    }

    #[test]
    fn degenerate_sets_are_no_special_case(which in 0usize..3, samples in prop::collection::vec(on_grid(), 1..12)) {
        check(&polygons()[which], &samples);
    }

    #[test]
    fn neither_scale_nor_place_nor_order_matter(
        samples in prop::collection::vec(on_grid(), 1..9), exponent in -10i32..=20, away in -1_000_000i32..1_000_000
    ) {
        // Powers of two, and whole numbers that 32 bits hold: so that ties stay ties. (1e-3 to 1e6.)
        let (k, shift) = (2f64.powi(exponent), if (0..3).contains(&exponent) { f64::from(away) } else { 0.0 });
        let moved: Vec<DVec2> = samples.iter().rev().map(|&s| s * k + shift).collect();
        let corners: Vec<[f32; 2]> = rectangle().iter().map(|c| c.map(|x| (f64::from(x) * k + shift) as f32)).collect();
        let (a, b) = (planar(&rectangle(), &samples), planar(&corners, &moved));
        prop_assert_eq!(a.len(), b.len(), "{:?} {:?}", a, b);
        for p in a {
            prop_assert!(b.iter().any(|q| ((*q - shift) / k).distance(p) < 1e-5));
        }
    }

    #[test]
    fn no_point_of_a_solid_is_farther_than_the_farthest_candidate(
        which in 0usize..3, samples in prop::collection::vec(in_space(), 1..9)
    ) {
        check_solid(which, &samples);
    }

    #[test]
    fn nor_with_lattices_of_samples(which in 0usize..3, samples in prop::collection::vec(in_lattice(), 1..9)) {
        check_solid(which, &samples);
    }
}

fn check_solid(which: usize, samples: &[DVec3]) {
    let region = [
        Region::Box(Aabb { min: Vec3::splat(-1.0), max: Vec3::splat(1.0) }),
        Region::Prism { polygon: hexagon(), y: [-0.5, 0.75] },
        Region::Prism { polygon: rectangle(), y: [0.5, 0.5] },
    ][which]
        .clone();
    let found = solid(&half_spaces(&region), samples);
    let near = |p: DVec3| samples.iter().map(|s| s.distance(p)).fold(f64::INFINITY, f64::min);
    for f in &found {
        let off = region.distance(&Aabb::of([f.as_vec3()]));
        assert!(off < 1e-5 && near(*f) > 0.0, "{f} lies {off} outside");
    }
    let farthest = found.iter().map(|&f| near(f)).fold(0.0, f64::max);
    for i in 0..12 {
        for j in 0..12 {
            for k in 0..12 {
                let p = region.sample([i, j, k].map(|n| n as f32 / 11.0)).unwrap().as_dvec3();
                assert!(near(p) <= farthest + 1e-5, "{p} is farther than all of {found:?} from {samples:?}");
            }
        }
    }
}

#[test]
fn the_papers_start_gives_the_middle_and_the_middles_of_the_sides() {
    let corners = double(&rectangle());
    let found = planar(&rectangle(), &corners);
    let expected = [[-2.0, 0.0], [0.0, -1.0], [0.0, 0.0], [0.0, 1.0], [2.0, 0.0]].map(DVec2::from);
    assert_eq!(found.len(), 5);
    assert!(found.iter().zip(expected).all(|(f, e)| f.distance(e) < 1e-12), "{found:?}");
}

#[test]
fn one_sample_leaves_the_corners_that_are_none() {
    let corners = double(&rectangle());
    assert_eq!(planar(&rectangle(), &[DVec2::ZERO]).len(), 4);
    // From a corner only the opposite one is farther than its surroundings.
    assert_eq!(planar(&rectangle(), &corners[..1]), [corners[2]]);
    assert_eq!(planar(&rectangle(), &[]).len(), 4);
}

#[test]
fn two_samples_and_collinear_ones_have_crossings_without_a_triangle() {
    let two = planar(&rectangle(), &[DVec2::new(-1.0, 0.0), DVec2::new(1.0, 0.0)]);
    for p in [[0.0, -1.0], [0.0, 1.0]].map(DVec2::from) {
        assert!(two.iter().any(|f| f.distance(p) < 1e-9), "{two:?}");
    }
    assert_eq!(two.len(), 6, "the corners are locally farthest: {two:?}");
    let row: Vec<DVec2> = (-2..=2).map(|x| DVec2::new(x.into(), 0.0)).collect();
    let crossed = planar(&rectangle(), &row);
    assert_eq!(
        crossed.iter().filter(|p| p.y.abs() > 0.99 && (p.x.abs() % 1.0 - 0.5).abs() < 1e-9).count(),
        8,
        "{crossed:?}"
    );
}

#[test]
fn cocircular_and_coincident_samples_give_each_vertex_once() {
    let ring = |n: u32| -> Vec<DVec2> {
        (0..n).map(|k| DVec2::from_angle(f64::from(k) * std::f64::consts::TAU / f64::from(n)) * 0.7).collect()
    };
    for n in [4, 5, 8, 12] {
        let mut samples = ring(n);
        samples.extend(ring(n));
        samples.extend(ring(n).iter().map(|p| *p + 1e-9));
        let found = planar(&hexagon(), &samples);
        assert_eq!(found.iter().filter(|p| p.length() < 0.1).count(), 1, "{found:?}");
    }
}

#[test]
fn regions_without_an_extent_and_samples_that_are_no_numbers_do_no_harm() {
    assert!(planar(&[], &[DVec2::ZERO]).is_empty());
    assert!(planar(&[[f32::NAN, 0.0], [1.0, 0.0], [0.0, 1.0]], &[]).is_empty());
    let point = [[3.0, 3.0]; 4];
    assert_eq!(planar(&point, &[DVec2::ZERO]), [DVec2::splat(3.0)]);
    assert!(planar(&point, &[DVec2::splat(3.0)]).is_empty());
    let line = [[0.0, 0.0], [4.0, 0.0]];
    let found = planar(&line, &[DVec2::ZERO, DVec2::new(2.0, 0.0), DVec2::new(4.0, 0.0)]);
    assert_eq!(found, [DVec2::new(1.0, 0.0), DVec2::new(3.0, 0.0)]);
    let odd = planar(&rectangle(), &[DVec2::NAN, DVec2::INFINITY, DVec2::new(1e300, 0.0), DVec2::ZERO]);
    assert_eq!(odd.len(), 4);
    assert!(solid(&half_spaces(&Region::Everywhere), &[DVec3::ZERO]).is_empty());
    let speck = Region::Box(Aabb { min: Vec3::ONE, max: Vec3::ONE });
    assert_eq!(solid(&half_spaces(&speck), &[DVec3::ZERO]), [DVec3::ONE]);
}

#[test]
fn a_box_with_samples_in_its_corners_wants_its_middle_most() {
    for k in [1e-3f32, 1.0, 1e6] {
        let b = Aabb { min: Vec3::new(1.0, 2.0, 3.0) * k, max: Vec3::new(3.0, 4.0, 7.0) * k };
        let samples = b.corners().map(|c| c.as_dvec3());
        let found = solid(&half_spaces(&Region::Box(b)), &samples);
        // The middles of its 12 edges and 6 faces, and its own.
        assert_eq!(found.len(), 19, "{found:?}");
        assert!(found.iter().any(|f| f.distance(b.centre().as_dvec3()) < 1e-6 * f64::from(k)));
    }
}

#[test]
fn a_balls_candidates_lie_around_it() {
    let found = solid(&half_spaces(&ball()), &[DVec3::new(0.25, 0.0, -0.125)]);
    let Region::Sphere { centre, radius } = ball() else { panic!("a ball") };
    assert!(found.len() >= 24, "{}", found.len());
    for f in found {
        let share = f.distance(centre.as_dvec3()) / f64::from(radius);
        assert!((1.0..1.2).contains(&share), "{share}");
    }
}
