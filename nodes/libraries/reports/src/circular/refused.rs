//! Circles with a reading that no machine has.
//!
//! ISO 230-4 leaves no reading out: G is the greatest less the least of all. A single reading beyond 5 % of the radius is a
//! slip of the instrument or of a table, so the run is invalid: none of its figures is stated, and the reading is named.
//! The other runs are evaluated, their causes too. Where more than a tenth of the readings lie so far out, the circle does:
//! ISO 230-4 is evaluated, and the causes, which hold for small deviations, are not.

use iso230::breakdown::{CircularRecording, GREATEST_DEVIATION, outliers};
use metrology::number::{degrees, number};

use crate::evaluate::circles::CircleRecording;

/// The runs that are not evaluated because of outliers, a line each with the first of them.
#[must_use]
pub fn refused(circles: &[CircleRecording]) -> Vec<String> {
    circles.iter().filter_map(outlier).collect()
}

/// The outliers of a run; `None`: it has none.
pub(super) fn outlier(circle: &CircleRecording) -> Option<String> {
    let radius_mm = circle.segment.radius_mm;
    let deviations_mm: Vec<f64> = (circle.points.iter())
        .map(|point| point.at_mm[0].hypot(point.at_mm[1]) - radius_mm)
        .collect();
    let found = outliers(&deviations_mm, radius_mm);
    let first = *found.first()?;
    let others = match found.len() {
        1 => String::new(),
        n => format!(", and {} more", n - 1),
    };
    Some(format!("{}{others}", in_words(circle, first)))
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
