//! Cross-axis tables, `$AN_CEC`: straightness, squareness and sag of one axis corrected by another.
//!
//! Input axis of a table is the axis on whose *setpoint* the error depends, output axis the one in whose
//! direction it points; both may be the same axis, and a table may count for one direction of travel only,
//! which together gives a leadscrew table for each direction (4.4.4.3 of \[2\] in the module above).

use super::super::axis_errors::{AxisErrors, check_count, equal_spacing};
use super::super::cross_errors::CrossErrors;
use super::super::error::ExportError;
use super::super::file::{ExportFile, comments};
use super::super::number::{fixed, mm_or_deg, unit};
use super::super::sign::{Sign, check, proven};
use super::{POSITION_DECIMALS, VALUE_DECIMALS, check_name};
use metrology::Axis;

const CROSS_TABLE: &str = "SINUMERIK $AN_CEC";
/// (1) of the module above.
const SIGN: Sign = Sign::Minus;
const CROSS_TABLE_PROOF: &str = "SINUMERIK 840D sl Function Manual Extended Functions, 03/2009, 6FC5397-1BP10-4BA0, K3 5.4.3 p. 372 (additional setpoint; a positive compensation value moves the axis in the negative direction): value = +error";

/// Directions of the input axis in which a table counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Traverse {
    /// Both.
    Both,
    /// Towards greater positions.
    Up,
    /// Towards smaller positions.
    Down,
}

/// What the control's set-up says.
#[derive(Clone, Debug, PartialEq)]
pub struct CrossTable {
    /// Index of the (first) table, from 0.
    pub table: usize,
    /// Tables that exist; 8 on an 828D.
    pub max_tables: usize,
    /// Points that fit into one: MD18342 `$MN_MM_CEC_MAX_POINTS`; 200 on an 828D.
    pub max_points: usize,
    /// Name of the machine axis on whose setpoint the error depends.
    pub input_axis: String,
    /// Name of the machine axis that is moved.
    pub output_axis: String,
    /// Greatest size of the sum of compensations of the output axis, MD32720 `$MA_CEC_MAX_SUM`, mm or rad.
    pub max_sum: f64,
}

/// One table that counts in both directions.
///
/// # Errors
/// Unequal spacing, more points or tables than fit, a value beyond MD32720, a name that cannot be.
pub fn cross_table(errors: &CrossErrors, set_up: &CrossTable) -> Result<ExportFile, ExportError> {
    let rows = Rows {
        base: errors.base(),
        direction: errors.direction(),
        position: errors.position(),
        error: errors.error(),
    };
    let table = rows.table(set_up, set_up.table, Traverse::Both)?;
    Ok(program(
        &[table],
        set_up,
        (errors.base(), &errors.names()),
        &[],
    ))
}

/// Two tables of one axis on itself: errors up and errors down.
///
/// # Errors
/// As [`cross_table`].
pub fn direction_tables(
    errors: &AxisErrors,
    set_up: &CrossTable,
) -> Result<ExportFile, ExportError> {
    let axis = errors.axis();
    let of = |error, table, traverse| {
        let rows = Rows {
            base: axis,
            direction: axis,
            position: errors.position(),
            error,
        };
        rows.table(set_up, table, traverse)
    };
    let tables = [
        of(errors.up(), set_up.table, Traverse::Up)?,
        of(errors.down(), set_up.table + 1, Traverse::Down)?,
    ];
    Ok(program(
        &tables,
        set_up,
        (axis, "positioning, a table for each direction"),
        errors.remarks(),
    ))
}

/// The numbers of one table.
struct Rows<'a> {
    base: Axis,
    direction: Axis,
    position: &'a [f64],
    error: &'a [f64],
}

impl Rows<'_> {
    fn check(&self, set_up: &CrossTable, table: usize) -> Result<f64, ExportError> {
        check_name(CROSS_TABLE, &set_up.input_axis)?;
        check_name(CROSS_TABLE, &set_up.output_axis)?;
        if table >= set_up.max_tables {
            let (control, quantity, value) = (CROSS_TABLE, "table", table as f64);
            let rule = "the control has fewer tables";
            return Err(ExportError::Setting {
                control,
                quantity,
                value,
                rule,
            });
        }
        if !(set_up.max_sum.is_finite() && set_up.max_sum > 0.0) {
            let (control, quantity, value) = (CROSS_TABLE, "max_sum", set_up.max_sum);
            let rule = "must be a finite number above 0";
            return Err(ExportError::Setting {
                control,
                quantity,
                value,
                rule,
            });
        }
        check_count(
            CROSS_TABLE,
            self.base,
            self.position.len(),
            set_up.max_points,
        )?;
        for (position, error) in self.position.iter().zip(self.error) {
            if error.abs() > set_up.max_sum {
                return Err(ExportError::BeyondLimit {
                    control: CROSS_TABLE,
                    axis: self.direction,
                    position: *position,
                    value: mm_or_deg(self.direction, *error),
                    limit: mm_or_deg(self.direction, set_up.max_sum),
                    unit: unit(self.direction),
                });
            }
        }
        equal_spacing(CROSS_TABLE, self.base, self.position)
    }

    fn table(
        &self,
        set_up: &CrossTable,
        table: usize,
        traverse: Traverse,
    ) -> Result<String, ExportError> {
        let spacing = self.check(set_up, table)?;
        let mut text = String::new();
        for (n, error) in self.error.iter().enumerate() {
            let value = mm_or_deg(self.direction, SIGN.value_of(*error));
            let value = fixed(value, VALUE_DECIMALS);
            text.push_str(&format!("$AN_CEC[{table},{n}]={value}\n"));
        }
        let (input, output) = (&set_up.input_axis, &set_up.output_axis);
        text.push_str(&format!("$AN_CEC_INPUT_AXIS[{table}]=({input})\n"));
        text.push_str(&format!("$AN_CEC_OUTPUT_AXIS[{table}]=({output})\n"));
        let last = self.position.len() - 1;
        let numbers = [
            ("STEP", spacing),
            ("MIN", self.position[0]),
            ("MAX", self.position[last]),
        ];
        for (name, value) in numbers {
            let value = fixed(mm_or_deg(self.base, value), POSITION_DECIMALS);
            text.push_str(&format!("$AN_CEC_{name}[{table}]={value}\n"));
        }
        let direction = match traverse {
            Traverse::Both => 0,
            Traverse::Up => 1,
            Traverse::Down => -1,
        };
        text.push_str(&format!("$AN_CEC_DIRECTION[{table}]={direction}\n"));
        text.push_str(&format!("$AN_CEC_MULT_BY_TABLE[{table}]=0\n"));
        text.push_str(&format!("$AN_CEC_IS_MODULO[{table}]=0\n"));
        Ok(text)
    }
}

fn program(
    tables: &[String],
    set_up: &CrossTable,
    (base, what): (Axis, &str),
    remarks: &[String],
) -> ExportFile {
    let (input, output) = (&set_up.input_axis, &set_up.output_axis);
    let mut notes = vec![
        format!("SINUMERIK cross-axis compensation of {output} by the setpoint of {input}: {what}"),
        format!(
            "positions in {} of {input}, values in mm (degrees where {output} is rotary)",
            unit(base)
        ),
        proven(CROSS_TABLE_PROOF),
        check(&format!(
            "write 0.010 at one node and 0 elsewhere, move {input} to that node, read a dial gauge along {output} with the table off and on: it must move by 10 um towards smaller {output}"
        )),
        format!(
            "load with MD32710[{output}]=0, then set it to 1, and SD41300 $SN_CEC_TABLE_ENABLE of table {}",
            set_up.table
        ),
    ];
    notes.extend_from_slice(remarks);
    let mut text = "%_N_NC_CEC_INI\nCHANDATA(1)\n".to_owned();
    text.push_str(&comments(";", &notes));
    for table in tables {
        text.push_str(table);
    }
    text.push_str("M17\n");
    let name = format!("NC_CEC_{}_{output}_{input}.INI", set_up.table);
    ExportFile::new(name, text, notes)
}
