//! The leadscrew or measuring-system error table of one axis, `$AA_ENC_COMP`.

use super::super::axis_errors::{AxisErrors, check_count, equal_spacing};
use super::super::error::ExportError;
use super::super::file::{ExportFile, comments};
use super::super::number::{fixed, mm_or_deg, unit};
use super::super::sign::{Sign, check, proven};
use super::{POSITION_DECIMALS, VALUE_DECIMALS, check_name};

const ENCODER_TABLE: &str = "SINUMERIK $AA_ENC_COMP";
/// (1) of the module above.
const SIGN: Sign = Sign::Minus;
const ENCODER_TABLE_PROOF: &str = "SINUMERIK 840D sl / 828D Function Manual Extended Functions, 03/2013, 6FC5397-1BP40-3BA1, K3 4.4.2.1 p. 238 (a positive compensation value moves the axis in the negative direction): value = +error";

/// What the control's set-up says.
#[derive(Clone, Debug, PartialEq)]
pub struct EncoderTable {
    /// Name of the machine axis, such as `X1` or `AX1`.
    pub machine_axis: String,
    /// Measuring system, 0 or 1.
    pub encoder: u8,
    /// Points that fit: MD38000 `$MA_MM_ENC_COMP_MAX_POINTS`.
    pub max_points: usize,
    /// Position of the reference point, mm or rad.
    pub reference: f64,
}

/// The file `AX_EEC.INI` for an axis.
///
/// # Errors
/// Unequal spacing, more points than fit, directions that differ, an error at the reference point that is not
/// zero when rounded, a name or measuring system that cannot be.
pub fn encoder_table(
    errors: &AxisErrors,
    set_up: &EncoderTable,
) -> Result<ExportFile, ExportError> {
    check_name(ENCODER_TABLE, &set_up.machine_axis)?;
    let axis = errors.axis();
    if set_up.encoder > 1 {
        let value = f64::from(set_up.encoder);
        let rule = "must be 0 or 1";
        return Err(ExportError::Setting {
            control: ENCODER_TABLE,
            quantity: "encoder",
            value,
            rule,
        });
    }
    check_count(
        ENCODER_TABLE,
        axis,
        errors.position().len(),
        set_up.max_points,
    )?;
    let spacing = equal_spacing(ENCODER_TABLE, axis, errors.position())?;
    let error = errors.of_both_directions(ENCODER_TABLE)?;
    check_reference(errors, set_up.reference)?;

    let index = format!("{},{}", set_up.encoder, set_up.machine_axis);
    let mut text = "%_N_AX_EEC_INI\nCHANDATA(1)\n".to_owned();
    let mut notes = notes(errors, set_up);
    notes.extend_from_slice(errors.remarks());
    text.push_str(&comments(";", &notes));
    for (n, e) in error.iter().enumerate() {
        let value = fixed(mm_or_deg(axis, SIGN.value_of(*e)), VALUE_DECIMALS);
        let (encoder, name) = (set_up.encoder, &set_up.machine_axis);
        text.push_str(&format!("$AA_ENC_COMP[{encoder},{n},{name}]={value}\n"));
    }
    let (least, greatest) = errors.span();
    for (name, value) in [("STEP", spacing), ("MIN", least), ("MAX", greatest)] {
        let value = fixed(mm_or_deg(axis, value), POSITION_DECIMALS);
        text.push_str(&format!("$AA_ENC_COMP_{name}[{index}]={value}\n"));
    }
    text.push_str(&format!("$AA_ENC_COMP_IS_MODULO[{index}]=0\nM17\n"));
    let name = format!("AX_EEC_{}.INI", set_up.machine_axis);
    Ok(ExportFile::new(name, text, notes))
}

fn check_reference(errors: &AxisErrors, reference: f64) -> Result<(), ExportError> {
    let axis = errors.axis();
    if !reference.is_finite() {
        let (quantity, index, value) = ("reference", 0, reference);
        return Err(ExportError::NotFinite {
            axis,
            quantity,
            index,
            value,
        });
    }
    let error = errors.mean_at(reference);
    let rounded = fixed(mm_or_deg(axis, error), VALUE_DECIMALS);
    if rounded.bytes().any(|c| (b'1'..=b'9').contains(&c)) {
        return Err(ExportError::ReferenceNotZero {
            control: ENCODER_TABLE,
            axis,
            reference,
            error,
        });
    }
    Ok(())
}

fn notes(errors: &AxisErrors, set_up: &EncoderTable) -> Vec<String> {
    let axis = errors.axis();
    let name = &set_up.machine_axis;
    vec![
        format!(
            "SINUMERIK error table of axis {axis} ({name}), values and positions in {}",
            unit(axis)
        ),
        proven(ENCODER_TABLE_PROOF),
        check(&format!(
            "write 0.010 at one node and 0 elsewhere, move {name} to that node, read a dial gauge along {name} with the table off and on: it must move by 10 um towards smaller {name}"
        )),
        format!(
            "load with MD32700[{}]=0, then set it to 1; MD38000 >= {}",
            set_up.encoder,
            errors.position().len()
        ),
    ]
}
