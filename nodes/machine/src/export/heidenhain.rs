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
//! ```text
//!   value = +e(p)         position reached = command - value + e(p)          (1)
//! ```
//!
//! For the linear compensation the manual says that the error is entered with its sign, positive when the travel
//! is too long \[4\]; for the table it says that points *of the error curve* are entered \[5\] and draws that curve over an
//! ordinate "error" \[6\]. (1) is **derived** from those: no page seen states the sign of a `.COM` value as such. What KinematicsComp
//! does with a column is up to the sign of the entry in the kinematic table.
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
//! Interpreted from the manuals, an axis off by 32.5 µm is left with 50 nm, half of the rounding; with the sign turned
//! round the error becomes 1.998 to 2.002 times as large.
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

const CONTROL: &str = "HEIDENHAIN .COM";
const MOST_ROWS: usize = 256;
const STEEPEST: f64 = 1.0 / 64.0;
const LENGTH_DECIMALS: usize = 4;
const ANGLE_DECIMALS: usize = 6;

/// One column.
struct Column<'a> {
    name: String,
    direction: Axis,
    values: &'a [f64],
}

/// The table of an axis: its positioning, and other errors of the same axis at the same positions.
///
/// # Errors
/// A table name that cannot be, more than 256 rows, columns at other positions or of another axis, a value that
/// changes too steeply.
pub fn compensation_table(
    name: &str,
    positioning: &AxisErrors,
    others: &[CrossErrors],
) -> Result<ExportFile, ExportError> {
    if !is_name(name) {
        let name = name.to_owned();
        return Err(ExportError::Name {
            control: CONTROL,
            name,
        });
    }
    let axis = positioning.axis();
    check_count(CONTROL, axis, positioning.position().len(), MOST_ROWS)?;
    let columns = columns(positioning, others)?;
    for column in &columns {
        check_steepness(axis, positioning.position(), column)?;
    }
    let text = table(name, positioning, &columns);
    let notes = notes(name, positioning, others);
    Ok(ExportFile::new(format!("{name}.COM"), text, notes))
}

fn columns<'a>(
    positioning: &'a AxisErrors,
    others: &'a [CrossErrors],
) -> Result<Vec<Column<'a>>, ExportError> {
    let axis = positioning.axis();
    let column = |name: &str, direction, values| Column {
        name: name.to_owned(),
        direction,
        values,
    };
    let mut columns = Vec::new();
    let differ = positioning
        .up()
        .iter()
        .zip(positioning.down())
        .any(|(up, down)| (up - down).abs() > SAME);
    if differ {
        columns.push(column("BACKLASH", axis, positioning.down()));
    }
    columns.push(column(axis.letter(), axis, positioning.up()));
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
        columns.push(column(&name, errors.direction(), errors.error()));
    }
    Ok(columns)
}

fn check_steepness(axis: Axis, position: &[f64], column: &Column) -> Result<(), ExportError> {
    let steps = position.windows(2).zip(column.values.windows(2));
    for (at, value) in steps {
        let spacing = mm_or_deg(axis, at[1] - at[0]);
        let difference = mm_or_deg(column.direction, value[1] - value[0]);
        if difference.abs() > spacing * STEEPEST {
            return Err(ExportError::BeyondLimit {
                control: CONTROL,
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
            // (1)
            let value = number(column.direction, column.values[row]);
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

fn notes(name: &str, positioning: &AxisErrors, others: &[CrossErrors]) -> Vec<String> {
    let axis = positioning.axis();
    let mut notes = vec![
        format!("HEIDENHAIN compensation table of axis {axis}; AXISPOS in {} against the machine datum; lengths mm, angles deg", unit(axis)),
        "value = error with its own sign (actual - commanded), positive when the travel is too long; DERIVED for the table from the error curve that the manuals show: verify before use".to_owned(),
        "layout of the text file is DERIVED from HEIDENHAIN's text tables".to_owned(),
        format!("enter {name}.COM in config.CMA for axis {axis} and make the line active"),
        "BACKLASH, where present, holds the positioning values measured in the negative direction".to_owned(),
    ];
    for errors in others {
        let n = errors.direction().index() + 1;
        notes.push(format!(
            "C{n} holds {}: it acts through an entry {name}.C{n} in column COMPTAB of the kinematic table",
            errors.names()
        ));
    }
    notes
}
