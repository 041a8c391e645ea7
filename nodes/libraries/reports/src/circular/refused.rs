//! Circles with a reading that no machine has.
//!
//! ISO 230-4 leaves no reading out: G is the greatest less the least of all. A single reading beyond 5 % of the radius is a
//! slip of the instrument or of a table, so the run is invalid: none of its figures is stated, and the reading is named.
//! The other runs are evaluated, their causes too. Where more than a tenth of the readings lie so far out, the circle does:
//! ISO 230-4 is evaluated, and the causes, which hold for small deviations, are not. A circle of another radius than the programmed
//! one by more than that was read in another unit, or is of another program: its run is invalid too.
//! A reading beyond its neighbours on both sides that may be the machine's stays in every figure and is named.

use iso230::breakdown::{CircularRecording, GREATEST_DEVIATION, outliers};
use metrology::fit::fit_round;
use metrology::number::{degrees, number};
use nalgebra::Vector2;

use crate::evaluate::circles::{CirclePoint, CircleRecording};

/// A reading is held against this many on either side of the nearest ones.
const BESIDE: usize = 5;
/// Nearest readings that are left out on either side: a spike may be as wide.
const SPIKE_WIDTH: usize = 2;
/// A reading this many times as far from its neighbours as they are from each other is far from them.
const SPIKE_SPANS: f64 = 20.0;
/// No reading is far from its neighbours that is nearer, mm.
const LEAST_SPIKE_MM: f64 = 0.01;

/// The runs that are not evaluated because of outliers, a line each with the first of them.
#[must_use]
pub fn refused(circles: &[CircleRecording]) -> Vec<String> {
    circles.iter().filter_map(outlier).collect()
}

/// Why no figure of a run is stated; `None`: it has no outlier, and about its radius.
pub(super) fn outlier(circle: &CircleRecording) -> Option<String> {
    let radius_mm = circle.segment.radius_mm;
    let found = outliers(&deviations_mm(circle), radius_mm);
    let Some(first) = found.first() else {
        return other_radius(circle);
    };
    let others = match found.len() {
        1 => String::new(),
        n => format!(", and {} more", n - 1),
    };
    Some(format!("{}{others}", in_words(circle, *first)))
}

fn deviations_mm(circle: &CircleRecording) -> Vec<f64> {
    let points = circle.points.iter();
    let radii_mm = points.map(|point| point.at_mm[0].hypot(point.at_mm[1]));
    radii_mm.map(|mm| mm - circle.segment.radius_mm).collect()
}

/// Why a circle cannot be the programmed one; `None`: its radius is near that.
fn other_radius(circle: &CircleRecording) -> Option<String> {
    let points_mm: Vec<Vector2<f64>> = { circle.points.iter() }
        .map(|point| Vector2::from(point.at_mm))
        .collect();
    let read_mm = fit_round(&points_mm, &vec![1.0; points_mm.len()])
        .ok()?
        .radius_mm;
    let radius_mm = circle.segment.radius_mm;
    let is_other = (read_mm - radius_mm).abs() > GREATEST_DEVIATION * radius_mm;
    is_other.then(|| {
        format!(
            "run {}: the radius of its readings is {} mm, that of its program {} mm: at most 5 % apart; u_m, v_m and displacement_m are in metres: correct unit or radius, or repeat the run",
            circle.segment.run,
            number(read_mm),
            number(radius_mm)
        )
    })
}

/// The first reading of a run that is far from its neighbours, and the number of such readings; all figures use them.
pub(super) fn far(circle: &CircleRecording) -> Option<String> {
    let deviations_mm = deviations_mm(circle);
    let found: Vec<(usize, f64)> = (0..deviations_mm.len())
        .filter_map(|place| Some((place, spike_mm(&deviations_mm, place)?)))
        .collect();
    let (place, off_mm) = *found.first()?;
    let CirclePoint { at_mm, time_s } = circle.points.get(place)?;
    let others = match found.len() {
        1 => String::new(),
        n => format!(", and {} more of the run", n - 1),
    };
    Some(format!(
        "run {}: reading {} of {}, {} s after the first, at {} is {} µm from those beside it{others}. It is in every figure; repeat the run where it is a slip",
        circle.segment.run,
        place + 1,
        circle.points.len(),
        number(*time_s),
        degrees(at_mm[1].atan2(at_mm[0])),
        number((off_mm * 1e4).round() / 10.0),
    ))
}

/// How far a deviation is beyond all of those beside it, mm; `None`: it is not far from them.
fn spike_mm(deviations_mm: &[f64], place: usize) -> Option<f64> {
    let own_mm = *deviations_mm.get(place)?;
    let before = place.checked_sub(SPIKE_WIDTH + BESIDE)?;
    let sides_mm = [
        deviations_mm.get(before..before + BESIDE)?,
        deviations_mm.get(place + 1 + SPIKE_WIDTH..place + 1 + SPIKE_WIDTH + BESIDE)?,
    ];
    let beside_mm = || sides_mm.iter().copied().flatten();
    let low_mm = beside_mm().copied().fold(f64::INFINITY, f64::min);
    let high_mm = beside_mm().copied().fold(f64::NEG_INFINITY, f64::max);
    let off_mm = (low_mm - own_mm).max(own_mm - high_mm);
    let is_far = off_mm > LEAST_SPIKE_MM.max(SPIKE_SPANS * (high_mm - low_mm));
    is_far.then_some(if own_mm > high_mm { off_mm } else { -off_mm })
}

/// Why a run does not count among the causes; `None`: it does.
pub(super) fn of_causes(circle: &CircleRecording, recording: &CircularRecording) -> Option<String> {
    let beyond = || recording.beyond().map(|sample| in_words(circle, sample));
    let unusable = || {
        let error = recording.check(circle.segment.run as usize).err()?;
        Some(error.to_string().replacen("recording", "run", 1))
    };
    outlier(circle).or_else(beyond).or_else(unusable)
}

fn in_words(circle: &CircleRecording, place: usize) -> String {
    let radius_mm = circle.segment.radius_mm;
    let [u, v] = circle.points[place].at_mm;
    format!(
        "run {}: reading {} of {}, {} s after the first, at {}: radial deviation {} mm, at most {} mm (5 % of the radius): mend the reading or repeat the run",
        circle.segment.run,
        place + 1,
        circle.points.len(),
        number(circle.points[place].time_s),
        degrees(v.atan2(u)),
        number(u.hypot(v) - radius_mm),
        number(GREATEST_DEVIATION * radius_mm),
    )
}

#[cfg(test)]
mod tests {
    use std::f64::consts::TAU;

    use metrology::sample::Sense;

    use super::super::tests::recording;
    use super::*;
    use crate::evaluate::circles::Instrument;

    /// A turn about a radius of 50 mm with deviations by number of the reading, of so many.
    fn circle(n: u32, radius_mm: impl Fn(u32) -> f64) -> CircleRecording {
        let point = |k: u32| {
            let angle = TAU * f64::from(k) / f64::from(n);
            CirclePoint {
                at_mm: [radius_mm(k) * angle.cos(), radius_mm(k) * angle.sin()],
                time_s: f64::from(k) * 0.01,
            }
        };
        let points = (0..n).map(point).collect();
        let of_run = (2, Sense::CounterClockwise);
        recording(points, of_run, (50.0, 50.0), Instrument::GridEncoder)
    }

    #[test]
    fn a_circle_of_another_unit_is_refused_with_both_radii() {
        assert_eq!(outlier(&circle(360, |_| 50.01)), None);
        for factor in [1000.0, 0.001, 25.4, 0.9] {
            let why = outlier(&circle(360, |_| 50.0 * factor)).unwrap();
            let words = "run 2: the radius of its readings is ";
            assert!(why.starts_with(words), "{why}");
            assert!(why.contains("that of its program 50 mm"), "{why}");
        }
    }

    #[test]
    fn a_reading_far_from_those_beside_it_is_named_and_a_reversal_is_none() {
        let noise_mm = |k: u32| 2e-4 * f64::from(k * 7919 % 13) / 13.0;
        let of = |spike: fn(u32) -> f64| circle(360, |k| 50.0 + noise_mm(k) + spike(k));
        for (spike, is_far) in [
            ((|_| 0.0) as fn(u32) -> f64, false),
            (|k| if k == 100 { 0.06 } else { 0.0 }, true),
            (|k| if k == 100 { -0.06 } else { 0.0 }, true),
            (|k| if k == 100 || k == 101 { 0.06 } else { 0.0 }, true),
            // A backlash, an eccentric set-up and a spike of a reversal.
            (|k| if k < 180 { 0.06 } else { 0.0 }, false),
            (|k| 2.0 * (TAU * f64::from(k) / 360.0).sin(), false),
            (|k| if (88..96).contains(&k) { 0.012 } else { 0.0 }, false),
        ] {
            let found = far(&of(spike));
            assert_eq!(found.is_some(), is_far, "{found:?}");
        }
        let words = "run 2: reading 101 of 360, 1 s after the first, at 100.0 deg is ";
        let found = far(&of(|k| if k == 100 { 0.06 } else { 0.0 })).unwrap();
        assert!(found.starts_with(words), "{found}");
    }
}
