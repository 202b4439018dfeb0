//! Unit vectors as two whole numbers: the octahedral map (Cigolle et al., *A survey of efficient representations for independent unit
//! vectors*, 2014). Strategies round normals with it, stores keep the numbers.

use glam::{Vec2, Vec3};

/// Bits a coordinate that turn a vector by less than half a grey level of Lambert's shading: 1/510 rad.
pub const FINE_BITS: u32 = 11;

/// The numbers of a unit vector, at most 2^(bits - 1) - 1 in size; zero for what is no direction. `bits`: 2 to 16.
pub fn code(n: Vec3, bits: u32) -> [i16; 2] {
    let sum = n.x.abs() + n.y.abs() + n.z.abs();
    if !(sum > 0.0 && sum.is_finite()) {
        return [0; 2];
    }
    let flat = Vec2::new(n.x, n.y) / sum;
    let at = (if n.z < 0.0 { folded(flat) } else { flat }) * half(bits);
    [at.x.round() as i16, at.y.round() as i16]
}

/// The unit vector of its numbers.
pub fn vector(code: [i16; 2], bits: u32) -> Vec3 {
    let at = Vec2::new(f32::from(code[0]), f32::from(code[1])) / half(bits);
    let z = 1.0 - at.x.abs() - at.y.abs();
    let back = if z < 0.0 { folded(at) } else { at };
    // Without a negative zero, which would be no code's vector any more.
    Vec3::new(back.x + 0.0, back.y + 0.0, z).normalize()
}

/// The vector that stands for another once it is stored.
pub fn rounded(n: Vec3, bits: u32) -> Vec3 {
    vector(code(n, bits), bits)
}

fn half(bits: u32) -> f32 {
    ((1u32 << (bits - 1)) - 1) as f32
}

/// The lower half of the octahedron, folded over the upper one's edges, and back.
fn folded(p: Vec2) -> Vec2 {
    let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
    Vec2::new((1.0 - p.y.abs()) * sign(p.x), (1.0 - p.x.abs()) * sign(p.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn fine_bits_turn_by_less_than_half_a_grey_level(x in -1f32..1.0, y in -1f32..1.0, z in -1f32..1.0) {
            prop_assume!(Vec3::new(x, y, z).length() > 1e-3);
            let n = Vec3::new(x, y, z).normalize();
            let r = rounded(n, FINE_BITS);
            prop_assert!(n.cross(r).length().atan2(n.dot(r)) < 1.0 / 510.0);
            prop_assert_eq!(rounded(r, FINE_BITS), r, "what is rounded stays");
        }
    }

    #[test]
    fn what_is_rounded_stays_bit_for_bit() {
        for bits in [8, 10, FINE_BITS] {
            let most = half(bits) as i16;
            for code in
                (-most..=most).flat_map(|x| [[x, most], [x, -most], [most, x], [-most, x], [x, most - x.abs()], [x, 0]])
            {
                let n = vector(code, bits);
                assert_eq!(rounded(n, bits).to_array().map(f32::to_bits), n.to_array().map(f32::to_bits), "{code:?}");
            }
        }
    }

    #[test]
    fn axes_are_exact_and_what_is_no_direction_is_some_direction() {
        for bits in [2, 8, 11, 16] {
            for n in Vec3::AXES.into_iter().chain(Vec3::AXES.map(|a| -a)) {
                assert_eq!(rounded(n, bits), n);
            }
            assert!(rounded(Vec3::ZERO, bits).is_normalized() && rounded(Vec3::NAN, bits).is_normalized());
        }
    }
}
