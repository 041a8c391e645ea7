//! Temperature compensation: the line of the drift as setting data 43900, 43910 and 43920.
//!
//! ```text
//!   K(P) = SD43900 + SD43910 (P - SD43920)                                   (1)
//!   d(p) = k0 + slope (p - p0),   e(p) = -d(p),   K = -e or +e               (2)
//! ```
//!
//! d is the drift of the *reading* of a fixed place: where the control now reads p + d it stands at p, so its error
//! is -d. K is what undoes e by the sign that the user gives, since no page seen says it: where a positive K moves the axis towards smaller
//! positions, K = e (absolute value -k0, slope -slope), else K = -e; reference position p0 in both.
//! (1) is the line of \[4\]; that 43900 is its absolute value, 43910 its slope and 43920 its reference is in the
//! description of MD32750 (SINUMERIK 808D ADVANCED Parameter Manual, p. 252).

use super::super::error::ExportError;
use super::super::file::{ExportFile, comments};
use super::super::number::fixed;
use super::super::sign::{Sign, check, given};
use super::check_name;
use metrology::Axis;
use metrology::epoch::utc;
use metrology::sample::ThermalModel;

const TEMPERATURE_TABLE: &str = "SINUMERIK temperature compensation";
/// One step at the machine that shows the sign.
const TEMPERATURE_CHECK: &str = "with the axis at rest and MD32750 = 1 enter SD43900 $SA_TEMP_COMP_ABS_VALUE = 0.010 and read a dial gauge along the axis: the display stays and the dial moves by 10 um, towards greater positions: --sign plus, towards smaller ones: --sign minus; then set it back to 0";
const SLOPE_DECIMALS: usize = 9;
const VALUE_DECIMALS: usize = 6;

/// What to do with a drift that changes with other axes too.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OtherAxes {
    /// It is an error: the parameters hold at one place only.
    Refuse,
    /// Leave that part out: the line is the drift at the origin of the cross terms.
    LeaveOut,
}

/// What the control's set-up says.
#[derive(Clone, Debug, PartialEq)]
pub struct Temperature {
    /// Name of the machine axis, such as `X1`.
    pub machine_axis: String,
    /// Greatest slope that MD32760 `$MA_COMP_ADD_VELO_FACTOR` leaves, mm/mm.
    pub max_slope: f64,
    /// What to do with cross terms.
    pub other_axes: OtherAxes,
    /// Which way a positive value moves the axis; none: nobody has tried it.
    pub sign: Option<Sign>,
}

/// A subprogram that sets the parameters of one axis.
///
/// # Errors
/// No sign given; a model in quarantine, without this axis, or whose offset is not identifiable; a slope that is too great;
/// cross terms (unless left out); numbers that are none. A slope that is not identifiable is zero in the model
/// by definition, and only the shift is exported, which the notes say.
pub fn temperature(
    model: &ThermalModel,
    axis: Axis,
    set_up: &Temperature,
) -> Result<ExportFile, ExportError> {
    check_name(TEMPERATURE_TABLE, &set_up.machine_axis)?;
    if !axis.is_linear() {
        return Err(ExportError::NotLinear {
            control: TEMPERATURE_TABLE,
            axis,
        });
    }
    let sign = set_up.sign.ok_or(ExportError::SignUnproven {
        control: TEMPERATURE_TABLE,
        check: TEMPERATURE_CHECK,
    })?;
    if model.quarantined {
        return Err(ExportError::Quarantined { axis });
    }
    let not = |part| ExportError::DriftNotIdentifiable { axis, part };
    let drift = model.axes[axis].ok_or_else(|| not("offset"))?;
    if !drift.offset_identifiable {
        return Err(not("offset"));
    }
    let slope = if drift.slope_identifiable {
        drift.slope_mm_per_mm
    } else {
        0.0
    };
    let numbers = [("k0", drift.k0_mm), ("slope", slope), ("p0", drift.p0_mm)];
    for (quantity, value) in numbers {
        if !value.is_finite() {
            return Err(ExportError::NotFinite {
                axis,
                quantity,
                index: 0,
                value,
            });
        }
    }
    check_slope(axis, slope, drift.p0_mm, set_up.max_slope)?;
    for other in Axis::LINEAR {
        let slope = drift.cross_slope_mm_per_mm[other.index()];
        let counts = other != axis && slope.abs() > 0.0;
        if (counts || !slope.is_finite()) && set_up.other_axes == OtherAxes::Refuse {
            return Err(ExportError::DriftOfOtherAxis {
                control: TEMPERATURE_TABLE,
                axis,
                other,
                slope,
            });
        }
    }
    let value = [-drift.k0_mm, -slope].map(|error| sign.value_of(error)); // (2)
    let line = Line {
        absolute_mm: value[0],
        slope: value[1],
        reference_mm: drift.p0_mm,
        slope_identifiable: drift.slope_identifiable,
    };
    Ok(program(model, axis, (set_up, sign), &line))
}

fn check_slope(axis: Axis, slope: f64, position: f64, limit: f64) -> Result<(), ExportError> {
    if !(limit.is_finite() && limit > 0.0) {
        let (control, quantity, value) = (TEMPERATURE_TABLE, "max_slope", limit);
        let rule = "must be a finite number above 0";
        return Err(ExportError::Setting {
            control,
            quantity,
            value,
            rule,
        });
    }
    if slope.abs() > limit {
        let (control, value, unit) = (TEMPERATURE_TABLE, slope, "mm/mm");
        return Err(ExportError::BeyondLimit {
            control,
            axis,
            position,
            value,
            limit,
            unit,
        });
    }
    Ok(())
}

/// (1), mm and mm/mm.
struct Line {
    absolute_mm: f64,
    slope: f64,
    reference_mm: f64,
    slope_identifiable: bool,
}

fn program(
    model: &ThermalModel,
    axis: Axis,
    (set_up, sign): (&Temperature, Sign),
    line: &Line,
) -> ExportFile {
    let name = &set_up.machine_axis;
    let mut notes = vec![
        format!("SINUMERIK temperature compensation of axis {axis} ({name}), mm and mm/mm"),
        given(sign),
        check(TEMPERATURE_CHECK),
        format!("set MD32750[{name}] = 3 once; MD32760 limits how fast a change is travelled"),
        format!(
            "fitted at {}, may be used until {} of the host's clock: a drift is of its hour",
            utc(model.at),
            utc(model.valid_until)
        ),
    ];
    if !line.slope_identifiable {
        notes.push("the slope was not identifiable and is 0: a pure shift".to_owned());
    }
    let mut text = format!("%_N_ABBE_TC_{name}_SPF\n");
    text.push_str(&comments(";", &notes));
    let data = [
        ("ABS_VALUE", fixed(line.absolute_mm, VALUE_DECIMALS)),
        ("SLOPE", fixed(line.slope, SLOPE_DECIMALS)),
        ("REF_POSITION", fixed(line.reference_mm, VALUE_DECIMALS)),
    ];
    for (datum, value) in data {
        text.push_str(&format!("$SA_TEMP_COMP_{datum}[{name}]={value}\n"));
    }
    text.push_str("M17\n");
    ExportFile::new(format!("ABBE_TC_{name}.SPF"), text, notes)
}
