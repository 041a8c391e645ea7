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
//! No FANUC page seen says which way a positive value moves the axis, so the user gives it ([`Sign`]); another maker's description of the
//! same incremental table takes interval minus distance really moved, a positive value for a move that is too short \[2\].
//!
//! # Rounding
//! The *sum* is rounded to whole m δ and the values are differences of rounded sums, so that rounding never adds up:
//!
//! ```text
//!   value(N) = R(N) - R(N-1),   R(N) = round(v(e(x(N)) - e(x_ref)) / (m δ))   (4)
//!   v(e) = -e or +e   as a positive value moves to plus or minus
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
//! One table for both directions leaves a lost motion that is the same everywhere to the backlash parameters (1851, 1852); one that
//! varies along the axis needs a table for each direction: `two_way`. The range of one
//! value (from memory -7 to 7) and the greatest number (1023) are given by whoever knows the control.
//!
//! # Agreement
//! Of an axis off by 31.5 µm, moved by (1) to (3) as the given sign says, 0.49 µm are left at pulses of 1 µm. Numbers and values of the example of
//! \[1\] come out as printed, and its sums (3) stay within the ±4 of its figure.
//!
//! # References
//! \[1\] FANUC Series 0i-PB Parameter Manual, B-63980EN/01, p. 100 (example of a linear axis). \[2\] Mitsubishi Electric C64,
//! machine error compensation, 9.2 (2) incremental system. \[3\] FANUC Series 15i/150i Parameter Manual, B-63330EN/03, p. 25.
//! \[4\] FANUC Series 30i Parameter Manual, B-63950EN/02, 3.3, p. 8 to 12. \[5\] FANUC Technical Report TMN00/072, A-77810E, 2000-05-09,
//! Series 16i/18i Bidirectional Pitch Error Compensation, 2. Setting data, table (a): parameters 3605#0 and 3620 to 3627.

mod two_way;

pub use two_way::{lost_motion_varies, two_way_tables};

use super::axis_errors::{AxisErrors, equal_spacing};
use super::error::ExportError;
use super::file::ExportFile;
use super::grid::SAME;
use super::number::{fixed, mm_or_deg, unit};
use super::sign::{Sign, check, given};
use machine::volumetric::on_line;

pub(super) const FANUC_TABLE: &str = "FANUC pitch error table";
/// One step at the machine that shows the sign.
pub(super) const FANUC_CHECK: &str = "in a table of zeros set +5 at one number above that of the reference point, with magnification 3623 = 2 (10 um at a detection unit of 1 um); switch off and on, return to the reference point, move in the positive direction past that interval and read a dial gauge, without and with the value: the display stays and the dial moves by 10 um, towards greater positions: --sign plus, towards smaller ones: --sign minus";
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
    /// Which way a positive value moves the axis.
    pub sign: Sign,
}

/// Numbers of points, first and last.
pub type Numbers = (i64, i64);

/// A record and the numbers of the points that it fills.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Pitch {
    /// The record.
    pub file: ExportFile,
    /// One range, or one for each direction.
    pub numbers: Vec<Numbers>,
}

/// The values of an axis.
///
/// # Errors
/// Directions that differ, unequal spacing, points that are not whole intervals from the reference, numbers below 0
/// or beyond the last, a value of too many pulses, a set-up that cannot be.
pub fn pitch_table(errors: &AxisErrors, set_up: &PitchTable) -> Result<Pitch, ExportError> {
    check_set_up(errors, set_up)?;
    let axis = errors.axis();
    let error = errors.of_both_directions(FANUC_TABLE)?;
    let spacing = equal_spacing(FANUC_TABLE, axis, errors.position())?;
    let first = number_of_first(errors, set_up, spacing)?;
    let at_reference = on_line(errors.position(), error, set_up.reference);
    let sums = sums(error, at_reference, set_up);
    let mut text = "%\n".to_owned();
    text.push_str(&lines(errors, set_up, &sums, first + 1)?);
    text.push_str("%\n");
    let numbers = (first + 1, first + (sums.len() - 1) as i64);
    let mut notes = notes(errors, set_up, spacing);
    notes.extend_from_slice(errors.remarks());
    let (least, greatest) = numbers;
    notes.push(format!(
        "set 3605#0 = 0, 3620 = {}, 3621 = {least}, 3622 = {greatest}, 3623 = {}, 3624 = {} {}",
        set_up.reference_number,
        set_up.magnification,
        fixed(mm_or_deg(axis, spacing), 6),
        unit(axis)
    ));
    Ok(Pitch {
        file: ExportFile::new(format!("PITCH_{axis}.TXT"), text, notes),
        numbers: vec![numbers],
    })
}

/// R of (4) for each point.
fn sums(error: &[f64], at_reference: f64, set_up: &PitchTable) -> Vec<i64> {
    let unit_out = set_up.detection_unit * f64::from(set_up.magnification);
    let of = |e: &f64| set_up.sign.value_of(e - at_reference) / unit_out;
    // A cast of a finite number of pulses; the values are checked against the range.
    error.iter().map(|e| of(e).round() as i64).collect()
}

/// The lines of one direction, the first for the interval that ends at the second point.
fn lines(
    errors: &AxisErrors,
    set_up: &PitchTable,
    sums: &[i64],
    first_number: i64,
) -> Result<String, ExportError> {
    let mut text = String::new();
    for (k, pair) in sums.windows(2).enumerate() {
        let value = pair[1].saturating_sub(pair[0]);
        if value.unsigned_abs() > u64::from(set_up.max_pulses) {
            return Err(ExportError::BeyondLimit {
                control: FANUC_TABLE,
                axis: errors.axis(),
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
        let number = first_number + k as i64 + NUMBER_OFFSET;
        text.push_str(&format!("N{number:05}{mark}P{value}\n"));
    }
    Ok(text)
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
            control: FANUC_TABLE,
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
        let control = FANUC_TABLE;
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
    check_numbers((first + 1, last), set_up)?;
    Ok(first)
}

fn check_numbers((first, last): Numbers, set_up: &PitchTable) -> Result<(), ExportError> {
    let known = 0..=i64::from(set_up.max_number);
    match [first, last].into_iter().find(|n| !known.contains(n)) {
        Some(number) => Err(ExportError::Setting {
            control: FANUC_TABLE,
            quantity: "number of a point",
            value: number as f64,
            rule: "must lie between 0 and the control's last number; choose another reference number",
        }),
        None => Ok(()),
    }
}

fn notes(errors: &AxisErrors, set_up: &PitchTable, spacing: f64) -> Vec<String> {
    let axis = errors.axis();
    let of_axis = |value| fixed(mm_or_deg(axis, value), 6);
    vec![
        format!("FANUC stored pitch error compensation of axis {axis}, incremental, whole pulses, an interval every {} {}", of_axis(spacing), unit(axis)),
        "value = what the error grows by over the interval, undone, / (detection unit x magnification)".to_owned(),
        given(set_up.sign),
        check(FANUC_CHECK),
        "number offset 10000 and mark Q0 are FROM MEMORY: compare with a table punched out by the control".to_owned(),
        format!("detection unit {} {}, reference point at {} {}", of_axis(set_up.detection_unit), unit(axis), of_axis(set_up.reference), unit(axis)),
        "switch off and on and return to the reference point after loading".to_owned(),
    ]
}
