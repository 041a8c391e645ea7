//! One recorded circle: where it was driven, how, and what was measured on it.
//!
//! | plane | first axis (θ = 0) | second axis (θ = 90°) |
//! |---|---|---|
//! | XY | X | Y |
//! | YZ | Y | Z |
//! | ZX | Z | X |
//!
//! Angles count from the positive first axis towards the positive second one; counter-clockwise is
//! that way round.

use serde::{Deserialize, Serialize};

use super::error::BreakdownError;
use super::noise::median;
use metrology::Axis;

/// Fewer samples than this say nothing about two dozen causes.
const MIN_SAMPLES_OF_CIRCLE: usize = 36;
/// A deviation above this share of the radius is no deviation.
pub const GREATEST_DEVIATION: f64 = 0.05;
/// One reading in so many may be an outlier; with more it is the shape of the circle.
const OUTLIER_ONE_IN: usize = 10;

/// Plane of a circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "the planes of G17, G19 and G18")]
pub enum CircularPlane {
    Xy,
    Yz,
    Zx,
}

impl CircularPlane {
    /// Every plane.
    pub const ALL: [Self; 3] = [Self::Xy, Self::Yz, Self::Zx];

    /// First and second axis, right-handed about the plane's normal.
    #[must_use]
    pub const fn axes(self) -> [Axis; 2] {
        match self {
            Self::Xy => [Axis::X, Axis::Y],
            Self::Yz => [Axis::Y, Axis::Z],
            Self::Zx => [Axis::Z, Axis::X],
        }
    }
}

/// Which way round.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[expect(missing_docs, reason = "self-evident")]
pub enum CircularSense {
    Clockwise,
    CounterClockwise,
}

impl CircularSense {
    /// +1 counter-clockwise, −1 clockwise.
    #[must_use]
    pub const fn sign(self) -> f64 {
        match self {
            Self::Clockwise => -1.0,
            Self::CounterClockwise => 1.0,
        }
    }

    /// The other way round.
    #[must_use]
    pub const fn reversed(self) -> Self {
        match self {
            Self::Clockwise => Self::CounterClockwise,
            Self::CounterClockwise => Self::Clockwise,
        }
    }
}

/// What is known of the length against which radii were measured.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ReferenceLength {
    /// Calibrated: a deviation is one from the nominal radius.
    Calibrated {
        /// Standard uncertainty of the reference, mm; 0 where it is taken as exact.
        standard_uncertainty_mm: f64,
    },
    /// Not calibrated: only changes along the circle mean something.
    Free,
}

/// One sample of a circle.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CircularSample {
    /// Angle of the point, rad; may run beyond one turn or be wrapped.
    pub angle_rad: f64,
    /// Measured minus nominal radius, mm.
    pub radial_deviation_mm: f64,
    /// Time, s, on any clock.
    pub time_s: f64,
}

impl CircularSample {
    /// A sample of a two-dimensional measurement: the point from the nominal centre, mm.
    #[must_use]
    pub fn from_point(point_mm: [f64; 2], radius_mm: f64, time_s: f64) -> Self {
        Self {
            angle_rad: point_mm[1].atan2(point_mm[0]),
            radial_deviation_mm: point_mm[0].hypot(point_mm[1]) - radius_mm,
            time_s,
        }
    }
}

/// One circle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CircularRecording {
    /// Plane.
    pub plane: CircularPlane,
    /// Nominal centre on the first and second axis, machine positions, mm.
    pub centre_mm: [f64; 2],
    /// Nominal radius, mm.
    pub radius_mm: f64,
    /// Path feed, mm/s.
    pub feed_mm_s: f64,
    /// Which way round.
    pub sense: CircularSense,
    /// Changes whenever something was set up anew.
    pub setup_id: u32,
    /// Changes whenever the reference was set to zero anew.
    pub zero_id: u32,
    /// What the radii are compared with.
    pub reference: ReferenceLength,
    /// Samples in order of time.
    pub samples: Vec<CircularSample>,
}

impl CircularRecording {
    /// Refuses what cannot be evaluated; `recording` is its place in the caller's list.
    ///
    /// # Errors
    /// With the field or the sample, its value and limit.
    pub fn check(&self, recording: usize) -> Result<(), BreakdownError> {
        let n = self.samples.len();
        if n < MIN_SAMPLES_OF_CIRCLE {
            let least = MIN_SAMPLES_OF_CIRCLE;
            return Err(BreakdownError::TooFewSamples {
                recording,
                n,
                least,
            });
        }
        for (quantity, value) in [("radius_mm", self.radius_mm), ("feed_mm_s", self.feed_mm_s)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(BreakdownError::NotPositive {
                    recording,
                    quantity,
                    value,
                });
            }
        }
        if !self.centre_mm.iter().all(|c| c.is_finite()) {
            return Err(BreakdownError::CentreNotFinite { recording });
        }
        if let ReferenceLength::Calibrated {
            standard_uncertainty_mm: value,
        } = self.reference
            && !(value.is_finite() && value >= 0.0)
        {
            let quantity = "standard_uncertainty_mm";
            return Err(BreakdownError::Negative {
                recording,
                quantity,
                value,
            });
        }
        self.check_samples(recording)?;
        let swept_rad: f64 = steps(&self.samples).sum();
        if swept_rad * self.sense.sign() <= 0.0 {
            return Err(BreakdownError::SenseContradicted {
                recording,
                swept_rad,
            });
        }
        Ok(())
    }

    /// The first sample whose deviation cannot be evaluated, from 0; `None` where all can be.
    #[must_use]
    pub fn beyond(&self) -> Option<usize> {
        let limit_mm = GREATEST_DEVIATION * self.radius_mm;
        let is_beyond = |sample: &CircularSample| sample.radial_deviation_mm.abs() > limit_mm;
        self.samples.iter().position(is_beyond)
    }

    fn check_samples(&self, recording: usize) -> Result<(), BreakdownError> {
        let limit_mm = GREATEST_DEVIATION * self.radius_mm;
        let mut previous_s = f64::NEG_INFINITY;
        for (sample, s) in self.samples.iter().enumerate() {
            let numbers = [s.angle_rad, s.radial_deviation_mm, s.time_s];
            if !numbers.iter().all(|x| x.is_finite()) {
                return Err(BreakdownError::SampleNotFinite { recording, sample });
            }
            if s.radial_deviation_mm.abs() > limit_mm {
                let deviation_mm = s.radial_deviation_mm;
                return Err(BreakdownError::DeviationTooLarge {
                    recording,
                    sample,
                    deviation_mm,
                    limit_mm,
                });
            }
            if s.time_s < previous_s {
                let time_s = s.time_s;
                return Err(BreakdownError::TimeRunsBack {
                    recording,
                    sample,
                    time_s,
                    previous_s,
                });
            }
            previous_s = s.time_s;
        }
        Ok(())
    }

    /// Angles without jumps of a turn, rad.
    pub(super) fn unwrapped_rad(&self) -> Vec<f64> {
        let first = self.samples.first().map_or(0.0, |s| s.angle_rad);
        let rest = steps(&self.samples).scan(first, |angle, step| {
            *angle += step;
            Some(*angle)
        });
        std::iter::once(first).chain(rest).collect()
    }
}

/// Places of radial deviations, mm, in time, that lie further from their median than [`GREATEST_DEVIATION`] of the radius and
/// leap there: single slips of an instrument or a table. Where the deviation grows reading by reading the circle lies off its
/// centre. Empty where more than a tenth lies there: then that is the circle.
#[must_use]
pub fn outliers(deviations_mm: &[f64], radius_mm: f64) -> Vec<usize> {
    let middle_mm = median(deviations_mm.to_vec());
    let limit_mm = GREATEST_DEVIATION * radius_mm;
    let is_far = |mm: &f64| (mm - middle_mm).abs() > limit_mm;
    let mut places = Vec::new();
    let mut start = 0;
    for group in deviations_mm.chunk_by(|one, next| is_far(one) == is_far(next)) {
        let end = start + group.len();
        let into = start.checked_sub(1).map(|before| [before, start]);
        let out = (end < deviations_mm.len()).then_some([end - 1, end]);
        let is_leap = |[one, next]: [usize; 2]| {
            (deviations_mm[next] - deviations_mm[one]).abs() > 0.5 * limit_mm
        };
        if group.first().is_some_and(is_far) && into.into_iter().chain(out).any(is_leap) {
            places.extend(start..end);
        }
        start = end;
    }
    if places.len() * OUTLIER_ONE_IN > deviations_mm.len() {
        return Vec::new();
    }
    places
}

/// Steps of the angle from sample to sample, the short way round, rad.
fn steps(samples: &[CircularSample]) -> impl Iterator<Item = f64> {
    use std::f64::consts::{PI, TAU};
    samples.windows(2).map(|pair| match pair {
        [a, b] => (b.angle_rad - a.angle_rad + PI).rem_euclid(TAU) - PI,
        _ => 0.0,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(sense: CircularSense) -> CircularRecording {
        let samples = (0..400).map(|i| {
            let angle_rad = sense.sign() * f64::from(i).to_radians();
            CircularSample::from_point(
                [100.0 * angle_rad.cos(), 100.0 * angle_rad.sin()],
                100.0,
                f64::from(i) * 0.01,
            )
        });
        CircularRecording {
            plane: CircularPlane::Xy,
            centre_mm: [0.0; 2],
            radius_mm: 100.0,
            feed_mm_s: 20.0,
            sense,
            setup_id: 0,
            zero_id: 0,
            reference: ReferenceLength::Free,
            samples: samples.collect(),
        }
    }

    #[test]
    fn points_give_wrapped_angles_that_are_unwrapped_beyond_a_turn() {
        for sense in [CircularSense::Clockwise, CircularSense::CounterClockwise] {
            let recording = circle(sense);
            assert_eq!(recording.check(0), Ok(()));
            let last = recording.unwrapped_rad()[399];
            assert!((last - sense.sign() * 399_f64.to_radians()).abs() < 1e-9);
        }
    }

    #[test]
    fn a_circle_driven_the_other_way_round_is_refused() {
        let mut recording = circle(CircularSense::Clockwise);
        recording.sense = CircularSense::CounterClockwise;
        assert!(matches!(
            recording.check(3),
            Err(BreakdownError::SenseContradicted { recording: 3, .. })
        ));
    }

    #[test]
    fn unusable_numbers_are_refused_by_place() {
        let good = circle(CircularSense::CounterClockwise);
        let mut bad = good.clone();
        bad.samples[7].radial_deviation_mm = f64::NAN;
        assert_eq!(
            bad.check(1),
            Err(BreakdownError::SampleNotFinite {
                recording: 1,
                sample: 7
            })
        );
        let mut bad = good.clone();
        bad.samples[7].radial_deviation_mm = 6.0;
        assert!(matches!(
            bad.check(0),
            Err(BreakdownError::DeviationTooLarge { sample: 7, .. })
        ));
        let mut bad = good.clone();
        bad.samples[9].time_s = 0.0;
        assert!(matches!(
            bad.check(0),
            Err(BreakdownError::TimeRunsBack { sample: 9, .. })
        ));
        let mut bad = good.clone();
        bad.feed_mm_s = 0.0;
        assert_eq!(
            bad.check(0).unwrap_err().to_string(),
            "recording 0: feed_mm_s = 0 mm/s: must be finite and above 0"
        );
        let mut bad = good;
        bad.samples.truncate(10);
        assert!(matches!(
            bad.check(0),
            Err(BreakdownError::TooFewSamples { n: 10, .. })
        ));
    }

    #[test]
    fn single_slips_are_outliers_and_the_shape_of_a_circle_is_none() {
        let circle = |slips: &[(usize, f64)], offset_mm: f64| {
            let wave = |k: usize| offset_mm + 0.01 * (k as f64 / 20.0).sin();
            let mut deviations: Vec<f64> = (0..200).map(wave).collect();
            for (at, mm) in slips {
                deviations[*at] = *mm;
            }
            deviations
        };
        for radius_mm in [10.0, 100.0, 300.0] {
            let slip_mm = 0.06 * radius_mm;
            for offset_mm in [0.0, -0.07 * radius_mm] {
                assert!(outliers(&circle(&[], offset_mm), radius_mm).is_empty());
                let slips = [(3, slip_mm), (77, -0.2 * radius_mm)];
                assert_eq!(outliers(&circle(&slips, offset_mm), radius_mm), [3, 77]);
                let small = [(3, offset_mm + 0.04 * radius_mm)];
                assert!(outliers(&circle(&small, offset_mm), radius_mm).is_empty());
            }
            let many: Vec<(usize, f64)> = (0..30).map(|at| (at, slip_mm)).collect();
            assert!(outliers(&circle(&many, 0.0), radius_mm).is_empty());
        }
        assert!(outliers(&[], 100.0).is_empty());
        // Off its centre by little more than the limit: a few readings in a hundred lie beyond it, one beside the other.
        for share in [1.001, 1.005, 1.012, 1.2, 3.0] {
            let off_mm = share * GREATEST_DEVIATION * 10.0;
            let around = (0..360).map(|k| off_mm * f64::from(k).to_radians().cos());
            let mut deviations: Vec<f64> = around.collect();
            assert!(outliers(&deviations, 10.0).is_empty(), "{share}");
            deviations[90] = 5.0;
            let slips = outliers(&deviations, 10.0);
            assert!(slips.is_empty() || slips == [90], "{share}: {slips:?}");
        }
    }
}
