//! Thermal drift between tool and workpiece over a test of hours (ISO 230-3).
//!
//! # Model
//!
//! Displacements x(t) from t₀ on, at one height or two per axis; heights are counted along Z:
//!
//! ```text
//!   d_t = x(t₀ + t) − x(t₀)                                                           (1)
//!   range = max x − min x over the whole test                                         (2)
//!   rate = slope of the line through the last τ of the test                           (3)
//!   B(t) = [x₂(t) − x₁(t)]/(h₂ − h₁),   A(t) = −[y₂(t) − y₁(t)]/(h₂ − h₁)              (4)
//! ```
//!
//! The minus in (4) is the right-hand rule: turning by +A moves what is above towards −Y.
//! In a test of environmental temperature variation (2) is ETVE of the channel. (1) to (3) are
//! taken of the angles too.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | t, τ | `drift_after_s`, `rate_window_s` | s |
//! | l, α, a_α, Δθ, θ, a_θ | [`Artefact`], [`ArtefactTemperature`] | mm, 1/K, K, °C |
//! | h | `height_mm` | mm |
//! | s | `reading_scatter_mm`, by (7) [`scatter_mm`] | mm |
//!
//! Uncertainties, with U₀, U₁ and k of the instrument's certificate, s of the scatter of one reading, and an artefact of
//! length l, coefficient α within ± a_α, and a temperature that stays within a range Δθ: it may grow or shrink by up to
//! a_l = (α + a_α) l Δθ. d_t and range are differences of two readings: the constant part of the certificate and the scatter
//! enter twice, the part that grows with the length once, for the length d between the readings:
//!
//! ```text
//!   d_t, range:  u² = [2 U₀² + (U₁ d)²]/k² + 2 s² + a_l²/3                             (5)
//!   an angle:    u² = 4 (U₀²/k² + s²)/(h₂ − h₁)²
//!   rate v:      u² = s²/Σ(t − t̄)² + [g² U₀² + (U₁ v τ)²]/(k τ)² + a_l²/(3 T²)         (6)
//!   s² = mean of e_i²/(1 + w_i² + (1 − w_i)²),   e_i = x_i − [w_i x_{i−1} + (1 − w_i) x_{i+1}],
//!        w_i = (t_{i+1} − t_i)/(t_{i+1} − t_{i−1})                                    (7)
//! ```
//!
//! The first part of (6) is that of the slope of a line by the scatter of its readings; that the drift bends about the line is no
//! error of its slope. The second is the certificate's: its constant part is the standard deviation √½ a of a curve over the
//! displacement, a sin(2π x/λ + φ), which goes along with the drift and is in no residual. While x runs through v τ, the slope
//! of the least-squares line takes of it
//!
//! ```text
//!   τ × slope = a cos φ · 6 j₁(K),   K = π v τ/λ,   j₁(K) = (sin K − K cos K)/K²                 (8)
//!   g = 6 j₁(K) up to its greatest, 2.617 at K = 2.082; beyond, at most that and 6 √(1 + 1/K²)/K
//! ```
//!
//! so that its standard deviation over all φ is g U₀/(k τ). λ is that of the data sheet, `sensor_error_period_mm`. Where it is
//! not stated, g² = 2: the first and the last reading of the window have errors of their own. That is too much by far where the
//! window's travel is a small part of λ, and too little by up to 1.85 where it is 0.66 of λ. The third part is the growth of the
//! artefact in the last τ of the test of length T: a body that follows the shop or warms up slows down towards the end,
//! so that at most τ/T of its whole growth is left for the window. (7) takes each reading against the
//! straight line between its neighbours, whose three variances add to the denominator: a drift that bends between
//! neighbours makes s greater, never smaller.
//!
//! Where thermometers read the artefact, each θ_i is off by a constant and by at most ± a_θ. Its growth is taken out of the
//! displacement X that the instrument read, before (1) to (3). The sign is that of growth in the displacement:
//!
//! ```text
//!   x_i = X_i ∓ α l (θ_i − θ₀)                                                        (9)
//!   d_t, range:  u² = [2 U₀² + (U₁ D)²]/k² + 2 s² + [2 (α l a_θ)² + (l Δθ a_α)²]/3     (10)
//!   rate v:      u² = s²/Σ(t − t̄)² + [g² U₀² + (U₁ V τ)²]/(k τ)²
//!                     + [2 (α l a_θ/τ)² + (l θ' a_α)²]/3                              (11)
//!   U = k u,  k of the normal part u_n (certificate, scatter) and of the limits behind it: (7) of the budget     (12)
//!   U = 2 u_n + a_l, of the rate 2 u_n + a_l/T, where a range alone is known;  k = U/u                (13)
//! ```
//!
//! D and V are d and v of X, and s is of X as well: the instrument's error goes by what it read. Δθ lies between the two
//! instants of the figure: 0 and t, or the extremes. θ' is the slope of θ over the window by the line of (3). (13)
//! is a bound, with k from 2 to √7: a body that warms throughout has grown by all of a_l at the end, and (12) would take it for
//! anywhere within. Without an artefact k is 2.
//!
//! # Holds when
//! What is sampled is slow beside the samples: between two of them (1) takes a straight line. (8) takes the drift in the window
//! as straight. The growth of the artefact is one for both heights and leaves the angle. An artefact that warms up in steps
//! during the test can grow by more than τ/T in the last τ of (6). (10) and (11) take an error of the temperature that has
//! changed between the two instants, or over the window: one that wanders within 20 to 60 min. A slower one makes U too wide.
//!
//! # Agreement
//! Closed form: `val_iso230_3_an_exponential_drift_has_its_closed_form`, d and range below 1e-15 mm,
//! the rate of 361 samples to 2.5e-4 of that of a continuous recording. No published example was at
//! hand.
//!
//! (5) by hand: `eq5_certificate_scatter_and_artefact_by_hand`; (7): `eq7_scatter_of_noise_on_a_line_by_hand`, and numpy on a
//! table (`val_a_warm_up_logged_once_is_evaluated_by_iso_230_3`). (8): `eq8_the_slope_of_a_wave_is_that_of_sampled_lines`.
//! (9): `eq9_growth_that_was_read_is_taken_out`; (10) to (12): `eq10_eq11_eq12_of_a_read_artefact_by_hand`; (13):
//! `eq13_k_of_a_bound_by_hand`. How often U holds: `iso230_3_u_holds_the_drift_beside_a_mandrel_that_is_read`.
//!
//! # References
//! \[1\] ISO 230-3:2020; from the literature, the text was not at hand. \[2\] JCGM 100:2008 (GUM), 4.2, 4.3 and 5.1.

mod artefact;
mod height;
mod wave;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::budget::{DeviceUncertainty, combined};
use super::error::ChannelFault;
use super::extent::{
    check_ascending, check_finite, check_length, check_not_negative, check_points, check_positive,
    range,
};
use super::{ExpandedAngle, ExpandedAngularRate, ExpandedLength, ExpandedRate, Iso230Error};
use artefact::Left;
pub use artefact::{Artefact, ArtefactTemperature, GrowthReads};
pub use height::{height_name, height_of};
use metrology::Axis;
use metrology::fit::fit_line;
use wave::wave_in_slope;

/// Samples without which a rate has no uncertainty.
const MIN_SAMPLES_OF_RATE: usize = 3;

/// What made the machine drift.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DriftCause {
    /// The surroundings alone.
    Environment,
    /// The turning spindle.
    Spindle,
    /// A linear axis that moves to and fro.
    LinearAxis,
    /// A rotary component that turns.
    RotaryAxis,
    /// Several of these at once, or unknown.
    NotStated,
}

/// Displacements at one place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriftChannel {
    /// Along which axis.
    pub axis: Axis,
    /// Height above any common level, along Z, mm.
    pub height_mm: f64,
    /// Displacements of the tool side relative to the workpiece side at the test's times, mm.
    pub displacements_mm: Vec<f64>,
}

/// One test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriftTest {
    /// What made the machine drift.
    pub cause: DriftCause,
    /// Times of the samples, ascending, s.
    pub times_s: Vec<f64>,
    /// Each sensor.
    pub channels: Vec<DriftChannel>,
    /// Time after which the drift is read, s; 3600 is usual.
    pub drift_after_s: f64,
    /// Length of the window at the end over which the rate is taken, s; 3600 is usual.
    pub rate_window_s: f64,
    /// Longest pause between samples that still counts as a recording, s.
    pub longest_gap_s: f64,
}

/// What is not known about a drift test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriftBudget {
    /// Certificate of the instrument that reads the displacements.
    pub sensor: DeviceUncertainty,
    /// Standard deviation of one reading by scatter, which a certificate does not hold; [`scatter_mm`] finds it in a log, mm.
    pub reading_scatter_mm: f64,
    /// Period over which the instrument's error repeats along the displacement, λ of (8), mm; none: it is not stated.
    #[serde(default)]
    pub sensor_error_period_mm: Option<f64>,
    /// The artefact, as far as its growth is in the displacements; none: it is not, or it counts as drift.
    #[serde(default)]
    pub artefact: Option<Artefact>,
}

/// Drift of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DisplacementDrift {
    /// Along which axis.
    pub axis: Axis,
    /// At which height, mm.
    pub height_mm: f64,
    /// d_t, (1).
    pub drift_after: ExpandedLength,
    /// k of U of d_t, (12) or (13).
    pub drift_after_coverage_factor: f64,
    /// (2): ETVE where the surroundings are the cause.
    pub range: ExpandedLength,
    /// k of U of the range, (12) or (13).
    pub range_coverage_factor: f64,
    /// (3).
    pub final_rate: ExpandedRate,
    /// k of U of the rate, (12) or (13).
    pub final_rate_coverage_factor: f64,
    /// What the uncertainty of the range consists of.
    pub contributions: DriftContributions,
}

/// Standard uncertainties of a difference of two readings, each of one cause: the parts of (5), mm.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DriftContributions {
    /// Certificate of the instrument.
    pub certificate_mm: f64,
    /// Scatter of the two readings.
    pub scatter_mm: f64,
    /// Growth of the artefact.
    pub artefact_mm: f64,
}

impl DriftContributions {
    /// Of two readings, with what the growth of the artefact leaves.
    fn new(budget: &DriftBudget, between: &Between, left_mm: &Left) -> Self {
        let constant_mm = budget.sensor.standard_mm(0.0);
        let by_length_mm = budget.sensor.standard_mm(between.read_mm) - constant_mm;
        Self {
            certificate_mm: (2.0 * constant_mm.powi(2) + by_length_mm.powi(2)).sqrt(),
            scatter_mm: 2.0_f64.sqrt() * budget.reading_scatter_mm,
            artefact_mm: left_mm.standard(),
        }
    }

    /// Combined standard uncertainty (5), mm.
    #[must_use]
    pub fn combined_mm(&self) -> f64 {
        combined(&[self.certificate_mm, self.scatter_mm, self.artefact_mm])
    }
}

/// Two readings.
struct Between {
    /// What they differ by without the growth of the artefact, mm.
    value_mm: f64,
    /// What the instrument read of that, mm.
    read_mm: f64,
    /// What the temperature of the artefact changed by, where it was read, K.
    change_k: f64,
}

impl Between {
    /// The difference with its U and k, and the parts of its uncertainty.
    fn expanded(&self, budget: &DriftBudget) -> (ExpandedLength, f64, DriftContributions) {
        let artefact = budget.artefact.as_ref();
        let left_mm = artefact.map(|it| it.left_mm(self.change_k));
        let left_mm = left_mm.unwrap_or_default();
        let parts = DriftContributions::new(budget, self, &left_mm);
        let k = left_mm.coverage_factor(parts.certificate_mm.hypot(parts.scatter_mm)); // (12), (13)
        let figure = ExpandedLength {
            value_mm: self.value_mm,
            expanded_uncertainty_mm: k * parts.combined_mm(), // (5), (10)
        };
        (figure, k, parts)
    }
}

/// Drift of an angle between two heights.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct AngularDrift {
    /// About which axis: A or B.
    pub axis: Axis,
    /// Lower and upper height, mm.
    pub heights_mm: [f64; 2],
    /// (1) of the angle.
    pub drift_after: ExpandedAngle,
    /// (2) of the angle.
    pub range: ExpandedAngle,
    /// (3) of the angle.
    pub final_rate: ExpandedAngularRate,
}

/// One test, evaluated.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriftResult {
    /// What made the machine drift.
    pub cause: DriftCause,
    /// Length of the test, s.
    pub duration_s: f64,
    /// t of (1), s.
    pub drift_after_s: f64,
    /// Each channel.
    pub displacements: Vec<DisplacementDrift>,
    /// Each axis with two heights.
    pub angles: Vec<AngularDrift>,
}

/// Evaluates a drift test.
///
/// # Errors
/// Times that do not ascend, pauses, a test shorter than what is asked of it, lists that do not fit
/// together, channels that make no angle, numbers that cannot be used.
pub fn evaluate(test: &DriftTest, budget: &DriftBudget) -> Result<DriftResult, Iso230Error> {
    test.check()?;
    budget.check(test.times_s.len())?;
    let displacements = test
        .channels
        .iter()
        .map(|channel| displacement(test, channel, budget))
        .collect::<Result<_, Iso230Error>>()?;
    let angles = [Axis::X, Axis::Y]
        .into_iter()
        .filter_map(|axis| angle(test, axis, budget).transpose())
        .collect::<Result<_, _>>()?;
    Ok(DriftResult {
        cause: test.cause,
        duration_s: test.duration_s(),
        drift_after_s: test.drift_after_s,
        displacements,
        angles,
    })
}

/// Standard deviation of one reading by scatter (7), mm, of displacements at ascending times (s).
///
/// # Errors
/// Fewer than three readings, lists that do not fit together, numbers that cannot be used.
pub fn scatter_mm(times_s: &[f64], displacements_mm: &[f64]) -> Result<f64, Iso230Error> {
    check_points("times_s", times_s.len(), MIN_SAMPLES_OF_RATE)?;
    check_length("displacements_mm", 0, displacements_mm.len(), times_s.len())?;
    check_finite("times_s", 0, times_s)?;
    check_finite("displacements_mm", 0, displacements_mm)?;
    check_ascending("times_s", times_s)?;
    let (mut sum_mm2, mut n) = (0.0, 0.0);
    for (t, x) in times_s.windows(3).zip(displacements_mm.windows(3)) {
        let w = (t[2] - t[1]) / (t[2] - t[0]);
        let apart_mm = x[1] - (w * x[0] + (1.0 - w) * x[2]);
        sum_mm2 += apart_mm.powi(2) / (1.0 + w * w + (1.0 - w).powi(2)); // (7)
        n += 1.0;
    }
    Ok((sum_mm2 / n).sqrt())
}

/// The drift of one channel.
fn displacement(
    test: &DriftTest,
    channel: &DriftChannel,
    budget: &DriftBudget,
) -> Result<DisplacementDrift, Iso230Error> {
    let read_mm = &channel.displacements_mm;
    let artefact = budget.artefact.as_ref();
    let without_growth_mm = artefact.map(|it| it.without_growth_mm(read_mm)); // (9)
    let values_mm = without_growth_mm.as_ref().unwrap_or(read_mm);
    let degc = artefact.and_then(Artefact::degc);
    let between = |of: &dyn Fn(&[f64]) -> f64| Between {
        value_mm: of(values_mm),
        read_mm: of(read_mm),
        change_k: degc.map_or(0.0, of),
    };
    let after = between(&|values| test.drift(values));
    let (drift_after, drift_after_coverage_factor, _) = after.expanded(budget);
    let [least, greatest] = extremes(values_mm);
    let whole = between(&|values| values[greatest] - values[least]);
    let (range, range_coverage_factor, contributions) = whole.expanded(budget);
    let (final_rate, final_rate_coverage_factor) = rate(test, [values_mm, read_mm], budget)?;
    Ok(DisplacementDrift {
        axis: channel.axis,
        height_mm: channel.height_mm,
        drift_after,
        drift_after_coverage_factor,
        range,
        range_coverage_factor,
        final_rate,
        final_rate_coverage_factor,
        contributions,
    })
}

/// (3) of displacements without growth and as they were read, with U by (6) or (11), and k.
fn rate(
    test: &DriftTest,
    [values_mm, read_mm]: [&[f64]; 2],
    budget: &DriftBudget,
) -> Result<(ExpandedRate, f64), Iso230Error> {
    let (line, as_read) = (test.rate(values_mm)?, test.rate(read_mm)?);
    let window_s = test.rate_window_s;
    let normal_mm_s = combined(&[
        line.slope_by_scatter(budget.reading_scatter_mm),
        budget.rate_by_certificate(as_read.slope * window_s) / window_s,
    ]);
    let mut left_mm_s = Left::default();
    if let Some(artefact) = &budget.artefact {
        let slope_k_s = match artefact.degc() {
            Some(degc) => test.rate(degc)?.slope,
            None => 0.0,
        };
        left_mm_s = artefact.left_of_rate_mm_s(slope_k_s, (window_s, test.duration_s()));
    }
    let k = left_mm_s.coverage_factor(normal_mm_s); // (12), (13)
    let rate = ExpandedRate {
        value_mm_s: line.slope,
        expanded_uncertainty_mm_s: k * normal_mm_s.hypot(left_mm_s.standard()), // (6), (11)
    };
    Ok((rate, k))
}

/// Places of the least and of the greatest value; there is one at least.
fn extremes(values: &[f64]) -> [usize; 2] {
    let (mut least, mut greatest) = (0, 0);
    for (place, value) in values.iter().enumerate() {
        if *value < values[least] {
            least = place;
        }
        if *value > values[greatest] {
            greatest = place;
        }
    }
    [least, greatest]
}

impl DriftTest {
    fn check(&self) -> Result<(), Iso230Error> {
        check_points("times_s", self.times_s.len(), MIN_SAMPLES_OF_RATE)?;
        check_finite("times_s", 0, &self.times_s)?;
        check_ascending("times_s", &self.times_s)?;
        check_positive("drift_after_s", self.drift_after_s)?;
        check_positive("rate_window_s", self.rate_window_s)?;
        check_positive("longest_gap_s", self.longest_gap_s)?;
        for pair in self.times_s.windows(2) {
            if pair[1] - pair[0] > self.longest_gap_s {
                return Err(Iso230Error::Gap {
                    place: "times_s",
                    gap: pair[1] - pair[0],
                    at: pair[0],
                    limit: self.longest_gap_s,
                });
            }
        }
        let covered = self.duration_s();
        let needed = self.drift_after_s.max(self.rate_window_s);
        if covered < needed {
            return Err(Iso230Error::TooShort {
                place: "times_s",
                covered,
                needed,
            });
        }
        check_points("channels", self.channels.len(), 1)?;
        for (row, channel) in self.channels.iter().enumerate() {
            let values = &channel.displacements_mm;
            check_length("channels", row, values.len(), self.times_s.len())?;
            check_finite("channels", row, values)?;
            check_finite("height_mm", row, &[channel.height_mm])?;
        }
        Axis::ALL
            .into_iter()
            .try_for_each(|axis| self.check_axis(axis))
    }

    fn check_axis(&self, axis: Axis) -> Result<(), Iso230Error> {
        let heights: Vec<f64> = self.of(axis).map(|c| c.height_mm).collect();
        let reason = match heights[..] {
            [] => return Ok(()),
            _ if !axis.is_linear() => ChannelFault::Rotary,
            [_] => return Ok(()),
            [_, _] if axis == Axis::Z => ChannelFault::AlongHeight,
            [a, b] if a.total_cmp(&b).is_eq() => ChannelFault::SameHeight,
            [_, _] => return Ok(()),
            _ => ChannelFault::TooMany,
        };
        Err(Iso230Error::Channels {
            axis,
            n: heights.len(),
            reason,
        })
    }

    fn of(&self, axis: Axis) -> impl Iterator<Item = &DriftChannel> {
        self.channels.iter().filter(move |c| c.axis == axis)
    }

    /// T, s.
    fn duration_s(&self) -> f64 {
        range(self.times_s.iter().copied())
    }

    /// (1); the test is known to be long enough.
    fn drift(&self, values: &[f64]) -> f64 {
        let at_s = self.times_s[0] + self.drift_after_s;
        let last = self.times_s.len() - 1;
        let after = self.times_s.partition_point(|t| *t <= at_s).clamp(1, last);
        let (t0, t1) = (self.times_s[after - 1], self.times_s[after]);
        let share = (at_s - t0) / (t1 - t0);
        values[after - 1] + share * (values[after] - values[after - 1]) - values[0]
    }

    /// (3).
    fn rate(&self, values: &[f64]) -> Result<RateLine, Iso230Error> {
        let end_s = self.times_s[self.times_s.len() - 1];
        let begin_s = end_s - self.rate_window_s;
        let first = self.times_s.partition_point(|t| *t < begin_s);
        check_points("rate_window_s", values.len() - first, MIN_SAMPLES_OF_RATE)?;
        // About the end of the window, so that long clocks cost no digits.
        let times: Vec<f64> = self.times_s[first..].iter().map(|t| t - end_s).collect();
        let line = fit_line(&times, &values[first..], &vec![1.0; times.len()])?;
        Ok(RateLine {
            slope: line.slope,
            by_one_reading: line.covariance[(1, 1)].sqrt(),
        })
    }
}

/// The line of (3).
struct RateLine {
    slope: f64,
    /// 1/√Σ(t − t̄)², 1/s.
    by_one_reading: f64,
}

impl RateLine {
    /// First part of (6) by the standard deviation of a reading.
    fn slope_by_scatter(&self, of_reading: f64) -> f64 {
        self.by_one_reading * of_reading
    }
}

impl DriftBudget {
    /// Second part of (6) for a travel v τ of the window, mm.
    fn rate_by_certificate(&self, travel_mm: f64) -> f64 {
        let constant_mm = self.sensor.standard_mm(0.0);
        let by_length_mm = self.sensor.standard_mm(travel_mm) - constant_mm;
        let period = self.sensor_error_period_mm;
        let g = period.map_or(2.0_f64.sqrt(), |mm| wave_in_slope(travel_mm, mm));
        (g * constant_mm).hypot(by_length_mm)
    }

    fn check(&self, n_times: usize) -> Result<(), Iso230Error> {
        self.sensor.check()?;
        if let Some(period_mm) = self.sensor_error_period_mm {
            check_positive("sensor_error_period_mm", period_mm)?;
        }
        check_not_negative("reading_scatter_mm", self.reading_scatter_mm)?;
        let artefact = self.artefact.as_ref();
        artefact.map_or(Ok(()), |artefact| artefact.check(n_times))
    }
}

/// The angle that two heights of `axis` make, if there are two.
fn angle(
    test: &DriftTest,
    axis: Axis,
    budget: &DriftBudget,
) -> Result<Option<AngularDrift>, Iso230Error> {
    let mut channels: Vec<&DriftChannel> = test.of(axis).collect();
    channels.sort_by(|a, b| a.height_mm.total_cmp(&b.height_mm));
    let [lower, upper] = channels[..] else {
        return Ok(None);
    };
    let (about, sign) = match axis {
        Axis::X => (Axis::B, 1.0),
        _ => (Axis::A, -1.0),
    };
    let height_mm = upper.height_mm - lower.height_mm;
    let pairs = lower.displacements_mm.iter().zip(&upper.displacements_mm);
    let angles: Vec<f64> = pairs.map(|(l, u)| sign * (u - l) / height_mm).collect(); // (4)
    let certificate_rad = 2.0 * budget.sensor.standard_mm(0.0) / height_mm;
    let scatter_rad = 2.0 * budget.reading_scatter_mm / height_mm;
    let u_rad = certificate_rad.hypot(scatter_rad); // (5)
    let line = test.rate(&angles)?;
    let window_s = test.rate_window_s;
    let low = test.rate(&lower.displacements_mm)?;
    let high = test.rate(&upper.displacements_mm)?;
    let of_both_mm = [low, high].map(|one| budget.rate_by_certificate(one.slope * window_s));
    let u_rate_rad_s = combined(&[
        2.0_f64.sqrt() * line.slope_by_scatter(budget.reading_scatter_mm) / height_mm,
        combined(&of_both_mm) / (height_mm * window_s),
    ]); // (6)
    Ok(Some(AngularDrift {
        axis: about,
        heights_mm: [lower.height_mm, upper.height_mm],
        drift_after: ExpandedAngle::new(test.drift(&angles), u_rad),
        range: ExpandedAngle::new(range(angles.iter().copied()), u_rad),
        final_rate: ExpandedAngularRate::new(line.slope, u_rate_rad_s),
    }))
}
