//! A pitch error table for each direction of travel (bidirectional pitch error compensation).
//!
//! # Parameters
//!
//! From table (a) of FANUC's report \[5\] in the module above:
//!
//! | parameter | meaning |
//! |---|---|
//! | 3605#0 | 1: bidirectional compensation on |
//! | 3620 | number of the reference point |
//! | 3621, 3622 | most distant points on the - and the + side, for travel in the positive direction |
//! | 3623, 3624 | magnification, interval |
//! | 3626 | most distant point on the - side, for travel in the negative direction |
//! | 3627 | compensation (absolute) at the reference point when the machine moves there ... |
//!
//! The copy of that table ends within 3627; **from memory** it goes on: in the direction opposite to that of the
//! reference position return, in detection units.
//!
//! # Model
//!
//! ```text
//!   C_up(x_ref) = 0,   C_down(x_ref) = [3627]                                (1)
//!   R_up(N)   = round(v(e_up(x(N)) - e_up(x_ref)) / δ)                       (2)
//!   R_down(N) = round(v(e_down(x(N)) - e_up(x_ref)) / δ)                     (3)
//!   values = differences of neighbouring sums,   [3627] = R_down(x_ref)      (4)
//! ```
//!
//! where the reference return goes in the positive direction. Where it goes in the negative one, C_down(x_ref) = 0 and the
//! whole differs by a shift that the reference point takes up: the values stay, 3627 turns its sign. The values of both
//! directions ascend with the position; a guide to the function, not FANUC's own page, calls this "incrementally as viewed
//! from the negative direction of the axis" (cnc.wiki, Fanuc pitch error compensation).
//!
//! # Holds when
//! Magnification 1: no page seen says whether 3627 is multiplied too. The whole lost motion is in the two tables, so that 1851 and 1852 are 0.

use super::super::axis_errors::{AxisErrors, equal_spacing};
use super::super::error::ExportError;
use super::super::file::ExportFile;
use super::super::number::{fixed, mm_or_deg, unit};
use super::{
    FANUC_TABLE, Pitch, PitchTable, check_numbers, check_set_up, lines, notes, number_of_first,
    sums,
};
use machine::volumetric::on_line;

/// Whether one backlash value for the whole axis leaves more than a pulse somewhere: errors up minus down that differ by more than
/// two pulses along the axis.
#[must_use]
pub fn lost_motion_varies(errors: &AxisErrors, set_up: &PitchTable) -> bool {
    let pairs = errors.up().iter().zip(errors.down());
    let span = pairs
        .map(|(up, down)| up - down)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), lost| {
            (least.min(lost), most.max(lost))
        });
    span.1 - span.0 > 2.0 * set_up.detection_unit * f64::from(set_up.magnification)
}

/// The values of an axis for travel in each direction, those of the negative one behind those of the positive one.
///
/// # Errors
/// As [`super::pitch_table`], but the directions may differ; a magnification above 1.
pub fn two_way_tables(errors: &AxisErrors, set_up: &PitchTable) -> Result<Pitch, ExportError> {
    check_set_up(errors, set_up)?;
    if set_up.magnification != 1 {
        return Err(ExportError::Setting {
            control: FANUC_TABLE,
            quantity: "magnification",
            value: f64::from(set_up.magnification),
            rule: "must be 1 for a table in each direction: no page seen says whether 3627 is multiplied",
        });
    }
    let axis = errors.axis();
    let spacing = equal_spacing(FANUC_TABLE, axis, errors.position())?;
    let first = number_of_first(errors, set_up, spacing)?;
    let at_reference = on_line(errors.position(), errors.up(), set_up.reference);
    let up = sums(errors.up(), at_reference, set_up);
    let down = sums(errors.down(), at_reference, set_up);
    let count = (up.len() - 1) as i64;
    let positive = (first + 1, first + count);
    let negative = (positive.1 + 1, positive.1 + count);
    check_numbers(negative, set_up)?;

    let mut text = "%\n".to_owned();
    text.push_str(&lines(errors, set_up, &up, positive.0)?);
    text.push_str(&lines(errors, set_up, &down, negative.0)?);
    text.push_str("%\n");
    // The reference is a whole number of intervals from the first point and lies among the points.
    let place = usize::try_from(i64::from(set_up.reference_number) - first).unwrap_or(0);
    let at_down = down.get(place).copied().unwrap_or(0);
    let mut notes = notes(errors, set_up, spacing);
    notes.extend_from_slice(errors.remarks());
    notes.push(format!(
        "set 3605#0 = 1, 3620 = {}, 3621 = {}, 3622 = {}, 3623 = 1, 3624 = {} {}, 3626 = {}, 3627 = {at_down} (a reference return in the positive direction; in the negative one {}), 1851 = 1852 = 0: the lost motion is in the tables",
        set_up.reference_number,
        positive.0,
        positive.1,
        fixed(mm_or_deg(axis, spacing), 6),
        unit(axis),
        negative.0,
        at_down.saturating_neg()
    ));
    notes.push("meaning of 3605#0 and 3620 to 3626: FANUC Technical Report A-77810E, table (a); FROM MEMORY and NOT from a FANUC page: how the description of 3627 ends, and that the values of the negative direction ascend with the position: read both directions on a dial gauge after loading".to_owned());
    Ok(Pitch {
        file: ExportFile::new(format!("PITCH_{axis}.TXT"), text, notes),
        numbers: vec![positive, negative],
    })
}
