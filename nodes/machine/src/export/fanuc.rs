//! FANUC stored pitch error compensation: whole pulses for each interval.
//!
//! # Numbers of the points
//!
//! The reference point has a number N_ref (parameter 3620). The value of number N belongs to the interval that ends at
//! it on the positive side \[1\]:
//!
//! ```text
//!   x(N) = x_ref + (N - N_ref) s           s: parameter 3624                  (1)
//!   value(N) acts in (x(N-1), x(N)]                                           (2)
//!   C(x(N)) = m δ sum of the values between x_ref and x(N),  C(x_ref) = 0     (3)
//! ```
//!
//! with δ the detection unit and m the magnification (3623). Farthest numbers are those of the intervals at the ends:
//! 3621 for the first, 3622 for the last. In the manual's example the reference is
//! 40 at 0 and the value at -400 mm has number 33 \[1\]: by (2) the interval is a round 50 mm, read any other way it is not.
//!
//! # Sign
//! A positive value is taken to add pulses in the positive direction, so that value = -(increase of the error): **derived**, no page
//! seen states it. (Another maker's description of the same incremental table says it in words: interval minus distance
//! really moved \[2\].) The notes say so; a dial gauge at one point decides.
//!
//! # Rounding
//! The *sum* is rounded to whole m δ and the values are differences of rounded sums, so that rounding never adds up:
//!
//! ```text
//!   value(N) = R(N) - R(N-1),   R(N) = round(-(e(x(N)) - e(x_ref)) / (m δ))   (4)
//! ```
//!
//! At the points at most half of m δ is left. Inside an interval the control puts the pulses out at a place of its own.
//!
//! # Format
//! A record begins and ends with `%` \[3\]; `N` is the point's number plus 10000 and, on series 30i and later, `Q0` marks pitch
//! data as `Q1` marks parameters \[4\]: the number's offset and `Q0` are **from memory**. Neither format is known to allow comments, so the notes
//! stand beside the file, with the parameters to be set by hand.
//!
//! # Holds when
//! One table for both directions; the reversal belongs into the backlash parameters (1851, 1852). The range of one
//! value (from memory -7 to 7) and the greatest number (1023) are given by whoever knows the control.
//!
//! # Agreement
//! Interpreted by (1) to (3), an axis off by 31.5 µm is left with 0.49 µm at pulses of 1 µm; with the sign turned round
//! errors above 2 µm become 1.93 to 2.04 times as large. Numbers and values of the example of \[1\] come out as printed.
//!
//! # References
//! \[1\] FANUC Series 0i-PB Parameter Manual, B-63980EN/01, p. 100 (example of a linear axis). \[2\] Mitsubishi Electric C64,
//! machine error compensation, 9.2 (2) incremental system. \[3\] FANUC Series 15i/150i Parameter Manual, B-63330EN/03, p. 25.
//! \[4\] FANUC Series 30i Parameter Manual, B-63950EN/02, 3.3, p. 8 to 12. \[5\] FANUC Technical Report A-77810E (2000), table (a): parameters 3620 to 3624.

use super::axis_errors::{AxisErrors, equal_spacing};
use super::error::ExportError;
use super::file::ExportFile;
use super::grid::SAME;
use super::number::{fixed, mm_or_deg, unit};
use crate::volumetric::on_line;

const CONTROL: &str = "FANUC pitch error table";
/// `N` of a point is its number and this.
const NUMBER_OFFSET: i64 = 10_000;

/// Kind of record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Record {
    /// `N10033P2`: series 0i, 15i, 16i, 18i.
    Plain,
    /// `N10033Q0P2`: series 30i and later.
    Marked,
}

/// What the control's set-up says.
#[derive(Clone, Debug, PartialEq)]
pub struct PitchTable {
    /// Number of the reference point, parameter 3620.
    pub reference_number: u32,
    /// Position of the reference point, mm or rad.
    pub reference: f64,
    /// Detection unit, mm or rad.
    pub detection_unit: f64,
    /// Magnification, parameter 3623, 1 to 100.
    pub magnification: u32,
    /// Greatest size of one value, pulses.
    pub max_pulses: u32,
    /// Greatest number of a point.
    pub max_number: u32,
    /// Kind of record.
    pub record: Record,
}

/// The values of an axis.
///
/// # Errors
/// Directions that differ, unequal spacing, points that are not whole intervals from the reference, numbers below 0
/// or beyond the last, a value of too many pulses, a set-up that cannot be.
pub fn pitch_table(errors: &AxisErrors, set_up: &PitchTable) -> Result<ExportFile, ExportError> {
    check_set_up(errors, set_up)?;
    let axis = errors.axis();
    let error = errors.of_both_directions(CONTROL)?;
    let spacing = equal_spacing(CONTROL, axis, errors.position())?;
    let first = number_of_first(errors, set_up, spacing)?;
    let at_reference = on_line(errors.position(), error, set_up.reference);
    let unit_out = set_up.detection_unit * f64::from(set_up.magnification);
    // (4); a cast of a finite number of pulses, checked against the range below.
    let sums: Vec<i64> = error
        .iter()
        .map(|e| (-(e - at_reference) / unit_out).round() as i64)
        .collect();
    let mut text = "%\n".to_owned();
    for (k, pair) in sums.windows(2).enumerate() {
        let value = pair[1].saturating_sub(pair[0]);
        if value.unsigned_abs() > u64::from(set_up.max_pulses) {
            return Err(ExportError::BeyondLimit {
                control: CONTROL,
                axis,
                position: errors.position()[k + 1],
                value: value as f64,
                limit: f64::from(set_up.max_pulses),
                unit: "pulses",
            });
        }
        let mark = match set_up.record {
            Record::Plain => "",
            Record::Marked => "Q0",
        };
        let number = first + 1 + k as i64 + NUMBER_OFFSET;
        text.push_str(&format!("N{number:05}{mark}P{value}\n"));
    }
    text.push_str("%\n");
    let last = first + (sums.len() - 1) as i64;
    let notes = notes(errors, set_up, spacing, (first + 1, last));
    let name = format!("PITCH_{axis}.TXT");
    Ok(ExportFile::new(name, text, notes))
}

fn check_set_up(errors: &AxisErrors, set_up: &PitchTable) -> Result<(), ExportError> {
    let positive = "must be a finite number above 0";
    let magnification = f64::from(set_up.magnification);
    let (least, greatest) = errors.span();
    let inside = (least - SAME..=greatest + SAME).contains(&set_up.reference);
    let wrong = if !(set_up.detection_unit.is_finite() && set_up.detection_unit > 0.0) {
        Some(("detection_unit", set_up.detection_unit, positive))
    } else if !(1..=100).contains(&set_up.magnification) {
        Some(("magnification", magnification, "must be 1 to 100"))
    } else if set_up.max_pulses == 0 {
        Some(("max_pulses", 0.0, "must be above 0"))
    } else if !inside {
        let rule = "the reference point must lie among the points";
        Some(("reference", set_up.reference, rule))
    } else {
        None
    };
    match wrong {
        Some((quantity, value, rule)) => Err(ExportError::Setting {
            control: CONTROL,
            quantity,
            value,
            rule,
        }),
        None => Ok(()),
    }
}

/// Number of the first point, by (1).
fn number_of_first(
    errors: &AxisErrors,
    set_up: &PitchTable,
    spacing: f64,
) -> Result<i64, ExportError> {
    let (axis, position, reference) = (errors.axis(), errors.span().0, set_up.reference);
    let intervals = (position - reference) / spacing;
    if (intervals - intervals.round()).abs() * spacing > SAME {
        let control = CONTROL;
        return Err(ExportError::OffReference {
            control,
            axis,
            position,
            spacing,
            reference,
        });
    }
    let first = i64::from(set_up.reference_number) + intervals.round() as i64;
    let last = first + (errors.position().len() - 1) as i64;
    // The first point itself has no value: its number may be one below the least.
    for number in [first + 1, last] {
        if !(0..=i64::from(set_up.max_number)).contains(&number) {
            return Err(ExportError::Setting {
                control: CONTROL,
                quantity: "number of a point",
                value: number as f64,
                rule: "must lie between 0 and the control's last number; choose another reference number",
            });
        }
    }
    Ok(first)
}

fn notes(
    errors: &AxisErrors,
    set_up: &PitchTable,
    spacing: f64,
    (first, last): (i64, i64),
) -> Vec<String> {
    let axis = errors.axis();
    let of_axis = |value| fixed(mm_or_deg(axis, value), 6);
    vec![
        format!("FANUC stored pitch error compensation of axis {axis}, incremental, whole pulses"),
        "value = -(increase of the error over the interval) / (detection unit x magnification); sign DERIVED: a positive value is taken to add pulses in the positive direction; verify before use".to_owned(),
        "number offset 10000 and mark Q0 are FROM MEMORY: compare with a table punched out by the control".to_owned(),
        format!("set 3620 = {}, 3621 = {first}, 3622 = {last}, 3623 = {}, 3624 = {} {}", set_up.reference_number, set_up.magnification, of_axis(spacing), unit(axis)),
        format!("detection unit {} {}, reference point at {} {}", of_axis(set_up.detection_unit), unit(axis), of_axis(set_up.reference), unit(axis)),
        "switch off and on and return to the reference point after loading".to_owned(),
    ]
}
