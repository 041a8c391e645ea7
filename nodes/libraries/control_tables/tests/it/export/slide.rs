//! The axis with a known error on which the controls are tried.

use control_tables::AxisErrors;
use metrology::Axis;

/// Points of the tables, mm.
pub const SPACING_MM: f64 = 20.0;
pub const FIRST_MM: f64 = -300.0;
pub const POINTS: usize = 31;
/// Greatest |e'| of both directions: 8e-5 + 0.018/95 + 0.003/60, rounded up.
pub const STEEPEST: f64 = 3.3e-4;

pub fn positions_mm() -> Vec<f64> {
    (0..POINTS)
        .map(|k| FIRST_MM + SPACING_MM * k as f64)
        .collect()
}

/// Lead error, a wave, and a lost motion that changes along the axis, mm.
pub fn error_mm(at_mm: f64, up: bool) -> f64 {
    let common_mm = 8e-5 * at_mm + 0.018 * (at_mm / 95.0).sin();
    let lost_mm = 0.004 + 0.003 * (at_mm / 60.0).cos();
    common_mm + if up { lost_mm } else { -lost_mm }
}

/// Without the lost motion, mm.
pub fn common_mm(at_mm: f64) -> f64 {
    f64::midpoint(error_mm(at_mm, true), error_mm(at_mm, false))
}

/// The errors at the points, times `sign`.
pub fn measured(sign: f64) -> AxisErrors {
    let at = positions_mm();
    let error = |up| at.iter().map(|p| sign * error_mm(*p, up)).collect();
    AxisErrors::new(Axis::X, at.clone(), error(true), error(false)).unwrap()
}

/// What is left of the error over the points and directions.
pub struct Left {
    pub greatest_mm: f64,
    pub error_mm: f64,
    pub least_ratio: f64,
    pub greatest_ratio: f64,
}

/// `reached(p, up)` is where the slide stands after the control was told to go to p.
pub fn left(error: impl Fn(f64, bool) -> f64, reached: impl Fn(f64, bool) -> f64) -> Left {
    let mut left = Left {
        greatest_mm: 0.0,
        error_mm: 0.0,
        least_ratio: f64::INFINITY,
        greatest_ratio: 0.0,
    };
    for at in positions_mm() {
        for up in [true, false] {
            let rest_mm = reached(at, up) - at;
            left.greatest_mm = left.greatest_mm.max(rest_mm.abs());
            let error_mm = error(at, up);
            left.error_mm = left.error_mm.max(error_mm.abs());
            // Where there is nearly no error there is nothing to double.
            if error_mm.abs() > 2e-3 {
                left.least_ratio = left.least_ratio.min(rest_mm / error_mm);
                left.greatest_ratio = left.greatest_ratio.max(rest_mm / error_mm);
            }
        }
    }
    left
}

impl Left {
    /// Less than the rounding and the product of error and slope that a first-order correction leaves.
    pub fn assert_corrected(&self, what: &str, rounding_mm: f64) {
        println!(
            "{what}: {:.2} nm left of up to {:.1} um",
            self.greatest_mm * 1e6,
            self.error_mm * 1e3
        );
        let bound_mm = rounding_mm / 2.0 + self.error_mm * STEEPEST;
        assert!(
            self.greatest_mm <= bound_mm,
            "{what}: {} mm",
            self.greatest_mm
        );
    }

    pub fn assert_doubled(&self, what: &str) {
        println!(
            "{what}, sign turned round: error times {:.4} to {:.4}",
            self.least_ratio, self.greatest_ratio
        );
        let about_two = 1.98..=2.02;
        assert!(
            about_two.contains(&self.least_ratio),
            "{what}: {}",
            self.least_ratio
        );
        assert!(
            about_two.contains(&self.greatest_ratio),
            "{what}: {}",
            self.greatest_ratio
        );
    }
}

/// Value of a control's table at `at`: straight lines, held at the ends, as every manual here says.
pub fn look_up(table: &[(f64, f64)], at: f64) -> f64 {
    let after = table.iter().position(|(p, _)| *p > at);
    match after {
        Some(0) => table[0].1,
        None => table.last().unwrap().1,
        Some(k) => {
            let ((p0, v0), (p1, v1)) = (table[k - 1], table[k]);
            (v0 * (p1 - at) + v1 * (at - p0)) / (p1 - p0)
        }
    }
}
