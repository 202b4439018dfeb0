//! When a box is in view: the yaws at which none of the four side planes of a frustum has all of it outside.
//!
//! A corner at distance rho and azimuth phi from the vertical axis through the point stands, at yaw a, rho cos(a - phi)
//! ahead and rho sin(a - phi) to the right. A side plane lets it in where
//! s rho sin(a - phi) + A rho cos(a - phi) + B y >= 0, with p the pitch, tx and ty the tangents of half the fields of view, and
//!
//! * left, right: s = +-1, A = tx cos p, B = tx sin p;
//! * bottom: s = 0, A = ty cos p - sin p, B = cos p + ty sin p;
//! * top: s = 0, A = ty cos p + sin p, B = ty sin p - cos p.
//!
//! That is an arc around phi + atan2(s, A) of half the width acos(-B y / (rho sqrt(s^2 + A^2))). A plane's yaws are the union
//! over the box's corners, the box's are what the planes have in common: exactly what culling with the planes computes.
//!
//! For a range of pitches A and B become ranges; the union of the arcs of both ends of A, with the end of B that lets in more,
//! holds all yaws at which some pitch of the range sees the box (the condition is linear in A and B). So a bin of pitches is
//! budgeted for more than any of its views, and a range of no width is exact.
//!
//! Most boxes give one arc a plane and one in all, found with an arc cosine a corner; what does not (boxes over or under the
//! point, boxes wider than the picture) goes through lists of arcs.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use crate::arcs::{self, Arc, FULL};

/// The cosine of a pitch that is as good as vertical.
const STEEP: f64 = 1e-6;

/// One side plane over a range of pitches.
#[derive(Clone, Copy, Debug)]
struct Plane {
    /// sqrt(s^2 + A^2) and atan2(s, A) at the ends of A; the second equals the first where the range has no width.
    ends: [(f64, f64); 2],
    /// The range of B.
    b: [f64; 2],
}

/// The frusta of a range of pitches.
#[derive(Clone, Debug)]
pub(crate) struct Cone {
    planes: [Plane; 4],
    /// Sine and cosine of the middle pitch.
    middle: (f64, f64),
}

/// A rectangle seen from above, from a point outside: azimuth of its middle, its corners' azimuths from there and distances.
pub(crate) struct Seen {
    base: f64,
    rel: [f64; 4],
    rho: [f64; 4],
}

/// Lists of arcs for boxes that need them.
#[derive(Default)]
pub(crate) struct Scratch {
    plane: Vec<Arc>,
    kept: Vec<Arc>,
    next: Vec<Arc>,
}

impl Cone {
    /// The frusta of these tangents (half fields of view) and pitches, radians.
    pub(crate) fn of(tan: [f64; 2], pitch: [f64; 2]) -> Self {
        // The range of a cos p + b sin p: at the ends, and where it is greatest or least inside.
        let range = |a: f64, b: f64| {
            let at = |p: f64| a * p.cos() + b * p.sin();
            let (mut lo, mut hi) = (at(pitch[0]).min(at(pitch[1])), at(pitch[0]).max(at(pitch[1])));
            let top = b.atan2(a);
            for p in [top - PI, top, top + PI] {
                if pitch[0] < p && p < pitch[1] {
                    (lo, hi) = (lo.min(at(p)), hi.max(at(p)));
                }
            }
            [lo, hi]
        };
        let [tx, ty] = tan;
        let plane = |s: f64, a: [f64; 2], b: [f64; 2]| Plane { ends: a.map(|a| (s.hypot(a), s.atan2(a))), b };
        let (side, up) = (range(tx, 0.0), range(0.0, tx));
        Self {
            planes: [
                plane(1.0, side, up),
                plane(-1.0, side, up),
                plane(0.0, range(ty, -1.0), range(1.0, ty)),
                plane(0.0, range(ty, 1.0), range(-1.0, ty)),
            ],
            middle: (0.5 * (pitch[0] + pitch[1])).sin_cos(),
        }
    }

    /// The direction in the middle of the pitches, at a yaw.
    pub(crate) fn axis(&self, yaw: f64) -> DVec3 {
        let ((sy, cy), (sp, cp)) = (yaw.sin_cos(), self.middle);
        DVec3::new(-sy * cp, sp, -cy * cp)
    }

    /// The yaws at which the box `lo..hi`, relative to the point, may be seen: disjoint pieces. `seen` is [`Seen::of`] it.
    pub(crate) fn sees(
        &self,
        lo: DVec3,
        hi: DVec3,
        seen: Option<&Seen>,
        scratch: &mut Scratch,
        mut emit: impl FnMut(Arc),
    ) {
        if let Some(seen) = seen
            && let Some(found) = self.one_arc(seen, lo.y, hi.y)
        {
            if let Some((a, b)) = found {
                arcs::outer(seen.base + a, seen.base + b, emit);
            }
            return;
        }
        scratch.kept.clear();
        scratch.kept.push(FULL);
        for plane in &self.planes {
            scratch.plane.clear();
            let reach = plane.reach(lo.y, hi.y);
            for (x, z) in [(lo.x, lo.z), (hi.x, lo.z), (lo.x, hi.z), (hi.x, hi.z)] {
                let (rho, phi) = (x.hypot(z), (-x).atan2(-z));
                for (k, turn) in plane.ends {
                    let limit = k * rho;
                    if reach >= limit {
                        scratch.plane.push(FULL);
                    } else if reach >= -limit {
                        let wide = (-reach / limit).acos();
                        arcs::outer(phi + turn - wide, phi + turn + wide, |a| scratch.plane.push(a));
                    }
                }
            }
            arcs::unite(&mut scratch.plane);
            scratch.next.clear();
            arcs::intersect(&scratch.kept, &scratch.plane, |a| scratch.next.push(a));
            std::mem::swap(&mut scratch.kept, &mut scratch.next);
        }
        scratch.kept.iter().for_each(|&a| emit(a));
    }

    /// The yaws as one range from the middle of the rectangle, `Some(None)` for none; `None` where it may take more.
    fn one_arc(&self, seen: &Seen, y0: f64, y1: f64) -> Option<Option<(f64, f64)>> {
        // Wholly above or below, at every yaw.
        let farthest = seen.rho.into_iter().fold(0.0, f64::max);
        let never = |p: &Plane| p.ends.iter().all(|end| p.reach(y0, y1) < -end.0 * farthest);
        if self.planes[2..].iter().any(never) {
            return Some(None);
        }
        let mut now: Option<(f64, f64)> = None;
        for plane in &self.planes {
            let reach = plane.reach(y0, y1);
            let [first, second] = plane.ends;
            // At or above half a circle around the first corner: nothing is taken away from less than that.
            if let Some((lo, hi)) = now
                && reach >= 0.0
                && lo >= seen.rel[0] + first.1 - FRAC_PI_2
                && hi <= seen.rel[0] + first.1 + FRAC_PI_2
            {
                continue;
            }
            let one = seen.union(first, reach)?;
            let other = if first == second { one } else { seen.union(second, reach)? };
            let (mut lo, mut hi) = match (one, other) {
                (None, None) => return Some(None),
                (Some(only), None) | (None, Some(only)) => only,
                (Some((a, b)), Some((c, d))) if a <= d && b >= c => (a.min(c), b.max(d)),
                _ => return None,
            };
            if hi - lo >= TAU {
                continue;
            }
            now = Some(match now {
                None => (lo, hi),
                Some((a, b)) => {
                    let shift = ((0.5 * (a + b) - 0.5 * (lo + hi)) / TAU).round() * TAU;
                    (lo, hi) = (lo + shift, hi + shift);
                    if lo + TAU <= b || hi - TAU >= a {
                        return None;
                    }
                    if lo > b || hi < a {
                        return Some(None);
                    }
                    (a.max(lo), b.min(hi))
                }
            });
        }
        Some(Some(now.unwrap_or((0.0, TAU))))
    }

    /// The yaws at which the whole box lies at least `depth` (above 0) ahead, along the axis in the middle of the pitches;
    /// not all of them where the point looks far up or down, and a little narrower.
    pub(crate) fn beyond(&self, lo: DVec3, hi: DVec3, depth: f64, emit: impl FnMut(Arc)) {
        let (sp, cp) = self.middle;
        let least = (sp * lo.y).min(sp * hi.y);
        let Some(seen) = Seen::of(lo, hi) else { return };
        // Straight up or down yaw hardly turns the axis, and rounding may have taken the pitch past the vertical.
        if cp < STEEP {
            let farthest = seen.rho.into_iter().fold(0.0, f64::max);
            if least - STEEP * farthest >= depth {
                arcs::inner(-4.0, 4.0, emit);
            }
            return;
        }
        let (mut a, mut b) = (f64::NEG_INFINITY, f64::INFINITY);
        for (rel, rho) in seen.rel.iter().zip(seen.rho) {
            let cosine = (depth - least) / (cp * rho);
            if cosine > 1.0 {
                return;
            }
            let wide = cosine.max(-1.0).acos();
            (a, b) = (a.max(rel - wide), b.min(rel + wide));
        }
        if a < b {
            arcs::inner(seen.base + a, seen.base + b, emit);
        }
    }
}

impl Plane {
    /// The greatest B y over the box's heights.
    fn reach(&self, y0: f64, y1: f64) -> f64 {
        let [b0, b1] = self.b;
        (b0 * y0).max(b0 * y1).max(b1 * y0).max(b1 * y1)
    }
}

impl Seen {
    /// `None` for a box over, under or around the point.
    pub(crate) fn of(lo: DVec3, hi: DVec3) -> Option<Self> {
        if lo.x <= 0.0 && hi.x >= 0.0 && lo.z <= 0.0 && hi.z >= 0.0 {
            return None;
        }
        let (cx, cz) = (0.5 * (lo.x + hi.x), 0.5 * (lo.z + hi.z));
        let corners = [(lo.x, lo.z), (hi.x, lo.z), (lo.x, hi.z), (hi.x, hi.z)];
        Some(Self {
            base: (-cx).atan2(-cz),
            rel: corners.map(|(x, z)| (x * cz - z * cx).atan2(z * cz + x * cx)),
            rho: corners.map(|(x, z)| (x * x + z * z).sqrt()),
        })
    }

    /// The union of the corners' arcs for one plane, as a range from the middle: `None` where it may have gaps, `Some(None)` for none.
    fn union(&self, (k, turn): (f64, f64), reach: f64) -> Option<Option<(f64, f64)>> {
        let (mut lo, mut hi) = (f64::INFINITY, f64::NEG_INFINITY);
        let (mut first, mut last, mut least) = (f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY);
        for (rel, rho) in self.rel.iter().zip(self.rho) {
            let limit = k * rho;
            if reach >= limit {
                // More than a whole turn.
                return Some(Some((turn - 4.0, turn + 4.0)));
            }
            if reach < -limit {
                continue;
            }
            let wide = if reach == 0.0 { FRAC_PI_2 } else { (-reach / limit).acos() };
            (lo, hi) = (lo.min(rel - wide), hi.max(rel + wide));
            (first, last, least) = (first.min(*rel), last.max(*rel), least.min(wide));
        }
        if lo > hi {
            Some(None)
        } else if last - first <= 2.0 * least {
            Some(Some((lo + turn, hi + turn)))
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arcs::turn_of;
    use farfield_core::Aabb;
    use farfield_core::camera::ViewModel;
    use proptest::prelude::*;

    fn views(fov_y: f32, wide: u32) -> ViewModel {
        ViewModel {
            fov_y_rad: fov_y,
            resolution: [wide, 100],
            near: 0.01,
            eye_height: [0.0; 2],
            pitch_rad: [0.0; 2],
            max_speed: 1.0,
            max_turn_rad: 1.0,
        }
    }

    fn tangents(v: &ViewModel) -> [f64; 2] {
        let c = v.camera(DVec3::ZERO, 0.0, 0.0);
        [c.right_tan.into(), c.top.into()]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(400))]
        #[test]
        fn arcs_are_what_culling_at_many_yaws_finds(
            at in [-5f32..5.0, -5f32..5.0, -5f32..5.0], size in [0.01f32..6.0, 0.01f32..6.0, 0.01f32..6.0],
            fov in 0.8f32..1.9, wide in 90u32..160, pitch in prop::sample::select(vec![0.0f32, 0.3, -0.7, 1.2, -1.5])
        ) {
            let v = views(fov, wide);
            let b = Aabb { min: at.into(), max: glam::Vec3::from(at) + glam::Vec3::from(size) };
            let cone = Cone::of(tangents(&v), [f64::from(pitch); 2]);
            let mut found = vec![];
            let (lo, hi) = (b.min.as_dvec3(), b.max.as_dvec3());
            cone.sees(lo, hi, Seen::of(lo, hi).as_ref(), &mut Scratch::default(), |a| found.push(a));
            let mut listed = vec![];
            cone.sees(lo, hi, None, &mut Scratch::default(), |a| listed.push(a));
            let wide = |arcs: &[Arc]| arcs.iter().map(|a| f64::from(a.hi - a.lo)).sum::<f64>();
            prop_assert!((wide(&found) - wide(&listed)).abs() < 16.0, "{found:?} and {listed:?}");
            // Turned by the widening and a little more, a border's answer is that of a yaw beside it.
            for i in 0..700u32 {
                let yaw = i as f32 * std::f32::consts::TAU / 700.0;
                let seen = |off: f32| v.camera(DVec3::ZERO, yaw + off, pitch).may_see(&b);
                let held = found.iter().any(|a| (a.lo..=a.hi).contains(&turn_of(yaw.into())));
                prop_assert!(held || !seen(0.0), "yaw {yaw} is seen");
                prop_assert!(!held || seen(0.0) || seen(1e-3) || seen(-1e-3), "yaw {yaw} is not seen");
            }
        }

        #[test]
        fn a_bin_of_pitches_holds_the_views_of_all_of_them(
            at in [-5f32..5.0, -5f32..5.0, -5f32..5.0], size in [0.01f32..4.0, 0.01f32..4.0, 0.01f32..4.0],
            low in -1.5f32..1.2, width in 0.01f32..0.3
        ) {
            let v = views(1.0, 133);
            let b = Aabb { min: at.into(), max: glam::Vec3::from(at) + glam::Vec3::from(size) };
            let cone = Cone::of(tangents(&v), [f64::from(low), f64::from(low + width)]);
            let mut found = vec![];
            let (lo, hi) = (b.min.as_dvec3(), b.max.as_dvec3());
            cone.sees(lo, hi, Seen::of(lo, hi).as_ref(), &mut Scratch::default(), |a| found.push(a));
            let mut listed = vec![];
            cone.sees(lo, hi, None, &mut Scratch::default(), |a| listed.push(a));
            let wide = |arcs: &[Arc]| arcs.iter().map(|a| f64::from(a.hi - a.lo)).sum::<f64>();
            prop_assert!((wide(&found) - wide(&listed)).abs() < 16.0, "{found:?} and {listed:?}");
            for i in 0..200u32 { for j in 0..=6u32 {
                let (yaw, pitch) = (i as f32 * std::f32::consts::TAU / 200.0, low + width * j as f32 / 6.0);
                let held = found.iter().any(|a| (a.lo..=a.hi).contains(&turn_of(yaw.into())));
                prop_assert!(held || !v.camera(DVec3::ZERO, yaw, pitch).may_see(&b), "yaw {yaw} pitch {pitch}");
            }}
        }

        #[test]
        fn what_lies_beyond_a_depth_does(
            at in [-5f64..5.0, -2f64..2.0, -5f64..5.0], size in [0.01f64..2.0, 0.01f64..2.0, 0.01f64..2.0],
            pitch in prop::sample::select(vec![0.0f64, 0.4, -0.9]), depth in 0.1f64..4.0
        ) {
            let (lo, hi) = (DVec3::from(at), DVec3::from(at) + DVec3::from(size));
            let cone = Cone::of([0.6; 2], [pitch; 2]);
            let mut found = vec![];
            cone.beyond(lo, hi, depth, |a| found.push(a));
            let corners = |axis: DVec3| (0..8).map(move |i| {
                let pick = |bit: usize, k: usize| if i >> bit & 1 == 0 { lo[k] } else { hi[k] };
                axis.dot(DVec3::new(pick(0, 0), pick(1, 1), pick(2, 2)))
            }).fold(f64::INFINITY, f64::min);
            for i in 0..400u32 {
                let yaw = f64::from(i) * TAU / 400.0;
                let held = found.iter().any(|a| (a.lo..=a.hi).contains(&turn_of(yaw)));
                prop_assert!(!held || corners(cone.axis(yaw)) >= depth);
                let level = pitch == 0.0 && Seen::of(lo, hi).is_some();
                prop_assert!(held || !level || corners(cone.axis(yaw)) < depth + 1e-3);
            }
        }
    }
}
