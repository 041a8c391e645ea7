//! HEIDENHAIN compensation-value table of one axis (`.COM`), with the columns of KinematicsComp.
//!
//! # Columns
//!
//! `AXISPOS` is the position of the axis against the machine datum; a column named after an axis holds values for
//! that axis as a function of this one; `BACKLASH` holds the values measured in the negative direction of
//! traverse \[1\]. KinematicsComp adds `C1` to `C6`, for errors X, Y, Z, A, B, C of this axis, to which entries of the
//! kinematic table refer; the positioning error stays in the axis' own column \[2\], \[3\]. A squareness is here the linear
//! part of a straightness column.
//!
//! # Sign
//!
//! No page seen says which way a positive value of a `.COM` table moves its axis, so the user gives it ([`Sign`]):
//!
//! ```text
//!   own column, BACKLASH:   value = +e(p) or -e(p)       as a positive value moves to minus or plus    (1)
//!   C1 to C6:               value = e(p)                 the component as ISO 230-1 defines it         (2)
//! ```
//!
//! What the pages say points to +e: for the linear compensation the error is entered with its sign, "positive if the table travel is too
//! long" \[4\]; into the table go "the compensation points of the error curve" \[5\], whose ordinate is "Error" \[6\]. But \[4\] is of another
//! function, and neither \[5\] nor \[6\] says when that error is positive.
//!
//! (2) is the scheme of KinematicsComp, which enters EYX, EZX, ... of ISO 230-1 by name \[2\], \[3\]; how a column acts is decided by the
//! entry that refers to it in the kinematic table, whose sign whoever makes that entry tries in the same way.
//!
//! # Units and rounding
//! mm to 0.1 µm, degrees to 1e-6 degree, both **derived** from the controls' input resolution.
//!
//! # Layout
//! `BEGIN`, a line of column names, numbered rows, `[END]`: **derived** from HEIDENHAIN's text tables; comments are not known
//! to be allowed, so the notes stand beside the file.
//!
//! # Holds when
//! At most 256 rows \[7\]. The difference of neighbouring values is at most 1/64 of the spacing, the limit of the older
//! controls \[5\], which no sound axis comes near. The table is made active in `config.CMA` \[1\].
//!
//! # Agreement
//! Of an axis off by 32.5 µm, moved as the given sign says, 50 nm are left, half of the rounding. The error curve of the
//! example of \[5\] comes out as printed there.
//!
//! # References
//! \[1\] MANUALplus 620 Technical Manual, 01/2012, 6.10.3, p. 713 to 718. \[2\] iTNC 530 HSCI Technical Manual,
//! KinematicsComp, p. 680. \[3\] ibid., p. 684, 686. \[4\] TNC 407/415/425 Technical Manual, 1.6.3, p. 4-26 (MP720).
//! \[5\] TNC 406/306 Technical Manual, p. 4-21. \[6\] TNC 407/415/425 Technical Manual, p. 4-28.
//! \[7\] ibid., 4.7.3, module 9095, error 3.

use metrology::{Axis, ErrorComponent};

use super::axis_errors::{AxisErrors, check_count};
use super::cross_errors::CrossErrors;
use super::error::ExportError;
use super::file::ExportFile;
use super::grid::SAME;
use super::number::{fixed, is_name, mm_or_deg, unit};
use super::sign::{Sign, check, given};

pub(super) const HEIDENHAIN_TABLE: &str = "HEIDENHAIN .COM";
/// One step at the machine that shows the sign.
pub(super) const HEIDENHAIN_CHECK: &str = "in a .COM table of one axis enter 0.010 in the axis' own column at one row in mid-travel and 0 in the others, move the axis to that AXISPOS, make the line in config.CMA active and read a dial gauge along the axis: the display stays and the dial moves by 10 um, towards greater positions: --sign plus, towards smaller ones: --sign minus";
const MOST_ROWS: usize = 256;
const STEEPEST: f64 = 1.0 / 64.0;
const LENGTH_DECIMALS: usize = 4;
const ANGLE_DECIMALS: usize = 6;

/// One column.
struct Column<'a> {
    name: String,
    direction: Axis,
    errors: &'a [f64],
    /// What a positive value does; none in the columns of KinematicsComp.
    sign: Option<Sign>,
}

impl Column<'_> {
    /// Value of a row: (1) or (2).
    fn value(&self, row: usize) -> f64 {
        let error = self.errors[row];
        self.sign.map_or(error, |sign| sign.value_of(error))
    }
}

/// The table of an axis: its positioning, and other errors of the same axis at the same positions; `sign` says which way a positive
/// value of the axis' own column moves it.
///
/// # Errors
/// A table name that cannot be, more than 256 rows, columns at other positions or of another axis, a value that
/// changes too steeply.
pub fn compensation_table(
    name: &str,
    positioning: &AxisErrors,
    others: &[CrossErrors],
    sign: Sign,
) -> Result<ExportFile, ExportError> {
    if !is_name(name) {
        let name = name.to_owned();
        return Err(ExportError::Name {
            control: HEIDENHAIN_TABLE,
            name,
        });
    }
    let axis = positioning.axis();
    check_count(
        HEIDENHAIN_TABLE,
        axis,
        positioning.position().len(),
        MOST_ROWS,
    )?;
    let columns = columns(positioning, others, sign)?;
    for column in &columns {
        check_steepness(axis, positioning.position(), column)?;
    }
    let text = table(name, positioning, &columns);
    let mut notes = notes(name, positioning, others, sign);
    notes.extend_from_slice(positioning.remarks());
    Ok(ExportFile::new(format!("{name}.COM"), text, notes))
}

fn columns<'a>(
    positioning: &'a AxisErrors,
    others: &'a [CrossErrors],
    sign: Sign,
) -> Result<Vec<Column<'a>>, ExportError> {
    let axis = positioning.axis();
    let column = |name: &str, direction, errors, sign| Column {
        name: name.to_owned(),
        direction,
        errors,
        sign,
    };
    let mut columns = Vec::new();
    let differ = positioning
        .up()
        .iter()
        .zip(positioning.down())
        .any(|(up, down)| (up - down).abs() > SAME);
    if differ {
        columns.push(column("BACKLASH", axis, positioning.down(), Some(sign)));
    }
    columns.push(column(axis.letter(), axis, positioning.up(), Some(sign)));
    for errors in others {
        let component = errors.parts()[0];
        let own = errors.base() == axis;
        if !own || errors.direction() == axis {
            let component = ErrorComponent::motion(errors.direction(), errors.base());
            let direction = errors.direction();
            return Err(ExportError::NoEffect {
                component,
                base: axis,
                direction,
            });
        }
        let same = errors.position().len() == positioning.position().len()
            && errors
                .position()
                .iter()
                .zip(positioning.position())
                .all(|(a, b)| (a - b).abs() <= SAME);
        if !same {
            return Err(ExportError::DifferentPositions { axis, component });
        }
        let name = format!("C{}", errors.direction().index() + 1);
        columns.push(column(&name, errors.direction(), errors.error(), None));
    }
    Ok(columns)
}

fn check_steepness(axis: Axis, position: &[f64], column: &Column) -> Result<(), ExportError> {
    let steps = position.windows(2).zip(column.errors.windows(2));
    for (at, value) in steps {
        let spacing = mm_or_deg(axis, at[1] - at[0]);
        let difference = mm_or_deg(column.direction, value[1] - value[0]);
        if difference.abs() > spacing * STEEPEST {
            return Err(ExportError::BeyondLimit {
                control: HEIDENHAIN_TABLE,
                axis: column.direction,
                position: at[1],
                value: difference,
                limit: spacing * STEEPEST,
                unit: unit(column.direction),
            });
        }
    }
    Ok(())
}

fn number(axis: Axis, value: f64) -> String {
    let decimals = if axis.is_linear() {
        LENGTH_DECIMALS
    } else {
        ANGLE_DECIMALS
    };
    fixed(mm_or_deg(axis, value), decimals)
}

fn table(name: &str, positioning: &AxisErrors, columns: &[Column]) -> String {
    let axis = positioning.axis();
    let mut text = format!("BEGIN {name}.COM MM\nNR   AXISPOS      ");
    for column in columns {
        text.push_str(&format!("{:<12}", column.name));
    }
    close_line(&mut text);
    for (row, at) in positioning.position().iter().enumerate() {
        text.push_str(&format!("{row:<5}{:<13}", number(axis, *at)));
        for column in columns {
            let value = number(column.direction, column.value(row));
            text.push_str(&format!("{value:<12}"));
        }
        close_line(&mut text);
    }
    text.push_str("[END]\n");
    text
}

fn close_line(text: &mut String) {
    text.truncate(text.trim_end_matches(' ').len());
    text.push('\n');
}

fn notes(name: &str, positioning: &AxisErrors, others: &[CrossErrors], sign: Sign) -> Vec<String> {
    let axis = positioning.axis();
    let mut notes = vec![
        format!(
            "HEIDENHAIN compensation table of axis {axis}; AXISPOS in {} against the machine datum; lengths mm, angles deg",
            unit(axis)
        ),
        given(sign),
        check(HEIDENHAIN_CHECK),
        "layout of the text file is DERIVED from HEIDENHAIN's text tables".to_owned(),
        format!("enter {name}.COM in config.CMA for axis {axis} and make the line active"),
        "BACKLASH, where present, holds the positioning values measured in the negative direction"
            .to_owned(),
    ];
    for errors in others {
        let n = errors.direction().index() + 1;
        notes.push(format!(
            "C{n} holds {} with the sign of ISO 230-1 (iTNC 530 HSCI Technical Manual, KinematicsComp, p. 680, 684); what a positive value does is decided by your entry, so try that entry's sign in the same way: it acts through an entry {name}.C{n} in column COMPTAB of the kinematic table",
            errors.names()
        ));
    }
    notes
}
