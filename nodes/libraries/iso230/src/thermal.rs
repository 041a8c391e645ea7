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
//! | h | `height_mm` | mm |
//! | s | `reading_scatter_mm`, by (7) [`scatter_mm`] | mm |
//!
//! Uncertainties, with U₀, U₁ and k of the instrument's certificate, s of the scatter of one reading, and an artefact of
//! length l and coefficient α whose temperature stays within a range Δθ, so that it may grow or shrink by up to α l Δθ.
//! d_t and range are differences of two readings: the constant part of the certificate and the scatter enter twice, the part
//! that grows with the length once, for the length d between the readings:
//!
//! ```text
//!   d_t, range:  u² = [2 U₀² + (U₁ d)²]/k² + 2 s² + (α l Δθ)²/3                        (5)
//!   an angle:    u² = 4 (U₀²/k² + s²)/(h₂ − h₁)²
//!   rate v:      u² = s²/Σ(t − t̄)² + [g² U₀² + (U₁ v τ)²]/(k τ)² + (α l Δθ)²/(3 T²)    (6)
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
//! # Holds when
//! What is sampled is slow beside the samples: between two of them (1) takes a straight line. (8) takes the drift in the window
//! as straight. The
//! growth of the artefact is one for both heights and leaves the angle. An artefact that warms up in steps during the test
//! can grow by more than τ/T in the last τ.
//!
//! # Agreement
//! Closed form: `val_iso230_3_an_exponential_drift_has_its_closed_form`, d and range below 1e-15 mm,
//! the rate of 361 samples to 2.5e-4 of that of a continuous recording. No published example was at
//! hand.
//!
//! (5) by hand: `eq5_certificate_scatter_and_artefact_by_hand`; (7): `eq7_scatter_of_noise_on_a_line_by_hand`, and numpy on a
//! table (`val_a_warm_up_logged_once_is_evaluated_by_iso_230_3`). (8): `eq8_the_slope_of_a_wave_is_that_of_sampled_lines`.
//!
//! # References
//! \[1\] ISO 230-3:2020; from the literature, the text was not at hand. \[2\] JCGM 100:2008 (GUM), 4.2, 4.3 and 5.1.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::budget::{DeviceUncertainty, combined, rectangular};
use super::error::ChannelFault;
use super::extent::{
    check_ascending, check_finite, check_length, check_not_negative, check_points, check_positive,
    range,
};
use super::{ExpandedAngle, ExpandedAngularRate, ExpandedLength, ExpandedRate, Iso230Error};
use metrology::Axis;
use metrology::fit::fit_line;

/// Samples without which a rate has no uncertainty.
const MIN_SAMPLES_OF_RATE: usize = 3;
/// Where g of (8) is greatest.
const GREATEST_K: f64 = 2.081_576;
/// g there.
const GREATEST_G: f64 = 2.617_10;
/// Below it, the first term of j₁ is exact to nine digits.
const SMALL_K: f64 = 1e-4;

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

/// Before the zero of a sensor, in a name that states its height.
const HEIGHT_OF: &str = "height_of_zero_";
/// Between that zero and the height.
const IS_MM: &str = "_mm=";

/// A name by which a recording states the height (mm) of the sensor whose readings have a zero: `height_of_zero_1_mm=110`.
#[must_use]
pub fn height_name(zero_id: u32, height_mm: f64) -> String {
    format!("{HEIGHT_OF}{zero_id}{IS_MM}{height_mm}")
}

/// Zero and height (mm) of such a name; none of another one.
#[must_use]
pub fn height_of(name: &str) -> Option<(u32, f64)> {
    let (zero, height) = name.strip_prefix(HEIGHT_OF)?.split_once(IS_MM)?;
    let height_mm: f64 = height.parse().ok()?;
    Some((zero.parse().ok()?, height_mm)).filter(|_| height_mm.is_finite())
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
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriftBudget {
    /// Certificate of the instrument that reads the displacements.
    pub sensor: DeviceUncertainty,
    /// Standard deviation of one reading by scatter, which a certificate does not hold; [`scatter_mm`] finds it in a log, mm.
    pub reading_scatter_mm: f64,
    /// Period over which the instrument's error repeats along the displacement, λ of (8), mm; none: it is not stated.
    #[serde(default)]
    pub sensor_error_period_mm: Option<f64>,
    /// Length of the artefact between its seat and the sensors, mm.
    pub artefact_length_mm: f64,
    /// Coefficient of expansion of the artefact, 1/K.
    pub artefact_expansion_per_k: f64,
    /// Range of the artefact's temperature over the test, K.
    pub artefact_temperature_range_k: f64,
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
    /// (2): ETVE where the surroundings are the cause.
    pub range: ExpandedLength,
    /// (3).
    pub final_rate: ExpandedRate,
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
    /// For two readings that are `difference_mm` apart.
    fn new(budget: &DriftBudget, difference_mm: f64) -> Self {
        let constant_mm = budget.sensor.standard_mm(0.0);
        let by_length_mm = budget.sensor.standard_mm(difference_mm) - constant_mm;
        let growth_mm = budget.artefact_length_mm
            * budget.artefact_expansion_per_k
            * budget.artefact_temperature_range_k;
        Self {
            certificate_mm: (2.0 * constant_mm.powi(2) + by_length_mm.powi(2)).sqrt(),
            scatter_mm: 2.0_f64.sqrt() * budget.reading_scatter_mm,
            artefact_mm: rectangular(growth_mm),
        }
    }

    /// Combined standard uncertainty (5), mm.
    #[must_use]
    pub fn combined_mm(&self) -> f64 {
        combined(&[self.certificate_mm, self.scatter_mm, self.artefact_mm])
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
    budget.check()?;
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
    let values_mm = &channel.displacements_mm;
    let of = |value_mm: f64| {
        let parts = DriftContributions::new(budget, value_mm);
        (ExpandedLength::new(value_mm, parts.combined_mm()), parts) // (5)
    };
    let (drift_after, _) = of(test.drift(values_mm));
    let (range, contributions) = of(range(values_mm.iter().copied()));
    let line = test.rate(values_mm)?;
    let share = test.rate_window_s / test.duration_s();
    let u_rate_mm_s = combined(&[
        line.slope_by_scatter(budget.reading_scatter_mm),
        budget.rate_by_certificate(line.slope * test.rate_window_s) / test.rate_window_s,
        share * contributions.artefact_mm / test.rate_window_s,
    ]); // (6)
    Ok(DisplacementDrift {
        axis: channel.axis,
        height_mm: channel.height_mm,
        drift_after,
        range,
        final_rate: ExpandedRate::new(line.slope, u_rate_mm_s),
        contributions,
    })
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

/// g of (8) for a travel v τ over a period λ.
fn wave_in_slope(travel_mm: f64, period_mm: f64) -> f64 {
    let k = std::f64::consts::PI * travel_mm.abs() / period_mm;
    if k < SMALL_K {
        // j₁ = K/3 − K³/30 + …
        return 2.0 * k;
    }
    if k <= GREATEST_K {
        return 6.0 * (k.sin() - k * k.cos()) / (k * k);
    }
    GREATEST_G.min(6.0 * (1.0 + 1.0 / (k * k)).sqrt() / k)
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

    fn check(&self) -> Result<(), Iso230Error> {
        self.sensor.check()?;
        if let Some(period_mm) = self.sensor_error_period_mm {
            check_positive("sensor_error_period_mm", period_mm)?;
        }
        check_not_negative("reading_scatter_mm", self.reading_scatter_mm)?;
        check_not_negative("artefact_length_mm", self.artefact_length_mm)?;
        check_not_negative("artefact_expansion_per_k", self.artefact_expansion_per_k)?;
        check_not_negative(
            "artefact_temperature_range_k",
            self.artefact_temperature_range_k,
        )
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eq8_the_slope_of_a_wave_is_that_of_sampled_lines() {
        // Least-squares slopes of sampled waves of 24 phases, by the two sums of a regression.
        let n = 2001;
        let sampled = |travel: f64| {
            let mut squares = 0.0;
            for phase in 0..24 {
                let phi = std::f64::consts::TAU * f64::from(phase) / 24.0;
                let (mut top, mut bottom) = (0.0, 0.0);
                for i in 0..n {
                    let t = f64::from(i) / f64::from(n - 1) - 0.5;
                    let wave = (std::f64::consts::TAU * travel * t + phi).sin();
                    top += t * wave;
                    bottom += t * t;
                }
                squares += (top / bottom).powi(2) / 24.0;
            }
            // Of a wave with standard deviation 1.
            (2.0 * squares).sqrt()
        };
        for travel in [1e-6, 0.01, 0.1, 0.3, 0.6, 0.66] {
            let (found, wanted) = (wave_in_slope(travel, 1.0), sampled(travel));
            assert!(
                (found - wanted).abs() < 3e-3 * wanted + 1e-9,
                "{travel}: {found} {wanted}"
            );
        }
        for travel in [0.7, 0.9, 1.3, 2.0, 3.7, 12.2] {
            assert!(
                wave_in_slope(travel, 1.0) >= 0.999 * sampled(travel),
                "{travel}"
            );
        }
        assert!(wave_in_slope(0.0, 1.0).abs() < 1e-30);
    }

    #[test]
    fn a_height_reads_back_and_other_names_have_none() {
        for (zero_id, height_mm) in [(1, 110.0), (2, -0.125), (7, 260.5)] {
            let found = height_of(&height_name(zero_id, height_mm));
            assert_eq!(found, Some((zero_id, height_mm)));
        }
        for name in [
            "spindle",
            "height_of_zero_1",
            "height_of_zero_x_mm=1",
            "height_of_zero_1_mm=inf",
        ] {
            assert_eq!(height_of(name), None, "{name}");
        }
    }
}
