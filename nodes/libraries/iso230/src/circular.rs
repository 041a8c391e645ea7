//! Circular test of two linear axes (ISO 230-4).
//!
//! # Model
//!
//! Points p_k = (u, v), recorded clockwise, counter-clockwise or both, the two senses in one frame;
//! c_s is the centre of the least-squares circle of one sense, c and r are centre and radius of that of
//! both senses together, or of the one that was recorded:
//!
//! ```text
//!   G (one sense) = max |p_k − c_s| − min |p_k − c_s|                                 (1)
//!   G(b) = max |p_k − c| − min |p_k − c|   over both senses                           (2)
//!   F_k = |p_k − c| − R,   F_max = max F_k,   F_min = min F_k                         (3)
//!   D = r − R                                                                        (4)
//!   H = max |ρ_cw(θ) − ρ_ccw(θ)|,   ρ = |p − c| at the angle θ about c                (5)
//! ```
//!
//! Why F is about the least-squares centre: the standard allows two centres of the nominal path for F, that to which the
//! instrument was centred, or, for a full circle, the least-squares one \[1\]. The first one contains how far the
//! instrument was set up from the programmed centre, and nothing in a recording tells that from the machine: a plate is
//! zeroed anywhere, a ballbar has the eccentricity of its mount. Ballbar programs take the second one too: "the trace is
//! automatically centered according to the average value for all traces" \[2\]. All recorded senses have one centre here,
//! so F still contains what the senses differ by. The radius is not refitted: F counts from R.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | R | `nominal_radius_mm` | mm |
//! | G | `circular_error` | mm |
//! | D | `mean_radial_deviation` | mm |
//! | H | `hysteresis_1996`, of the edition of 1996; later ones print G(b) in its place | mm |
//!
//! Uncertainties, with u_V of the drift of one reading, u_T and u_D of temperature and expansion of machine and device over
//! R, and u_R, u_M, u_G of a radius, of the mean radius and of a radius against another as the device reads them:
//!
//! ```text
//!   G, G(b):  u² = 2 (u_G² + u_V²)                    difference of two readings      (6)
//!   H:        u² = 2 (u_H² + u_V²) + 4 w² ln n/3      of one place, in both senses    (7)
//!   F:        u² = u_R² + u_V² + u_T² + u_D²                                          (8)
//!   D:        u² = u_M² + (u_V/2)² + u_T² + u_D²                                      (9)
//!   plate:    k² u_R² = 0.867 U₀² + 0.468 · 2 U₀ U₁ R + (U₁ R)²
//!             k² u_M² = 0.037 U₀² + 0.270 · 2 U₀ U₁ R + (U₁ R)²
//!             k² u_G² = 0.830 U₀² + 0.198 · 2 U₀ U₁ R,   u_H = 0                     (10)
//!   ballbar:  u_G = u_H = u_s,   u_M² = u_R² = u_s² + u_L²,   u_L of its calibrated length   (11)
//! ```
//!
//! (10): a plate reads the radius itself. Its certificate states U₀ + U₁ L for a length L from any zero, whose square has
//! three parts, each with its own law along the axis:
//!
//! ```text
//!   (U₀ + U₁ L)² = U₀²             the same for every length: local, waves of lengths λ over the plate
//!                + 2 U₀ U₁ L       variance that grows as the length: steps that add up at random along the axis
//!                + (U₁ L)²         error that grows as the length: the scale
//! ```
//!
//! The centre of the fitted circle takes out of each what looks like a shift, and F does not see it; D sees what looks like a
//! radius, and G neither of them. The scale is a radius. With κ = 2π R/λ, a wave of any direction and phase, by the law of
//! propagation through the least-squares circle:
//!
//! ```text
//!   shift:   ⟨J₀²(κ) + J₂²(κ)⟩ = 0.133,   radius: ⟨J₁²(κ)⟩ = 0.037     of U₀²                (12)
//!   steps W, cov(W(x), W(x′)) = min(|x|, |x′|) on one side of the centre, else 0,
//!   read along both axes, cos θ W_x(R cos θ) + sin θ W_y(R sin θ):
//!            all 8/(3π) = 0.849,   shift 0.381,   radius 0.270           of 2 U₀ U₁ R           (13)
//! ```
//!
//! ⟨ ⟩ is the mean over λ, of which nothing is known but 0 < λ ≤ 2R, so that each is as probable: what is longer is in the
//! other two parts. `tests/validation/coverage_of_circles.py` integrates (12) and (13).
//!
//! (7): a plate is read at the same place in both senses, its error there is in both and leaves their difference. The error of a
//! ballbar belongs to no place: H is the difference of two of its readings, as G is.
//! w is the unrest of a reading at rest from one moment to the next, where it is stated, else 0. H is the greatest of n
//! differences, one for each reading of a sense, and each has √2 w of unrest, which lifts the greatest by no more than
//! √2 w √(2 ln n), the expectation's bound for n normal values; by nothing where one difference stands out. Anything between
//! is as probable, and it is not taken out of H (GUM F.2.4.5): 4 w² ln n/3 about H.
//! (9): drift leaves most of a mean where it has one wave a turn: half of each axis, √2 for both axes, 1/√2 for two
//! turns: u_V/2. (11): a ballbar reads changes of a length that another device calibrated; u_s = U₀/k of one reading.
//!
//! # Holds when
//! Radii are those at 20 °C ([`CircularTest::corrected_to_20_degc`]): (8) and (9) have what is left then.
//! Each recording goes round the full circle. The circles are those of least squares, of unevenly spaced readings by the arc of
//! each; the
//! smallest ring that holds a path can be thinner than G, never thicker.
//!
//! # Agreement
//! Closed form: `eq1_an_ellipse_has_the_difference_of_its_axes`, below 1e-12 mm.
//! Second implementation: `val_iso230_4_scipy`, paths of 300 and 420 points with backlash, play and
//! servo mismatch, below 2e-10 mm. No published example was at hand.
//!
//! # References
//! \[1\] ISO 230-4:2022 and, for H, ISO 230-4:1996; from the literature, the texts were not at hand.
//! \[2\] MTS Ballbar Inspection, "Analyzing your results" (www.mts-nw.com/analyzing.html), minimum and maximum radial deviation.

mod arc;
mod reference_temperature;
mod trace;

use serde::{Deserialize, Serialize};

use super::budget::{DeviceUncertainty, Expansion, combined, drift_mm, rectangular};
use super::extent::{check_not_negative, check_positive, greatest, least, range};
use super::{ExpandedLength, Iso230Error};
use metrology::fit::{CircleFit, fit_round};
use nalgebra::Vector2;
pub use trace::{CircularTrace, LONGEST_GAP_RAD};
use trace::{Polar, polar};

/// Shares of the variance of waves over a plate that a fitted circle takes for a shift and for a radius, (12).
const SHARES_OF_WAVES: [f64; 2] = [0.133, 0.037];
/// Shares of 2 U₀ U₁ R that steps along both axes make of a radial reading: all, a shift, a radius, (13).
const SHARES_OF_STEPS: [f64; 3] = [0.849, 0.381, 0.270];

/// One circular test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CircularTest {
    /// Programmed radius, mm.
    pub nominal_radius_mm: f64,
    /// The path run clockwise, if it was.
    pub clockwise: Option<CircularTrace>,
    /// The path run counter-clockwise, if it was.
    pub counter_clockwise: Option<CircularTrace>,
}

/// What is not known about a circular test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CircularBudget {
    /// The device that reads the deviations; a plate reads the radius with it too.
    pub displacement: DeviceUncertainty,
    /// Calibrated length of a ballbar; none: the displacement device reads the radius itself, (10).
    pub length: Option<DeviceUncertainty>,
    /// Temperature and expansion of the machine.
    pub machine: Expansion,
    /// Temperature and expansion of the device; coefficient 0 for one that does not expand.
    pub device_expansion: Expansion,
    /// Range of the reading with the axes at rest, as long as a test takes, mm.
    pub environmental_drift_mm: f64,
    /// Standard deviation of a reading at rest from one moment to the next, mm; none: nothing for it in U of H.
    #[serde(default)]
    pub environmental_unrest_mm: Option<f64>,
}

/// One sense of rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SenseResult {
    /// Least-squares centre of this sense in the frame of the points, mm.
    pub centre_mm: [f64; 2],
    /// Least-squares radius of this sense, mm.
    pub radius_mm: f64,
    /// G of this sense, (1).
    pub circular_error: ExpandedLength,
    /// F_max, (3).
    pub greatest_radial_deviation: ExpandedLength,
    /// F_min, (3).
    pub least_radial_deviation: ExpandedLength,
}

/// Both senses together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct BothSenses {
    /// Least-squares centre of both in the frame of the points, mm.
    pub centre_mm: [f64; 2],
    /// Least-squares radius, mm.
    pub radius_mm: f64,
    /// G(b), (2).
    pub circular_error: ExpandedLength,
    /// D, (4).
    pub mean_radial_deviation: ExpandedLength,
    /// H of the edition of 1996, (5).
    pub hysteresis_1996: ExpandedLength,
    /// Where H is, from the u axis towards the v axis, rad.
    pub hysteresis_angle_rad: f64,
}

/// One circular test, evaluated.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CircularResult {
    /// R, mm.
    pub nominal_radius_mm: f64,
    /// Clockwise, if recorded.
    pub clockwise: Option<SenseResult>,
    /// Counter-clockwise, if recorded.
    pub counter_clockwise: Option<SenseResult>,
    /// Both together, if both were recorded.
    pub both: Option<BothSenses>,
}

/// Evaluates a circular test.
///
/// # Errors
/// No recording, one that is not a full circle, too few points, numbers that cannot be used.
pub fn evaluate(
    test: &CircularTest,
    budget: &CircularBudget,
) -> Result<CircularResult, Iso230Error> {
    check_positive("nominal_radius_mm", test.nominal_radius_mm)?;
    let points = |trace: &Option<CircularTrace>, place| {
        let points = trace
            .as_ref()
            .map(|t| t.points(test.nominal_radius_mm, place));
        points.transpose()
    };
    let clockwise = points(&test.clockwise, "clockwise")?;
    let counter_clockwise = points(&test.counter_clockwise, "counter_clockwise")?;
    let n_points = |points: &Option<Vec<_>>| points.as_ref().map_or(0, Vec::len);
    let n_readings = n_points(&clockwise).max(n_points(&counter_clockwise));
    let u = budget.standard(test.nominal_radius_mm, n_readings)?;
    let circle = match (&clockwise, &counter_clockwise) {
        (None, None) => return Err(Iso230Error::NoTrace),
        (Some(cw), Some(ccw)) => common_circle(cw, ccw)?,
        (Some(only), None) | (None, Some(only)) => fitted(only)?,
    };
    let frame = Frame {
        nominal_radius_mm: test.nominal_radius_mm,
        circle: &circle,
        u: &u,
    };
    let sense = |points: &Option<Vec<Vector2<f64>>>| {
        let sense = points.as_ref().map(|points| frame.sense(points));
        sense.transpose()
    };
    let both = clockwise.as_ref().zip(counter_clockwise.as_ref());
    Ok(CircularResult {
        nominal_radius_mm: test.nominal_radius_mm,
        clockwise: sense(&clockwise)?,
        counter_clockwise: sense(&counter_clockwise)?,
        both: both.map(|(cw, ccw)| frame.both(cw, ccw)),
    })
}

/// Standard uncertainties of the figures, mm.
struct FigureUncertainties {
    difference_mm: f64,
    of_one_place_mm: f64,
    radial_mm: f64,
    mean_radial_mm: f64,
}

/// What a device makes of radii: standard uncertainties, mm.
struct Read {
    /// u_R.
    radius_mm: f64,
    /// u_M.
    mean_mm: f64,
    /// u_G.
    difference_mm: f64,
    /// u_H.
    of_one_place_mm: f64,
}

impl Read {
    /// (10) of a plate.
    fn by_plate(plate: &DeviceUncertainty, radius_mm: f64) -> Self {
        let local_mm = plate.standard_mm(0.0);
        let scale_mm = plate.standard_mm(radius_mm) - local_mm;
        let (local2, steps2) = (local_mm.powi(2), 2.0 * local_mm * scale_mm);
        let root = |of_local: f64, of_steps: f64, of_scale: f64| {
            (of_local * local2 + of_steps * steps2 + of_scale * scale_mm.powi(2)).sqrt()
        };
        let [local_shift, local_radius] = SHARES_OF_WAVES;
        let [steps, steps_shift, steps_radius] = SHARES_OF_STEPS;
        Self {
            radius_mm: root(1.0 - local_shift, steps - steps_shift, 1.0),
            mean_mm: root(local_radius, steps_radius, 1.0),
            difference_mm: root(
                1.0 - local_shift - local_radius,
                steps - steps_shift - steps_radius,
                0.0,
            ),
            of_one_place_mm: 0.0,
        }
    }

    /// (11) of a ballbar.
    fn by_ballbar(reading_mm: f64, length_mm: f64) -> Self {
        let radius_mm = reading_mm.hypot(length_mm);
        Self {
            radius_mm,
            mean_mm: radius_mm,
            difference_mm: reading_mm,
            of_one_place_mm: reading_mm,
        }
    }
}

impl CircularBudget {
    /// Of a test with at most `n_readings` in a sense.
    fn standard(
        &self,
        radius_mm: f64,
        n_readings: usize,
    ) -> Result<FigureUncertainties, Iso230Error> {
        self.displacement.check()?;
        self.machine.check()?;
        self.device_expansion.check()?;
        check_not_negative("environmental_drift_mm", self.environmental_drift_mm)?;
        let drift_mm = drift_mm(self.environmental_drift_mm);
        let unrest_mm = self.environmental_unrest_mm.unwrap_or(0.0);
        check_not_negative("environmental_unrest_mm", unrest_mm)?;
        let lift_mm = rectangular(2.0 * unrest_mm * (n_readings.max(1) as f64).ln().sqrt());
        let read = match &self.length {
            None => Read::by_plate(&self.displacement, radius_mm),
            Some(length) => {
                length.check()?;
                let reading_mm = self.displacement.standard_mm(0.0);
                Read::by_ballbar(reading_mm, length.standard_mm(radius_mm))
            }
        };
        let expansion_mm = self
            .machine
            .standard_mm(radius_mm)
            .hypot(self.device_expansion.standard_mm(radius_mm));
        Ok(FigureUncertainties {
            difference_mm: (2.0_f64).sqrt() * read.difference_mm.hypot(drift_mm), // (6)
            of_one_place_mm: lift_mm.hypot((2.0_f64).sqrt() * read.of_one_place_mm.hypot(drift_mm)), // (7)
            radial_mm: combined(&[read.radius_mm, drift_mm, expansion_mm]), // (8)
            mean_radial_mm: combined(&[read.mean_mm, drift_mm / 2.0, expansion_mm]), // (9)
        })
    }
}

fn fitted(points_mm: &[Vector2<f64>]) -> Result<CircleFit, Iso230Error> {
    Ok(fit_round(points_mm, &arc::uncertainties(points_mm))?)
}

/// In what every figure is expressed.
struct Frame<'a> {
    nominal_radius_mm: f64,
    /// Least-squares circle of both senses, or of the one that was recorded.
    circle: &'a CircleFit,
    u: &'a FigureUncertainties,
}

impl Frame<'_> {
    fn sense(&self, points_mm: &[Vector2<f64>]) -> Result<SenseResult, Iso230Error> {
        let own = fitted(points_mm)?;
        let radial = || {
            let distances = points_mm.iter().map(|p| (p - self.circle.centre_mm).norm());
            distances.map(|distance| distance - self.nominal_radius_mm) // (3)
        };
        Ok(SenseResult {
            centre_mm: own.centre_mm.into(),
            radius_mm: own.radius_mm,
            circular_error: ExpandedLength::new(own.form_mm, self.u.difference_mm), // (1)
            greatest_radial_deviation: ExpandedLength::new(greatest(radial()), self.u.radial_mm),
            least_radial_deviation: ExpandedLength::new(least(radial()), self.u.radial_mm),
        })
    }

    fn both(
        &self,
        clockwise_mm: &[Vector2<f64>],
        counter_clockwise_mm: &[Vector2<f64>],
    ) -> BothSenses {
        let circle = self.circle;
        let radii = clockwise_mm
            .iter()
            .chain(counter_clockwise_mm)
            .map(|p| (p - circle.centre_mm).norm());
        let cw = polar(clockwise_mm, &circle.centre_mm);
        let ccw = polar(counter_clockwise_mm, &circle.centre_mm);
        let (hysteresis_mm, hysteresis_angle_rad) = hysteresis(&cw, &ccw);
        let mean_radial_mm = circle.radius_mm - self.nominal_radius_mm; // (4)
        let u = self.u;
        BothSenses {
            centre_mm: circle.centre_mm.into(),
            radius_mm: circle.radius_mm,
            circular_error: ExpandedLength::new(range(radii), u.difference_mm), // (2)
            mean_radial_deviation: ExpandedLength::new(mean_radial_mm, u.mean_radial_mm),
            hysteresis_1996: ExpandedLength::new(hysteresis_mm, u.of_one_place_mm),
            hysteresis_angle_rad,
        }
    }
}

/// The circle of both paths, each with the same weight however many points it has.
fn common_circle(
    clockwise_mm: &[Vector2<f64>],
    counter_clockwise_mm: &[Vector2<f64>],
) -> Result<CircleFit, Iso230Error> {
    let all = [clockwise_mm, counter_clockwise_mm];
    let points_mm = all.concat();
    let weights: Vec<f64> = all
        .iter()
        .flat_map(|path| {
            let of_path = (path.len() as f64).sqrt();
            let own = arc::uncertainties(path).into_iter();
            own.map(move |own| of_path * own)
        })
        .collect();
    Ok(fit_round(&points_mm, &weights)?)
}

/// (5) with its angle: looked for at every angle that either recording has.
fn hysteresis(cw: &Polar, ccw: &Polar) -> (f64, f64) {
    let angles = cw.angles_rad().iter().chain(ccw.angles_rad());
    angles.fold((0.0, 0.0), |(most, at), &angle| {
        let apart = (cw.radius_at(angle) - ccw.radius_at(angle)).abs();
        if apart > most {
            (apart, angle)
        } else {
            (most, at)
        }
    })
}
