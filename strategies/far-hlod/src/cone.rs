//! Normal cones: which eyes see only backs (Shirman and Abi-Ezzi, *The cone of normals technique*, 1993).

use farfield_core::Aabb;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// All normals lie within an angle of the axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Cone {
    pub(crate) axis: Vec3,
    /// Sine of the angle; above 1 where normals are more than a right angle off, or something is seen from behind too.
    pub(crate) sine: f32,
}

/// Rounding of normals, radians.
const SLACK: f32 = 1e-3;

impl Cone {
    /// Holds every direction.
    pub(crate) const ALL: Self = Self { axis: Vec3::Z, sine: 2.0 };

    /// Over unit normals and other cones; [`Cone::ALL`] over none.
    pub(crate) fn over(normals: impl Iterator<Item = Vec3> + Clone, cones: &[Self]) -> Self {
        let sum = normals.clone().sum::<Vec3>() + cones.iter().map(|c| c.axis).sum::<Vec3>();
        let Some(axis) = sum.try_normalize().filter(|_| cones.iter().all(|c| c.sine <= 1.0)) else { return Self::ALL };
        let away = |n: Vec3| axis.cross(n).length().atan2(axis.dot(n));
        let own = normals.map(away).fold(0.0, f32::max);
        let angle = cones.iter().map(|c| away(c.axis) + c.sine.asin()).fold(own, f32::max) + SLACK;
        if angle < std::f32::consts::FRAC_PI_2 { Self { axis, sine: angle.sin() } } else { Self::ALL }
    }

    /// Whether all that lies in a box shows its back to an eye. For the box's ball with centre c and radius r every direction from the eye
    /// to a point is within asin(r / d) of that to c: backs alone where the angle to the axis is less than 90 degrees minus both.
    pub(crate) fn shows_backs(&self, bounds: &Aabb, eye: Vec3) -> bool {
        let (to, r) = (bounds.centre() - eye, 0.5 * bounds.size().length());
        self.sine <= 1.0 && to.dot(self.axis) > self.sine * to.length() + r
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_shows_backs_faces_the_eye_nowhere(
            at in prop::collection::vec((-1f32..1.0, -1f32..1.0, -1f32..1.0, -0.6f32..0.6, -0.6f32..0.6), 1..20),
            eye in (-6f32..6.0, -6f32..6.0, -6f32..6.0), split in 0usize..20
        ) {
            let points: Vec<(Vec3, Vec3)> = at.iter()
                .map(|&(x, y, z, a, b)| (Vec3::new(x, y, z), Vec3::new(a, b, 1.0).normalize())).collect();
            let bounds = Aabb::of(points.iter().map(|p| p.0));
            let (one, two) = points.split_at(split.min(points.len()));
            let part = Cone::over(one.iter().map(|p| p.1), &[]);
            let whole = if one.is_empty() { Cone::over(two.iter().map(|p| p.1), &[]) }
                else { Cone::over(two.iter().map(|p| p.1), &[part]) };
            let eye = Vec3::from(eye);
            if whole.shows_backs(&bounds, eye) {
                prop_assert!(points.iter().all(|(p, n)| n.dot(eye - *p) <= 0.0));
            }
        }
    }

    #[test]
    fn a_wall_is_culled_from_behind_and_from_nowhere_else() {
        let wall = Aabb { min: Vec3::new(-1.0, -1.0, 0.0), max: Vec3::new(1.0, 1.0, 0.0) };
        let cone = Cone::over(std::iter::repeat_n(Vec3::Z, 5), &[]);
        assert!(cone.shows_backs(&wall, Vec3::new(0.0, 0.0, -9.0)));
        assert!(!cone.shows_backs(&wall, Vec3::new(0.0, 0.0, 9.0)));
        assert_eq!(Cone::over([Vec3::Z, -Vec3::Z].into_iter(), &[]), Cone::ALL);
        assert_eq!(Cone::over(std::iter::empty(), &[]), Cone::ALL);
        assert_eq!(Cone::over([Vec3::Z].into_iter(), &[Cone::ALL]), Cone::ALL);
    }
}
