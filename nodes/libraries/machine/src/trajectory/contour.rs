//! Chains of straight lines and arcs in a plane, and points along them.

use std::f64::consts::{FRAC_PI_2, TAU};

use nalgebra::{Rotation2, Vector2};

/// One piece of a contour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Element {
    /// A straight line.
    Line {
        /// Beginning, mm.
        from_mm: Vector2<f64>,
        /// End, mm.
        to_mm: Vector2<f64>,
    },
    /// An arc.
    Arc {
        /// Centre, mm.
        centre_mm: Vector2<f64>,
        /// Radius, mm.
        radius_mm: f64,
        /// Direction of its beginning seen from the centre, rad.
        from_rad: f64,
        /// Angle swept, counter-clockwise positive, rad.
        swept_rad: f64,
    },
}

impl Element {
    /// Length, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        match self {
            Self::Line { from_mm, to_mm } => (to_mm - from_mm).norm(),
            Self::Arc {
                radius_mm,
                swept_rad,
                ..
            } => radius_mm * swept_rad.abs(),
        }
    }

    /// Point at the share `share` of its length.
    #[must_use]
    pub fn point_mm(&self, share: f64) -> Vector2<f64> {
        match self {
            Self::Line { from_mm, to_mm } => from_mm + (to_mm - from_mm) * share,
            Self::Arc {
                centre_mm,
                radius_mm,
                from_rad,
                swept_rad,
            } => centre_mm + direction(from_rad + share * swept_rad) * *radius_mm,
        }
    }

    /// Unit vector along it at the share `share` of its length.
    #[must_use]
    pub fn tangent(&self, share: f64) -> Vector2<f64> {
        match self {
            Self::Line { from_mm, to_mm } => {
                (to_mm - from_mm).try_normalize(0.0).unwrap_or_default()
            }
            Self::Arc {
                from_rad,
                swept_rad,
                ..
            } => direction(from_rad + share * swept_rad + FRAC_PI_2.copysign(*swept_rad)),
        }
    }

    /// The part of it between two shares of its length.
    #[must_use]
    pub fn part(&self, from: f64, to: f64) -> Self {
        match *self {
            Self::Line { .. } => Self::Line {
                from_mm: self.point_mm(from),
                to_mm: self.point_mm(to),
            },
            Self::Arc {
                centre_mm,
                radius_mm,
                from_rad,
                swept_rad,
            } => Self::Arc {
                centre_mm,
                radius_mm,
                from_rad: from_rad + from * swept_rad,
                swept_rad: (to - from) * swept_rad,
            },
        }
    }

    /// Its radius of curvature; infinite for a line, mm.
    #[must_use]
    pub const fn curvature_radius_mm(&self) -> f64 {
        match self {
            Self::Line { .. } => f64::INFINITY,
            Self::Arc { radius_mm, .. } => *radius_mm,
        }
    }

    fn reversed(self) -> Self {
        self.part(1.0, 0.0)
    }

    /// Its end and, of an arc, the points where it turns back along u or v.
    fn extremes_mm(&self) -> Vec<Vector2<f64>> {
        let mut points = vec![self.point_mm(0.0), self.point_mm(1.0)];
        if let Self::Arc {
            centre_mm,
            radius_mm,
            from_rad,
            swept_rad,
        } = self
        {
            let (low, high) = (from_rad.min(from_rad + swept_rad), swept_rad.abs());
            for quarter in [0.0, 1.0, 2.0, 3.0] {
                let angle = quarter * FRAC_PI_2;
                if (angle - low).rem_euclid(TAU) <= high {
                    points.push(centre_mm + direction(angle) * *radius_mm);
                }
            }
        }
        points
    }

    /// Greatest distance from `point_mm`.
    fn reach_mm(&self, point_mm: &Vector2<f64>) -> f64 {
        let ends = (self.point_mm(0.0) - point_mm)
            .norm()
            .max((self.point_mm(1.0) - point_mm).norm());
        let Self::Arc {
            centre_mm,
            radius_mm,
            from_rad,
            swept_rad,
        } = self
        else {
            return ends;
        };
        let away = centre_mm - point_mm;
        let low = from_rad.min(from_rad + swept_rad);
        let farthest_rad = away.y.atan2(away.x);
        if away.norm() == 0.0 || (farthest_rad - low).rem_euclid(TAU) <= swept_rad.abs() {
            ends.max(away.norm() + radius_mm)
        } else {
            ends
        }
    }
}

/// A chain of elements, each beginning where the one before it ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Contour {
    /// The elements in order; never empty.
    pub elements: Vec<Element>,
    /// Whether it ends where it begins, with the same tangent.
    pub is_closed: bool,
}

impl Contour {
    /// Length, mm.
    #[must_use]
    pub fn length_mm(&self) -> f64 {
        self.elements.iter().map(Element::length_mm).sum()
    }

    /// The same run the other way; a closed one still begins at its beginning.
    #[must_use]
    pub fn reversed(&self) -> Self {
        Self {
            elements: self.elements.iter().rev().map(|e| e.reversed()).collect(),
            is_closed: self.is_closed,
        }
    }

    /// Least radius of curvature; infinite where it is straight, mm.
    #[must_use]
    pub fn least_radius_mm(&self) -> f64 {
        let radii = self.elements.iter().map(Element::curvature_radius_mm);
        radii.fold(f64::INFINITY, f64::min)
    }

    /// Cuts it at `cuts_mm` (distances from its beginning, ascending): the pieces before each cut
    /// since the one before it, the last piece running to the end.
    #[must_use]
    pub fn cut(&self, cuts_mm: &[f64]) -> Vec<Vec<Element>> {
        let mut parts = Vec::with_capacity(cuts_mm.len() + 1);
        let mut part = Vec::new();
        let mut cuts = cuts_mm.iter().copied().peekable();
        let mut at_mm = 0.0;
        for element in &self.elements {
            let length_mm = element.length_mm();
            let mut from = 0.0;
            while let Some(cut_mm) = cuts.next_if(|cut_mm| *cut_mm <= at_mm + length_mm) {
                let to = ((cut_mm - at_mm) / length_mm).clamp(from, 1.0);
                if to > from {
                    part.push(element.part(from, to));
                }
                parts.push(std::mem::take(&mut part));
                from = to;
            }
            if from < 1.0 {
                part.push(element.part(from, 1.0));
            }
            at_mm += length_mm;
        }
        // A cut at the very end may lie a rounding error behind it.
        for _ in cuts {
            parts.push(std::mem::take(&mut part));
        }
        parts.push(part);
        parts
    }

    /// What leads to its beginning without a bend, `length_mm` long.
    #[must_use]
    pub fn run_in(&self, length_mm: f64) -> Element {
        let first = self.elements[0];
        match (first, self.is_closed) {
            (Element::Arc { .. }, true) => {
                let share = length_mm / first.length_mm();
                first.part(-share, 0.0)
            }
            _ => {
                let begin_mm = first.point_mm(0.0);
                Element::Line {
                    from_mm: begin_mm - first.tangent(0.0) * length_mm,
                    to_mm: begin_mm,
                }
            }
        }
    }

    /// What goes on from its end without a bend, `length_mm` long.
    #[must_use]
    pub fn run_out(&self, length_mm: f64) -> Element {
        let last = self.elements[self.elements.len() - 1];
        match (last, self.is_closed) {
            (Element::Arc { .. }, true) => {
                let share = length_mm / last.length_mm();
                last.part(1.0, 1.0 + share)
            }
            _ => {
                let end_mm = last.point_mm(1.0);
                Element::Line {
                    from_mm: end_mm,
                    to_mm: end_mm + last.tangent(1.0) * length_mm,
                }
            }
        }
    }
}

/// Points that bound a chain of elements along u and v.
pub(super) fn extremes_mm(elements: &[Element]) -> Vec<Vector2<f64>> {
    elements.iter().flat_map(Element::extremes_mm).collect()
}

/// Greatest distance of a chain of elements from `point_mm`.
pub(super) fn reach_mm(elements: &[Element], point_mm: &Vector2<f64>) -> f64 {
    let reaches = elements.iter().map(|element| element.reach_mm(point_mm));
    reaches.fold(0.0, f64::max)
}

/// Unit vector in the direction `angle_rad`.
pub(super) fn direction(angle_rad: f64) -> Vector2<f64> {
    Rotation2::new(angle_rad) * Vector2::x()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle() -> Contour {
        Contour {
            elements: vec![Element::Arc {
                centre_mm: Vector2::new(10.0, 0.0),
                radius_mm: 50.0,
                from_rad: 0.0,
                swept_rad: TAU,
            }],
            is_closed: true,
        }
    }

    #[test]
    fn cuts_meet_each_other_and_add_up_to_the_whole() {
        let circle = circle();
        let whole_mm = circle.length_mm();
        let cuts: Vec<f64> = (0..8).map(|k| whole_mm * f64::from(k) / 8.0).collect();
        let parts = circle.cut(&cuts);
        assert_eq!(parts.len(), 9);
        assert!(parts[0].is_empty(), "the first station is the beginning");
        let lengths: f64 = parts.iter().flatten().map(Element::length_mm).sum();
        assert!((lengths - whole_mm).abs() < 1e-9);
        let quarter = parts[2].last().unwrap().point_mm(1.0);
        assert!((quarter - Vector2::new(10.0, 50.0)).norm() < 1e-9);
    }

    #[test]
    fn a_circle_reaches_its_radius_on_every_side_and_half_of_it_does_not() {
        let circle = circle();
        let reach = reach_mm(&circle.elements, &Vector2::zeros());
        assert!((reach - 60.0).abs() < 1e-9);
        let half = circle.elements[0].part(0.25, 0.75);
        assert!((reach_mm(&[half], &Vector2::zeros()) - 2600.0_f64.sqrt()).abs() < 1e-9);
        let least = extremes_mm(&[half]).iter().map(|p| p.x).fold(0.0, f64::min);
        assert!((least + 40.0).abs() < 1e-9);
    }

    #[test]
    fn run_in_and_run_out_go_on_without_a_bend() {
        let circle = circle();
        let (before, after) = (circle.run_in(5.0), circle.run_out(5.0));
        assert!((before.tangent(1.0) - circle.elements[0].tangent(0.0)).norm() < 1e-12);
        assert!((after.tangent(0.0) - circle.elements[0].tangent(1.0)).norm() < 1e-12);
        assert!((before.length_mm() - 5.0).abs() < 1e-9);
        let back = circle.reversed();
        assert!((back.elements[0].point_mm(0.0) - circle.elements[0].point_mm(0.0)).norm() < 1e-9);
        assert!((back.elements[0].tangent(0.0) + circle.elements[0].tangent(0.0)).norm() < 1e-9);
        assert!((back.run_in(5.0).point_mm(1.0) - Vector2::new(60.0, 0.0)).norm() < 1e-9);
    }
}
