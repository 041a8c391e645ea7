//! Sign of squareness: one for every page, file and message.
//!
//! # Model
//! E_C0Y, E_B0Z and E_A0Z of ISO 230-1 turn an axis as a whole, right-handed about the direction of their first letter
//! \[1\]. θ is the angle that the positive directions of the two axes enclose, φ the angle on a circle from the plane's
//! first axis (X of XY, Y of YZ, Z of ZX) towards its second:
//!
//! ```text
//!   EC0Y > 0: Y leans to −X     θ = 90° + EC0Y                                        (1)
//!   EA0Z > 0: Z leans to −Y     θ = 90° + EA0Z
//!   EB0Z > 0: Z leans to +X     θ = 90° − EB0Z
//!   circle of radius R:  radial deviation = (R/2) (90° − θ) sin 2φ                    (2)
//! ```
//!
//! The HTML page and the text of every section with a squareness carry [`in_words`].
//!
//! # Where a squareness is printed or stored
//!
//! | place | name there | value |
//! |---|---|---|
//! | `abbe report`, page of a run: causes of circles | `squareness XY (EC0Y)` | the component |
//! | their JSON: `breakdown.rows`, `four_point_squareness_rad`, `cross_checks` | key `squareness` | the component, rad |
//! | `abbe report`, page of a run: geometric errors, published separation; JSON `geometry`, `published` | `EC0Y`, `EB0Z`, `EA0Z` | the component |
//! | messages `geometry/model`, `geometry/rotary` | `component: EC0Y` | the component, rad |
//! | `abbe diagnose`, page of a run, JSON `abbe.gap/1`, message `gap/report`: causes | `squareness XY (EC0Y)`, `angle_urad` | the component, µrad |
//! | machine file, `effects: {kind: squareness}` | `angle_urad` | the component, µrad |
//! | `abbe-trials`, journal and tables | `squareness`, `angle_urad` | the component, µrad |
//! | `abbe preflight` | `EC0Y`, `squareness XY (EC0Y)` | uncertainty alone |
//! | `abbe export`: straightness columns and cross-axis tables | none: the lean of (1) as a shift | sign of each control |
//! | plant file of the fake machine, `geometry.squareness_urad` | `y_to_x`, `z_to_x`, `z_to_y` | the lean itself: −EC0Y, +EB0Z, −EA0Z |
//! | diagnose, machine file: `plate_error` | `squareness_um_per_m` q | the plate's, not the machine's: reads like 90° − θ = q |
//! | `grid_encoder`, `plate_squareness_urad`; `rotary_axes`, `allowance.linear_squareness_urad` | | uncertainty alone |
//!
//! `abbe import` reads deviations, and ISO 230-6 compares diagonals: neither has an angle.
//!
//! # References
//! \[1\] ISO 230-1:2012, 3.6.7 and annex A.

use crate::axis::Axis;
use crate::error_component::ErrorComponent;

/// The squareness between two linear axes, in either order; none for one axis or a rotary one.
#[must_use]
pub fn between(one: Axis, other: Axis) -> Option<ErrorComponent> {
    let [y_to_x, z_to_x, z_to_y] = ErrorComponent::SQUARENESS;
    match (one.min(other), one.max(other)) {
        (Axis::X, Axis::Y) => Some(y_to_x),
        (Axis::X, Axis::Z) => Some(z_to_x),
        (Axis::Y, Axis::Z) => Some(z_to_y),
        _ => None,
    }
}

/// What one rad of `squareness` adds to the angle that the positive directions enclose, (1): +1 or −1; 0 for a
/// component that is no squareness.
#[must_use]
pub fn opening(squareness: ErrorComponent) -> f64 {
    let [y_to_x, z_to_x, z_to_y] = ErrorComponent::SQUARENESS;
    match squareness {
        one if one == y_to_x || one == z_to_y => 1.0,
        one if one == z_to_x => -1.0,
        _ => 0.0,
    }
}

/// The sign of a squareness for a reader; none for a component that is no squareness.
#[must_use]
pub fn in_words(squareness: ErrorComponent) -> Option<String> {
    let [y_to_x, z_to_x, _] = ErrorComponent::SQUARENESS;
    let against = match squareness {
        one if one == y_to_x || one == z_to_x => Axis::X,
        _ => Axis::Y,
    };
    let angle = match opening(squareness) {
        sign if sign > 0.0 => "more",
        sign if sign < 0.0 => "less",
        _ => return None,
    };
    Some(format!(
        "{squareness} above 0: {against}+ and {}+ enclose {angle} than 90° (ISO 230-1).",
        squareness.of
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Rotation3, Unit, Vector3};

    fn unit(axis: Axis) -> Vector3<f64> {
        let mut along = Vector3::zeros();
        along[axis.index() % 3] = 1.0;
        along
    }

    #[test]
    fn eq1_a_right_handed_turn_opens_or_closes_the_angle() {
        let angle_rad = 1e-3;
        for (one, other) in [(Axis::X, Axis::Y), (Axis::Z, Axis::X), (Axis::Y, Axis::Z)] {
            let component = between(one, other).unwrap();
            assert_eq!(between(other, one), Some(component));
            let about = Unit::new_normalize(unit(component.direction));
            let turned = Rotation3::from_axis_angle(&about, angle_rad) * unit(component.of);
            let against = if component.of == one { other } else { one };
            let opened_rad = turned.angle(&unit(against)) - std::f64::consts::FRAC_PI_2;
            assert!(
                (opened_rad - opening(component) * angle_rad).abs() < 1e-9,
                "{component}: {opened_rad}"
            );
        }
    }

    #[test]
    fn the_sign_is_put_into_words() {
        let words = |one, other| between(one, other).and_then(in_words).unwrap();
        assert_eq!(
            words(Axis::X, Axis::Y),
            "EC0Y above 0: X+ and Y+ enclose more than 90° (ISO 230-1)."
        );
        assert_eq!(
            words(Axis::Z, Axis::X),
            "EB0Z above 0: X+ and Z+ enclose less than 90° (ISO 230-1)."
        );
        assert_eq!(
            words(Axis::Y, Axis::Z),
            "EA0Z above 0: Y+ and Z+ enclose more than 90° (ISO 230-1)."
        );
        assert_eq!(in_words(ErrorComponent::motion(Axis::C, Axis::Y)), None);
        assert!(between(Axis::X, Axis::C).is_none() && between(Axis::X, Axis::X).is_none());
    }
}
