//! What the errors of an instrument make of the rows of a breakdown.
//!
//! # Model
//!
//! A row is β = Z y with Z = (XᵀWX)⁻¹XᵀW of the fit. An error e(θ) that the instrument adds to the radial deviations moves it by
//! Z e, whatever the row is. The scatter of the fit does not show it, for every turn has the same e:
//!
//! ```text
//!   cov(β) += Σ_m (Z e_m)(Z e_m)ᵀ          e_m the independent errors, each of one standard uncertainty     (1)
//! ```
//!
//! A plate reads (x, y) from its zero, the error (e_x, e_y) of a place being the same in every turn:
//! e = e_x cos θ + e_y sin θ. Its independent errors, with U₀, U₁ and k of its certificate:
//!
//! ```text
//!   squareness κ   (e_x, e_y) = κ/2 (y, x)          e = (κ R/2) sin 2θ: E_C0Y moves by κ, sensitivity 1       (2)
//!   scale, common  (e_x, e_y) = ε (x, y)            e = ε R: the radial expansion m moves by ε,  u(ε) = U₁/k   (3)
//!   scale, unlike  (e_x, e_y) = δ/2 (x, −y)         e = (δ R/2) cos 2θ: the mismatch q moves by δ,
//!                                                   sensitivity 1,  u(δ) = √2 U₁/k                           (4)
//!   waves          (e_x, e_y) = a cos(2π n·(x, y)/λ + φ)   of any direction n, phase φ and 0 < λ ≤ 2R,
//!                                                   variance (U₀/k)² of either component                     (5)
//!   steps          e_x = W(x), e_y = W(y)           on either side of the zero, variance 2 U₀ U₁ |x|/k²        (6)
//! ```
//!
//! (5) and (6) are those of (12) and (13) of [`crate::circular`]. Of (5), the Fourier coefficient of order n ≥ 1 has the variance
//! (U₀/k)² ⟨J²ₙ₋₁(κ) + J²ₙ₊₁(κ)⟩, κ = 2πR/λ. Order 2 of it is 0.117 (U₀/k)², so that both senses of one circle give
//!
//! ```text
//!   u(E_C0Y) = (2/R) √(0.117) U₀/k, and (2) beside it in quadrature                                      (7)
//! ```
//!
//! (3) and (4): whether the scales of both axes of the plate are wrong together is not stated. m takes it that they are and q
//! that they are not, so that neither is too narrow.
//!
//! A ballbar reads the radius alone. Its certificate states U₀ of a reading and nothing of how its error runs along the circle,
//! which also depends on how its cups and balls lie. Of any curve of order n, e = √2 u_s cos(nθ + φ) with u_s = U₀/k and any
//! phase, a row moves by no more than that of the order to which it responds most:
//!
//! ```text
//!   u²(β) = u_s² max over n ≤ 12 of  (Z cos nθ)² + (Z sin nθ)²                                        (8)
//! ```
//!
//! the greatest of three: the curve is the same in all turns, the reverse in the other sense, or new in every turn. A curve of
//! several orders has less, for their variances add up to u_s². Above twelve per turn a wave is a tone, which is looked for.
//! Of E_C0Y the greatest is order 2: sin 2θ has the coefficient u_s, and u(E_C0Y) = 2 u_s/R. A sine of order 2 within the limits
//! ± U₀ stays within U.
//!
//! Drift of a reading at rest, u_V of one reading, is new in every turn and of either axis: waves of ½ to 3 per turn, each as
//! probable as the others, by (1).
//!
//! # Holds when
//! The plate is zeroed at one place of it, as the procedure asks: then circles under several zeros have one and the same error,
//! which is no less than if they had errors of their own. Errors of temperature are not in it.
//!
//! # Agreement
//! By hand and numpy: `tests/it/breakdown/instrument.rs`. Intervals of machines whose plates and ballbars are drawn otherwise:
//! `tests/it/breakdown/coverage.rs`.
//!
//! # References
//! \[1\] JCGM 100:2008 (GUM), 5.2.2: what several quantities have in common correlates them.

use std::f64::consts::{PI, SQRT_2};

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use super::error::BreakdownError;
use super::robust::Fit;
use super::scene::{Point, Scene};
use crate::budget::DeviceUncertainty;

/// Parts of a turn over which an error of the instrument does not change.
const PARTS: usize = 360;
/// Wavelengths of (5), in the middle of equal parts of 0 to 2R.
const LENGTHS: usize = 6;
/// Directions of (5) over half a turn.
const DIRECTIONS: usize = 8;
/// Steps of (6) on either side of the zero.
const PLATE_STEPS: usize = 16;
/// Highest order of (8).
const HIGHEST_ORDER: u32 = 12;
/// Waves of drift: ½, 1, … per turn.
const DRIFTS: usize = 6;

/// What read a circle, and how well.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Instrument {
    /// The plate of a grid encoder, both coordinates.
    Plate {
        /// Certificate of a length along an axis from any zero.
        certificate: DeviceUncertainty,
        /// Standard uncertainty of the angle between its axes, rad.
        squareness_rad: f64,
        /// Standard uncertainty of one reading by drift, mm.
        drift_mm: f64,
    },
    /// A ballbar, the radius alone.
    Ballbar {
        /// Standard uncertainty of one reading, mm.
        reading_mm: f64,
        /// Standard uncertainty of one reading by drift, mm.
        drift_mm: f64,
    },
}

impl Instrument {
    /// Refuses uncertainties below zero and values without a number.
    pub(super) fn check(&self, recording: usize) -> Result<(), BreakdownError> {
        let named = match *self {
            Self::Plate {
                certificate,
                squareness_rad,
                drift_mm,
            } => [
                ("certificate_mm", certificate.standard_mm(0.0)),
                ("certificate_mm", certificate.standard_mm(1.0)),
                ("squareness_rad", squareness_rad),
                ("drift_mm", drift_mm),
            ],
            Self::Ballbar {
                reading_mm,
                drift_mm,
            } => [
                ("reading_mm", reading_mm),
                ("drift_mm", drift_mm),
                ("drift_mm", drift_mm),
                ("drift_mm", drift_mm),
            ],
        };
        for (quantity, value) in named {
            if !(value.is_finite() && value >= 0.0) {
                return Err(BreakdownError::Negative {
                    recording,
                    quantity,
                    value,
                });
            }
        }
        Ok(())
    }

    const fn drift_mm(&self) -> f64 {
        match self {
            Self::Plate { drift_mm, .. } | Self::Ballbar { drift_mm, .. } => *drift_mm,
        }
    }
}

/// A part of a turn.
struct Part {
    /// Which trace.
    trace: usize,
    direction: [f64; 2],
    angle_rad: f64,
    /// Place on the plate from its zero, mm.
    place_mm: [f64; 2],
    /// Share of the turn before it.
    turned: f64,
}

/// Z of the header, summed over the samples of each part.
struct Response<'a> {
    instruments: Vec<Instrument>,
    parts: Vec<Part>,
    z: DMatrix<f64>,
    scene: &'a Scene,
}

/// What the instruments add to the covariance of the parameters of a fit, (1) and (8); zero without instruments.
pub(super) fn covariance(scene: &Scene, fit: &Fit, instruments: &[Instrument]) -> DMatrix<f64> {
    let n = fit.parameters.len();
    let of_traces: Option<Vec<Instrument>> = (scene.traces.iter())
        .map(|trace| instruments.get(trace.recording).copied())
        .collect();
    let Some(of_traces) = of_traces else {
        return DMatrix::zeros(n, n);
    };
    let (parts, moments) = parts(scene, fit);
    let response = Response {
        instruments: of_traces,
        parts,
        z: &fit.inverse * moments,
        scene,
    };
    let mut all = DMatrix::zeros(n, n);
    response.of_plate(&mut all);
    response.of_drift(&mut all);
    response.of_ballbar(&mut all);
    all
}

/// The parts of all turns, and XᵀW summed over each.
fn parts(scene: &Scene, fit: &Fit) -> (Vec<Part>, DMatrix<f64>) {
    let mut zeros_mm: Vec<Option<[f64; 2]>> = vec![None; scene.n_zeros];
    let mut parts = Vec::new();
    let mut moments: Vec<f64> = Vec::new();
    for (number, trace) in scene.traces.iter().enumerate() {
        let zero_mm = *zeros_mm[trace.zero].get_or_insert(trace.circle.centre_mm);
        let n = trace.points.len();
        let size = n.div_ceil(PARTS).max(1);
        for begin in (0..n).step_by(size) {
            let end = (begin + size).min(n);
            let point: &Point = &trace.points[usize::midpoint(begin, end - 1)];
            parts.push(Part {
                trace: number,
                direction: point.direction,
                angle_rad: point.angle_rad,
                place_mm: [0, 1].map(|a| point.position_mm[a] - zero_mm[a]),
                turned: (begin + end) as f64 / (2 * n) as f64,
            });
            moments.extend(fit.columns.iter().map(|column| {
                let of = |place: usize| {
                    let row = trace.first_row + place;
                    fit.weights[row] * trace.root(place) * column.at(row)
                };
                (begin..end).map(of).sum::<f64>()
            }));
        }
    }
    let moments = DMatrix::from_vec(fit.columns.len(), parts.len(), moments);
    (parts, moments)
}

impl Response<'_> {
    /// Adds one error of (1), by what it is at a part.
    fn add(&self, all: &mut DMatrix<f64>, error_mm: impl Fn(&Part) -> f64) {
        let errors = self.parts.iter().map(error_mm);
        let errors = DVector::from_iterator(self.parts.len(), errors);
        if errors.iter().any(|error| error.abs() > 0.0) {
            let moved = &self.z * errors;
            *all += &moved * moved.transpose();
        }
    }

    /// Certificate and squareness where a plate read.
    fn plate(&self, part: &Part) -> Option<(DeviceUncertainty, f64)> {
        match self.instruments[part.trace] {
            Instrument::Plate {
                certificate,
                squareness_rad,
                ..
            } => Some((certificate, squareness_rad)),
            Instrument::Ballbar { .. } => None,
        }
    }

    /// Adds one error of a plate: along its axes at a place, times what `size` takes from the certificate.
    fn add_of_plate(
        &self,
        all: &mut DMatrix<f64>,
        size: impl Fn(&DeviceUncertainty, f64) -> f64,
        error: impl Fn([f64; 2]) -> [f64; 2],
    ) {
        self.add(all, |part| {
            self.plate(part).map_or(0.0, |(certificate, squareness)| {
                let [e_x, e_y] = error(part.place_mm);
                let radial = e_x * part.direction[0] + e_y * part.direction[1];
                size(&certificate, squareness) * radial
            })
        });
    }

    /// (2) to (6).
    fn of_plate(&self, all: &mut DMatrix<f64>) {
        let local_mm = |c: &DeviceUncertainty, _: f64| c.standard_mm(0.0);
        let scale = |c: &DeviceUncertainty, _: f64| c.standard_mm(1.0) - c.standard_mm(0.0);
        self.add_of_plate(all, |_, squareness| squareness, |[x, y]| [0.5 * y, 0.5 * x]);
        self.add_of_plate(all, scale, |place_mm| place_mm);
        let unlike = |c: &DeviceUncertainty, s: f64| SQRT_2 * scale(c, s);
        self.add_of_plate(all, unlike, |[x, y]| [0.5 * x, -0.5 * y]);
        let share = (1.0 / (LENGTHS * DIRECTIONS) as f64).sqrt();
        for (length, direction) in pairs(LENGTHS, DIRECTIONS) {
            let wave_mm =
                2.0 * self.scene.largest_radius_mm * (length as f64 + 0.5) / LENGTHS as f64;
            let (sin, cos) = (PI * direction as f64 / DIRECTIONS as f64).sin_cos();
            let argument = |[x, y]: [f64; 2]| 2.0 * PI * (x * cos + y * sin) / wave_mm;
            self.add_of_plate(all, local_mm, |at| [share * argument(at).cos(), 0.0]);
            self.add_of_plate(all, local_mm, |at| [share * argument(at).sin(), 0.0]);
            self.add_of_plate(all, local_mm, |at| [0.0, share * argument(at).cos()]);
            self.add_of_plate(all, local_mm, |at| [0.0, share * argument(at).sin()]);
        }
        let places = self.parts.iter().flat_map(|part| part.place_mm);
        let reach_mm = places.fold(0.0, |reach: f64, place| reach.max(place.abs()));
        let step_mm = reach_mm / PLATE_STEPS as f64;
        let steps =
            |c: &DeviceUncertainty, s: f64| (2.0 * local_mm(c, s) * scale(c, s) * step_mm).sqrt();
        for (step, side) in pairs(PLATE_STEPS, 2) {
            let from_mm = step_mm * (step as f64 + 0.5);
            let sign = if side == 0 { 1.0 } else { -1.0 };
            let beyond = |place_mm: f64| f64::from(u8::from(sign * place_mm > from_mm));
            self.add_of_plate(all, steps, |[x, _]| [beyond(x), 0.0]);
            self.add_of_plate(all, steps, |[_, y]| [0.0, beyond(y)]);
        }
    }

    /// Drift of every turn, along either axis.
    fn of_drift(&self, all: &mut DMatrix<f64>) {
        let share = (1.0 / DRIFTS as f64).sqrt();
        for (trace, instrument) in self.instruments.iter().enumerate() {
            for (wave, axis) in pairs(DRIFTS, 2) {
                for quarter in [0.0, 0.25] {
                    self.add(all, |part| {
                        if part.trace != trace {
                            return 0.0;
                        }
                        let turns = 0.5 * (wave + 1) as f64 * part.turned + quarter;
                        share
                            * instrument.drift_mm()
                            * (2.0 * PI * turns).sin()
                            * part.direction[axis]
                    });
                }
            }
        }
    }

    /// (8)
    fn of_ballbar(&self, all: &mut DMatrix<f64>) {
        for row in 0..self.z.nrows() {
            let orders = (0..=HIGHEST_ORDER).map(|order| self.to_order(row, f64::from(order)));
            all[(row, row)] += orders.fold(0.0, f64::max);
        }
    }

    /// What a row makes of the readings of ballbars by curves of one order: the greatest square of (8).
    fn to_order(&self, row: usize, order: f64) -> f64 {
        let mut turns = vec![[0.0; 2]; self.instruments.len()];
        let of_row = self.z.row(row);
        for (part, z) in self.parts.iter().zip(of_row.iter()) {
            if let Instrument::Ballbar { reading_mm, .. } = self.instruments[part.trace] {
                let (sin, cos) = (order * part.angle_rad).sin_cos();
                turns[part.trace][0] += z * reading_mm * cos;
                turns[part.trace][1] += z * reading_mm * sin;
            }
        }
        let square = |[cos, sin]: [f64; 2]| cos * cos + sin * sin;
        let (mut same, mut reversed, mut new) = ([0.0; 2], [0.0; 2], 0.0);
        for (turn, trace) in turns.iter().zip(&self.scene.traces) {
            for (k, own) in turn.iter().enumerate() {
                same[k] += own;
                reversed[k] += trace.sense * own;
            }
            new += square(*turn);
        }
        square(same).max(square(reversed)).max(new)
    }
}

/// Every pair of two counts.
fn pairs(first: usize, second: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..first).flat_map(move |a| (0..second).map(move |b| (a, b)))
}
