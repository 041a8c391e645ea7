//! The trace of a circle as it is drawn: deviations from the nominal circle, magnified.
//!
//! # Model
//!
//! ```text
//!   drawn radius = radius of the drawing + deviation · magnification                     (1)
//!   magnification = mm of paper per division / mm of deviation per division               (2)
//! ```
//!
//! The source draws 5 µm a division. Angles count from u towards v. Measured and fitted trace stand side by
//! side: what the fit leaves is between them.

use nalgebra::{Complex, Matrix3, Vector3};

use crate::recording::{GridPoint, Place, Recording, in_plane};

/// How a trace is drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TraceScale {
    /// Deviation per division, mm.
    pub division_mm: f64,
    /// Divisions between nominal circle and centre of the drawing.
    pub divisions_to_centre: u32,
}

impl Default for TraceScale {
    /// 5 µm a division, as the source draws it; ten from the centre to the nominal circle.
    fn default() -> Self {
        Self {
            division_mm: 0.005,
            divisions_to_centre: 10,
        }
    }
}

/// One point of a trace, in divisions from the centre of the drawing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TracePoint {
    /// Angle on the nominal circle, rad.
    pub angle_rad: f64,
    /// Radial deviation, mm.
    pub radial_mm: f64,
    /// Where it is drawn, divisions to the right and upwards.
    pub drawn: [f64; 2],
}

/// A circle of the drawing's grid.
#[derive(Clone, Debug, PartialEq)]
pub struct GridCircle {
    /// Radius, divisions.
    pub radius: f64,
    /// Deviation that it stands for, µm, e.g. `+5 µm`; `0` is the nominal circle.
    pub label: String,
}

/// A trace ready to be drawn.
#[derive(Clone, Debug, PartialEq)]
pub struct Trace {
    /// As measured, centre of the reading taken out.
    pub measured: Vec<TracePoint>,
    /// As the model has it.
    pub fitted: Vec<TracePoint>,
    /// Circles of the grid, ascending.
    pub circles: Vec<GridCircle>,
    /// Letters of the axes to the right and upwards.
    pub axes: [&'static str; 2],
    /// Greatest minus least measured radial deviation, mm.
    pub range_mm: f64,
    /// What one division is, e.g. `5 µm/div`.
    pub scale_label: String,
}

/// Radial deviations of a circle: point by point the angle and n · (deviation), mm.
///
/// `deviations_mm` is along u and v, one per point.
#[must_use]
pub fn radial_deviations(
    place: &Place,
    points: &[GridPoint],
    deviations_mm: &[[f64; 2]],
) -> Vec<(f64, f64)> {
    let centre = in_plane(place.plane, &place.centre_mm);
    let pairs = points.iter().zip(deviations_mm);
    pairs
        .map(|(point, [du, dv])| {
            let at = in_plane(place.plane, &point.positions.xyz());
            let angle_rad = (at[1] - centre[1]).atan2(at[0] - centre[0]);
            let (sin, cos) = angle_rad.sin_cos();
            (angle_rad, du * cos + dv * sin)
        })
        .collect()
}

/// The measured trace of a recorded circle: (angle, radial deviation in mm), with the offset of the grid's zero
/// and the turn of the plate taken out by least squares.
#[must_use]
pub fn measured_trace(recording: &Recording) -> Vec<(f64, f64)> {
    let place = &recording.place;
    let n = recording.points.len().max(1) as f64;
    let position = |point: &GridPoint| {
        let [u, v] = in_plane(place.plane, &point.positions.xyz());
        Complex::new(u, v)
    };
    let reading = |point: &GridPoint| Complex::new(point.reading_mm[0], point.reading_mm[1]);
    let points = || recording.points.iter();
    let mean_position: Complex<f64> = points().map(position).sum::<Complex<f64>>() / n;
    let mean_reading: Complex<f64> = points().map(reading).sum::<Complex<f64>>() / n;
    // Sum of reading times conjugate position turns from positions to readings.
    let turn: Complex<f64> = points()
        .map(|point| (reading(point) - mean_reading) * (position(point) - mean_position).conj())
        .sum();
    let back = Complex::from_polar(1.0, -turn.arg());
    let deviations: Vec<[f64; 2]> = points()
        .map(|point| {
            let read = (reading(point) - mean_reading) * back;
            let off = read - (position(point) - mean_position);
            [off.re, off.im]
        })
        .collect();
    let mut trace = radial_deviations(place, &recording.points, &deviations);
    take_out_centre(&mut trace);
    trace
}

/// The trace that a fit has, from the measured one and the fit's residuals along u and v.
#[must_use]
pub fn fitted_trace(
    recording: &Recording,
    measured: &[(f64, f64)],
    residuals_mm: &[[f64; 2]],
) -> Vec<(f64, f64)> {
    let left = radial_deviations(&recording.place, &recording.points, residuals_mm);
    let pairs = measured.iter().zip(left);
    pairs
        .map(|((angle, radial), (_, left))| (*angle, radial - left))
        .collect()
}

/// Takes the first harmonic that fits best out of a trace.
fn take_out_centre(trace: &mut [(f64, f64)]) {
    let mut normal = Matrix3::zeros();
    let mut right = Vector3::zeros();
    for (angle_rad, radial_mm) in trace.iter() {
        let (sin, cos) = angle_rad.sin_cos();
        let row = Vector3::new(1.0, cos, sin);
        normal += row * row.transpose();
        right += row * *radial_mm;
    }
    let Some(found) = normal.cholesky().map(|c| c.solve(&right)) else {
        return;
    };
    for (angle_rad, radial_mm) in trace {
        let (sin, cos) = angle_rad.sin_cos();
        *radial_mm -= found.y * cos + found.z * sin;
    }
}

/// Lays out a trace from (angle, radial deviation in mm); deviations that the drawing cannot hold make it
/// coarser by whole factors of 2 and 5, never cut.
#[must_use]
pub fn trace(
    place: &Place,
    measured: &[(f64, f64)],
    fitted: &[(f64, f64)],
    scale: TraceScale,
) -> Trace {
    let values = || measured.iter().chain(fitted).map(|(_, r)| *r);
    let greatest = values().map(f64::abs).fold(0.0, f64::max);
    let divisions = f64::from(scale.divisions_to_centre.max(1));
    let mut division_mm = scale.division_mm;
    for factor in [2.0, 2.5, 2.0].into_iter().cycle().take(30) {
        if greatest <= 0.8 * divisions * division_mm {
            break;
        }
        division_mm *= factor;
    }
    let draw = |(angle_rad, radial_mm): &(f64, f64)| {
        let radius = divisions + radial_mm / division_mm; // (1) (2), in divisions
        let (sin, cos) = angle_rad.sin_cos();
        TracePoint {
            angle_rad: *angle_rad,
            radial_mm: *radial_mm,
            drawn: [radius * cos, radius * sin],
        }
    };
    let outermost = (greatest / division_mm).ceil().max(1.0);
    #[expect(
        clippy::cast_possible_truncation,
        reason = "at most 8 by the loop above"
    )]
    let steps = outermost as i32;
    let circle = |step: i32| GridCircle {
        radius: divisions + f64::from(step),
        label: match step {
            0 => String::from("0"),
            _ => format!("{:+} µm", f64::from(step) * division_mm * 1e3),
        },
    };
    let radial = || measured.iter().map(|(_, r)| *r);
    let range_mm = if measured.is_empty() {
        f64::NAN
    } else {
        radial().fold(f64::NEG_INFINITY, f64::max) - radial().fold(f64::INFINITY, f64::min)
    };
    Trace {
        measured: measured.iter().map(draw).collect(),
        fitted: fitted.iter().map(draw).collect(),
        circles: (-steps..=steps).map(circle).collect(),
        axes: crate::recording::plane_axes(place.plane)
            .map_or(["", ""], |axes| axes.map(|a| a.letter())),
        range_mm,
        scale_label: format!("{} µm/div", division_mm * 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::sample::TestPlane;

    fn place() -> Place {
        Place::circle(TestPlane::Zx, Vector3::zeros(), 50.0, 360)
    }

    #[test]
    fn eq1_five_micrometres_are_one_division() {
        let drawn = trace(
            &place(),
            &[(0.0, 0.005), (std::f64::consts::FRAC_PI_2, -0.01)],
            &[],
            TraceScale::default(),
        );
        assert!((drawn.measured[0].drawn[0] - 11.0).abs() < 1e-12);
        assert!((drawn.measured[1].drawn[1] - 8.0).abs() < 1e-12);
        assert_eq!(drawn.scale_label, "5 µm/div");
        assert_eq!(drawn.axes, ["Z", "X"]);
        assert!((drawn.range_mm - 0.015).abs() < 1e-12);
        let labels: Vec<_> = drawn.circles.iter().map(|c| c.label.as_str()).collect();
        assert_eq!(labels, ["-10 µm", "-5 µm", "0", "+5 µm", "+10 µm"]);
    }

    #[test]
    fn an_ellipse_on_a_plate_that_lies_askew_is_drawn_as_an_ellipse() {
        let place = place();
        let point = |k: i32| {
            let angle_rad = f64::from(k).to_radians() * 5.0;
            let positions = place.on_circle_mm(angle_rad);
            let [u, v] = in_plane(place.plane, &positions.xyz());
            // 20 µm/100 mm along u, turned by 0.03 rad, zeroed elsewhere.
            let read = Complex::new(u * 1.0002, v) * Complex::from_polar(1.0, 0.03);
            GridPoint {
                positions,
                sense: Vector3::zeros(),
                velocity_mm_s: Vector3::zeros(),
                reading_mm: [read.re + 3.0, read.im - 7.0],
                standard_uncertainty_mm: [1e-4; 2],
                n_readings: 1,
            }
        };
        let recording = Recording {
            run: 1,
            place,
            points: (0..72).map(point).collect(),
        };
        let trace = measured_trace(&recording);
        for (angle_rad, radial_mm) in &trace {
            let expected = 0.01 * angle_rad.cos().powi(2);
            assert!(
                (radial_mm - expected).abs() < 2e-6,
                "{radial_mm} {expected}"
            );
        }
        let residuals = vec![[0.0; 2]; 72];
        assert_eq!(fitted_trace(&recording, &trace, &residuals), trace);
    }

    #[test]
    fn a_trace_too_large_for_the_drawing_is_drawn_coarser_and_says_so() {
        let drawn = trace(&place(), &[(0.0, 0.1)], &[], TraceScale::default());
        assert_eq!(drawn.scale_label, "25 µm/div");
        assert!(drawn.measured[0].drawn[0] < 18.0);
        assert!(
            trace(&place(), &[], &[], TraceScale::default())
                .range_mm
                .is_nan()
        );
    }
}
