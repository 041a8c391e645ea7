//! The planar shapes of grid-encoder tests.
//!
//! Angles count from the plane's first axis to its second. Each shape is drawn counter-clockwise or forwards;
//! it is run backwards for the other sense, on the same place.

use metrology::sample::TestKind;
use nalgebra::Vector2;

use super::contour::{Contour, Element, direction};
use super::error::TrajectoryError;

/// A number by its key.
type Named = (&'static str, f64);

/// A planar shape about its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// A full circle.
    Circle {
        /// Radius, mm.
        radius_mm: f64,
        /// Direction of its beginning, rad.
        from_rad: f64,
    },
    /// A part of a circle.
    Arc {
        /// Radius, mm.
        radius_mm: f64,
        /// Direction of its beginning, rad.
        from_rad: f64,
        /// Angle swept, above 0, rad.
        swept_rad: f64,
    },
    /// A line through the centre.
    Line {
        /// Its direction, rad.
        angle_rad: f64,
        /// Length, mm.
        length_mm: f64,
    },
    /// Out along a line and back, the tip at the centre.
    Spike {
        /// Direction of the way out, rad.
        angle_rad: f64,
        /// Length of either way, mm.
        length_mm: f64,
    },
    /// Two lines that meet at the centre.
    Corner {
        /// Direction of the first line, rad.
        angle_rad: f64,
        /// Angle between the lines: a quarter turn for a right corner, more for an obtuse one, rad.
        between_rad: f64,
        /// Length of each line, mm.
        leg_mm: f64,
    },
    /// A line that runs on into an arc without a bend, meeting it at the centre.
    ArcWithLine {
        /// Direction of the line, rad.
        angle_rad: f64,
        /// Length of the line, mm.
        line_mm: f64,
        /// Radius of the arc, to the left of the line, mm.
        radius_mm: f64,
        /// Angle swept by the arc, rad.
        swept_rad: f64,
    },
    /// Two arcs that meet at the centre without a bend, the first to the left, the second to the right.
    TwoArcs {
        /// Direction in which the centre is passed, rad.
        angle_rad: f64,
        /// Radius of each, mm.
        radii_mm: [f64; 2],
        /// Angle swept by each, rad.
        swept_rad: f64,
    },
}

impl Shape {
    /// What its test segment is called.
    #[must_use]
    pub const fn kind(&self) -> TestKind {
        match self {
            Self::Circle { .. } => TestKind::Circle,
            Self::Arc { .. } => TestKind::Arc,
            Self::Line { .. } => TestKind::Line,
            Self::Spike { .. } => TestKind::Spike,
            Self::Corner { .. } => TestKind::Corner,
            Self::ArcWithLine { .. } => TestKind::ArcWithLine,
            Self::TwoArcs { .. } => TestKind::TwoArcs,
        }
    }

    /// Radius that its test segment states; zero where there is none, mm.
    #[must_use]
    pub const fn radius_mm(&self) -> f64 {
        match self {
            Self::Circle { radius_mm, .. }
            | Self::Arc { radius_mm, .. }
            | Self::ArcWithLine { radius_mm, .. } => *radius_mm,
            Self::TwoArcs { radii_mm, .. } => radii_mm[0],
            Self::Line { .. } | Self::Spike { .. } | Self::Corner { .. } => 0.0,
        }
    }

    /// Its contour, counter-clockwise or forwards.
    ///
    /// # Errors
    /// Lengths, radii and angles that make no such shape.
    pub fn contour(&self) -> Result<Contour, TrajectoryError> {
        self.check()?;
        let is_closed = matches!(self, Self::Circle { .. });
        Ok(Contour {
            elements: self.elements(),
            is_closed,
        })
    }

    fn check(&self) -> Result<(), TrajectoryError> {
        const SWEPT: &str = "must be above 0 and at most 360 deg";
        const BETWEEN: &str = "must be above 0 and below 180 deg";
        let (heading, lengths, turn) = self.numbers();
        finite(heading.0, heading.1)?;
        for (key, value) in lengths {
            positive(key, value)?;
        }
        match (self, turn) {
            (Self::Corner { .. }, Some(between_rad)) => {
                let holds = between_rad > 0.0 && between_rad < std::f64::consts::PI;
                require("between_deg", between_rad.to_degrees(), holds, BETWEEN)
            }
            (_, Some(swept_rad)) => {
                let holds = swept_rad > 0.0 && swept_rad <= std::f64::consts::TAU;
                require("swept_deg", swept_rad.to_degrees(), holds, SWEPT)
            }
            (_, None) => Ok(()),
        }
    }

    /// Its heading, its lengths, and the angle swept or between.
    fn numbers(&self) -> (Named, Vec<Named>, Option<f64>) {
        match *self {
            Self::Circle {
                radius_mm,
                from_rad,
            } => (("from_rad", from_rad), vec![("radius_mm", radius_mm)], None),
            Self::Arc {
                radius_mm,
                from_rad,
                swept_rad,
            } => {
                let lengths = vec![("radius_mm", radius_mm)];
                (("from_rad", from_rad), lengths, Some(swept_rad))
            }
            Self::Line {
                angle_rad,
                length_mm,
            }
            | Self::Spike {
                angle_rad,
                length_mm,
            } => (
                ("angle_rad", angle_rad),
                vec![("length_mm", length_mm)],
                None,
            ),
            Self::Corner {
                angle_rad,
                between_rad,
                leg_mm,
            } => {
                let lengths = vec![("leg_mm", leg_mm)];
                (("angle_rad", angle_rad), lengths, Some(between_rad))
            }
            Self::ArcWithLine {
                angle_rad,
                line_mm,
                radius_mm,
                swept_rad,
            } => {
                let lengths = vec![("line_mm", line_mm), ("radius_mm", radius_mm)];
                (("angle_rad", angle_rad), lengths, Some(swept_rad))
            }
            Self::TwoArcs {
                angle_rad,
                radii_mm: [first, second],
                swept_rad,
            } => {
                let lengths = vec![("radii_mm[0]", first), ("radii_mm[1]", second)];
                (("angle_rad", angle_rad), lengths, Some(swept_rad))
            }
        }
    }

    fn elements(&self) -> Vec<Element> {
        let line = |from_mm, to_mm| Element::Line { from_mm, to_mm };
        let origin = Vector2::zeros();
        match *self {
            Self::Circle {
                radius_mm,
                from_rad,
            } => vec![about_origin(radius_mm, from_rad, std::f64::consts::TAU)],
            Self::Arc {
                radius_mm,
                from_rad,
                swept_rad,
            } => vec![about_origin(radius_mm, from_rad, swept_rad)],
            Self::Line {
                angle_rad,
                length_mm,
            } => {
                let half = direction(angle_rad) * (length_mm / 2.0);
                vec![line(-half, half)]
            }
            Self::Spike {
                angle_rad,
                length_mm,
            } => {
                let foot = -direction(angle_rad) * length_mm;
                vec![line(foot, origin), line(origin, foot)]
            }
            Self::Corner {
                angle_rad,
                between_rad,
                leg_mm,
            } => {
                let from = -direction(angle_rad) * leg_mm;
                let to = direction(angle_rad + std::f64::consts::PI - between_rad) * leg_mm;
                vec![line(from, origin), line(origin, to)]
            }
            Self::ArcWithLine {
                angle_rad,
                line_mm,
                radius_mm,
                swept_rad,
            } => vec![
                line(-direction(angle_rad) * line_mm, origin),
                from_origin(angle_rad, radius_mm, swept_rad),
            ],
            Self::TwoArcs {
                angle_rad,
                radii_mm,
                swept_rad,
            } => {
                // The first arc arrives at the centre: it is one that leaves it, run backwards.
                let arriving =
                    from_origin(angle_rad + std::f64::consts::PI, radii_mm[0], -swept_rad);
                vec![
                    arriving.part(1.0, 0.0),
                    from_origin(angle_rad, radii_mm[1], -swept_rad),
                ]
            }
        }
    }
}

fn about_origin(radius_mm: f64, from_rad: f64, swept_rad: f64) -> Element {
    Element::Arc {
        centre_mm: Vector2::zeros(),
        radius_mm,
        from_rad,
        swept_rad,
    }
}

/// An arc that leaves the origin in the direction `heading_rad`, to the left where it sweeps positive.
fn from_origin(heading_rad: f64, radius_mm: f64, swept_rad: f64) -> Element {
    let from_rad = heading_rad - std::f64::consts::FRAC_PI_2.copysign(swept_rad);
    Element::Arc {
        centre_mm: -direction(from_rad) * radius_mm,
        radius_mm,
        from_rad,
        swept_rad,
    }
}

pub(super) fn require(
    key: &'static str,
    value: f64,
    holds: bool,
    rule: &'static str,
) -> Result<(), TrajectoryError> {
    if holds && value.is_finite() {
        Ok(())
    } else {
        Err(TrajectoryError::Number { key, value, rule })
    }
}

pub(super) fn positive(key: &'static str, value: f64) -> Result<(), TrajectoryError> {
    require(key, value, value > 0.0, "must be a finite number above 0")
}

pub(super) fn finite(key: &'static str, value: f64) -> Result<(), TrajectoryError> {
    require(key, value, true, "must be a finite number")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    #[test]
    fn elements_of_every_shape_meet_and_smooth_ones_do_not_bend() {
        let smooth = [
            Shape::ArcWithLine {
                angle_rad: 0.3,
                line_mm: 20.0,
                radius_mm: 15.0,
                swept_rad: 2.0,
            },
            Shape::TwoArcs {
                angle_rad: -1.0,
                radii_mm: [20.0, 12.0],
                swept_rad: 1.5,
            },
        ];
        let bent = [
            Shape::Spike {
                angle_rad: FRAC_PI_4,
                length_mm: 30.0,
            },
            Shape::Corner {
                angle_rad: 0.0,
                between_rad: FRAC_PI_2,
                leg_mm: 25.0,
            },
        ];
        for shape in smooth.iter().chain(&bent) {
            let contour = shape.contour().unwrap();
            let [first, second] = contour.elements[..] else {
                panic!("two elements")
            };
            assert!((first.point_mm(1.0) - second.point_mm(0.0)).norm() < 1e-12);
            assert!(
                first.point_mm(1.0).norm() < 1e-12,
                "they meet at the centre"
            );
            let bend = (first.tangent(1.0) - second.tangent(0.0)).norm();
            assert_eq!(bend < 1e-9, smooth.contains(shape), "{shape:?} {bend}");
        }
    }

    #[test]
    fn two_arcs_turn_left_and_then_right() {
        let shape = Shape::TwoArcs {
            angle_rad: 0.0,
            radii_mm: [20.0, 10.0],
            swept_rad: FRAC_PI_2,
        };
        let contour = shape.contour().unwrap();
        let begin = contour.elements[0].point_mm(0.0);
        let end = contour.elements[1].point_mm(1.0);
        assert!((begin - Vector2::new(-20.0, 20.0)).norm() < 1e-9, "{begin}");
        assert!((end - Vector2::new(10.0, -10.0)).norm() < 1e-9, "{end}");
        assert!((contour.elements[0].tangent(1.0) - Vector2::x()).norm() < 1e-9);
    }

    #[test]
    fn an_obtuse_corner_bends_by_less_than_a_right_one() {
        let corner = |between_rad| Shape::Corner {
            angle_rad: 0.0,
            between_rad,
            leg_mm: 10.0,
        };
        let end = |shape: Shape| shape.contour().unwrap().elements[1].point_mm(1.0);
        assert!((end(corner(FRAC_PI_2)) - Vector2::new(0.0, 10.0)).norm() < 1e-9);
        let obtuse = end(corner(3.0 * FRAC_PI_4));
        assert!((obtuse - direction(FRAC_PI_4) * 10.0).norm() < 1e-9);
    }

    #[test]
    fn shapes_that_are_none_are_refused_by_key_and_value() {
        let told = |shape: Shape| shape.contour().unwrap_err().to_string();
        let circle = Shape::Circle {
            radius_mm: -1.0,
            from_rad: 0.0,
        };
        assert_eq!(
            told(circle),
            "radius_mm = -1 mm: must be a finite number above 0"
        );
        let line = Shape::Line {
            angle_rad: f64::NAN,
            length_mm: 10.0,
        };
        assert_eq!(told(line), "angle_rad = NaN rad: must be a finite number");
    }
}
