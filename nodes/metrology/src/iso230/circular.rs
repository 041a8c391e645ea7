//! Circular test of two linear axes (ISO 230-4).
//!
//! # Model
//!
//! Points p_k = (u, v) from the nominal centre, recorded clockwise, counter-clockwise or both;
//! c, r are centre and radius of a least-squares circle:
//!
//! ```text
//!   G (one sense) = max |p_k − c| − min |p_k − c|,   c of that sense                  (1)
//!   G(b) = the same over both senses,   c of both together                           (2)
//!   F_k = |p_k| − R,   F_max = max F_k,   F_min = min F_k,   centre not refitted      (3)
//!   D = r − R,   r of both together                                                  (4)
//!   H = max |ρ_cw(θ) − ρ_ccw(θ)|,   ρ = |p − c| at the angle θ about c of both        (5)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | R | `nominal_radius_mm` | mm |
//! | G | `circular_error` | mm |
//! | D | `mean_radial_deviation` | mm |
//! | H | `hysteresis_1996`, of the edition of 1996; later ones print G(b) in its place | mm |
//!
//! Uncertainties, with u_s of one displacement reading, u_V of its drift, u_R of the length at which
//! the device stands and u_T of temperature and expansion over R:
//!
//! ```text
//!   G, G(b), H:  u² = 2 (u_s² + u_V²)              difference of two readings         (6)
//!   F:           u² = u_s² + u_V² + u_R² + u_T²                                       (7)
//!   D:           u² = u_s² + u_V²/2 + u_R² + u_T²  drift of two recordings            (8)
//! ```
//!
//! # Holds when
//! Each recording goes round the full circle. The circles are those of least squares; the
//! smallest ring that holds a path can be thinner than G, never thicker. The centre in (3) is where
//! the device was set up, so F holds the set-up's eccentricity.
//!
//! # Agreement
//! Closed form: `eq1_an_ellipse_has_the_difference_of_its_axes`, below 1e-12 mm.
//! Second implementation: `val_iso230_4_scipy`, paths of 300 and 420 points with backlash, play and
//! servo mismatch, below 2e-10 mm. No published example was at hand.
//!
//! # References
//! \[1\] ISO 230-4:2022 and, for H, ISO 230-4:1996; from the literature, the texts were not at hand.

mod trace;

use serde::{Deserialize, Serialize};

use super::budget::{DeviceUncertainty, Expansion, combined, drift_mm};
use super::extent::{check_not_negative, check_positive, greatest, least, range};
use super::{ExpandedLength, Iso230Error};
use crate::fit::{CircleFit, fit_round};
use nalgebra::Vector2;
pub use trace::{CircularTrace, LONGEST_GAP_RAD};
use trace::{Polar, polar};

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
    /// Displacement within the range of the deviations.
    pub displacement: DeviceUncertainty,
    /// Calibrated length of the device.
    pub length: DeviceUncertainty,
    /// Temperature and expansion of machine and device against each other.
    pub expansion: Expansion,
    /// Range of the reading with the axes at rest, as long as a recording takes, mm.
    pub environmental_drift_mm: f64,
}

/// One sense of rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SenseResult {
    /// Least-squares centre from the nominal one, mm.
    pub centre_mm: [f64; 2],
    /// Least-squares radius, mm.
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
    /// Least-squares centre from the nominal one, mm.
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
    let u = budget.standard(test.nominal_radius_mm)?;
    let points = |trace: &Option<CircularTrace>, place| {
        let points = trace
            .as_ref()
            .map(|t| t.points(test.nominal_radius_mm, place));
        points.transpose()
    };
    let clockwise = points(&test.clockwise, "clockwise")?;
    let counter_clockwise = points(&test.counter_clockwise, "counter_clockwise")?;
    let sense = |points: &Option<Vec<Vector2<f64>>>| {
        let sense = points
            .as_ref()
            .map(|p| sense(p, test.nominal_radius_mm, &u));
        sense.transpose()
    };
    let both = match (&clockwise, &counter_clockwise) {
        (None, None) => return Err(Iso230Error::NoTrace),
        (Some(cw), Some(ccw)) => Some(both(cw, ccw, test.nominal_radius_mm, &u)?),
        _ => None,
    };
    Ok(CircularResult {
        nominal_radius_mm: test.nominal_radius_mm,
        clockwise: sense(&clockwise)?,
        counter_clockwise: sense(&counter_clockwise)?,
        both,
    })
}

/// Standard uncertainties of the figures, mm.
struct FigureUncertainties {
    difference_mm: f64,
    radial_mm: f64,
    mean_radial_mm: f64,
}

impl CircularBudget {
    fn standard(&self, radius_mm: f64) -> Result<FigureUncertainties, Iso230Error> {
        self.displacement.check()?;
        self.length.check()?;
        self.expansion.check()?;
        check_not_negative("environmental_drift_mm", self.environmental_drift_mm)?;
        let reading_mm = self.displacement.standard_mm(0.0);
        let drift_mm = drift_mm(self.environmental_drift_mm);
        let scale_mm = self
            .length
            .standard_mm(radius_mm)
            .hypot(self.expansion.standard_mm(radius_mm));
        Ok(FigureUncertainties {
            difference_mm: (2.0_f64).sqrt() * reading_mm.hypot(drift_mm), // (6)
            radial_mm: combined(&[reading_mm, drift_mm, scale_mm]),       // (7)
            mean_radial_mm: combined(&[reading_mm, drift_mm / 2.0_f64.sqrt(), scale_mm]), // (8)
        })
    }
}

fn fitted(points_mm: &[Vector2<f64>]) -> Result<CircleFit, Iso230Error> {
    // One weight for all: the circle does not depend on its size.
    Ok(fit_round(points_mm, &vec![1.0; points_mm.len()])?)
}

fn sense(
    points_mm: &[Vector2<f64>],
    nominal_radius_mm: f64,
    u: &FigureUncertainties,
) -> Result<SenseResult, Iso230Error> {
    let circle = fitted(points_mm)?;
    let radial = || points_mm.iter().map(|p| p.norm() - nominal_radius_mm); // (3)
    Ok(SenseResult {
        centre_mm: circle.centre_mm.into(),
        radius_mm: circle.radius_mm,
        circular_error: ExpandedLength::new(circle.form_mm, u.difference_mm), // (1)
        greatest_radial_deviation: ExpandedLength::new(greatest(radial()), u.radial_mm),
        least_radial_deviation: ExpandedLength::new(least(radial()), u.radial_mm),
    })
}

fn both(
    clockwise_mm: &[Vector2<f64>],
    counter_clockwise_mm: &[Vector2<f64>],
    nominal_radius_mm: f64,
    u: &FigureUncertainties,
) -> Result<BothSenses, Iso230Error> {
    let circle = common_circle(clockwise_mm, counter_clockwise_mm)?;
    let radii = clockwise_mm
        .iter()
        .chain(counter_clockwise_mm)
        .map(|p| (p - circle.centre_mm).norm());
    let cw = polar(clockwise_mm, &circle.centre_mm);
    let ccw = polar(counter_clockwise_mm, &circle.centre_mm);
    let (hysteresis_mm, hysteresis_angle_rad) = hysteresis(&cw, &ccw);
    let mean_radial_mm = circle.radius_mm - nominal_radius_mm; // (4)
    Ok(BothSenses {
        centre_mm: circle.centre_mm.into(),
        radius_mm: circle.radius_mm,
        circular_error: ExpandedLength::new(range(radii), u.difference_mm), // (2)
        mean_radial_deviation: ExpandedLength::new(mean_radial_mm, u.mean_radial_mm),
        hysteresis_1996: ExpandedLength::new(hysteresis_mm, u.difference_mm),
        hysteresis_angle_rad,
    })
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
        .flat_map(|path| vec![(path.len() as f64).sqrt(); path.len()])
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
