//! What each control takes of the errors of a machine.

use metrology::sample::ThermalModel;
use metrology::{Axis, PerAxis};

use super::super::axis_errors::AxisErrors;
use super::super::cross_errors::CrossErrors;
use super::super::error::ExportError;
use super::super::file::ExportFile;
use super::super::grid::Grid;
use super::super::linuxcnc::FileType;
use super::super::plausible;
use super::super::sign::Sign;
use super::super::sinumerik::{
    CrossTable, EncoderTable, OtherAxes, Temperature, cross_table, direction_tables, encoder_table,
    temperature,
};
use super::super::{csv, fanuc, heidenhain, linuxcnc};
use super::{Errors, Measured, Reason, Selected, Wanted};

/// Numbers of a SINUMERIK's set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct Sinumerik {
    /// Name of each machine axis.
    pub names: PerAxis<String>,
    /// Points of an error table, MD38000.
    pub max_points: usize,
    /// Number of cross-axis tables.
    pub max_tables: usize,
    /// Points of a cross-axis table, MD18342.
    pub max_cross_points: usize,
    /// Greatest sum of cross-axis compensations, MD32720, mm or rad.
    pub max_sum: f64,
    /// Greatest slope of the temperature compensation, mm/mm.
    pub max_slope: f64,
    /// Positioning as two cross-axis tables, one for each direction, instead of one error table for both.
    pub for_each_direction: bool,
    /// What to do with drift that depends on other axes.
    pub other_axes: OtherAxes,
    /// Which way a positive value of the temperature compensation moves an axis; none: nobody has tried it, and the drift is left out.
    pub temperature_sign: Option<Sign>,
}

/// Which pitch error tables a FANUC axis gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PitchTables {
    /// Two where the lost motion varies along the axis by more than the backlash parameters can undo, else one.
    AsMeasured,
    /// One, the mean of both directions.
    One,
    /// One for each direction.
    Two,
}

/// Numbers of a FANUC's set-up.
#[derive(Clone, Debug, PartialEq)]
pub struct Fanuc {
    /// Number of the reference point of each axis, parameter 3620.
    pub reference_number: PerAxis<u32>,
    /// Detection unit of each axis, mm or rad.
    pub detection_unit: PerAxis<f64>,
    /// Magnification, parameter 3623.
    pub magnification: u32,
    /// Greatest size of one value, pulses.
    pub max_pulses: u32,
    /// Greatest number of a point.
    pub max_number: u32,
    /// Kind of record.
    pub record: fanuc::Record,
    /// Which tables.
    pub tables: PitchTables,
    /// Which way a positive value moves an axis; none: nobody has tried it, and nothing is written.
    pub sign: Option<Sign>,
}

/// For whom.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    /// `COMP_FILE` of this type.
    LinuxCnc(FileType),
    /// Error tables, cross-axis tables, temperature parameters.
    Sinumerik(Sinumerik),
    /// `.COM` tables, and which way a positive value moves an axis; none: nobody has tried it, and nothing is written.
    Heidenhain(Option<Sign>),
    /// Stored pitch error tables.
    Fanuc(Fanuc),
    /// One plain table.
    Csv,
}

impl Control {
    const fn name(&self) -> &'static str {
        match self {
            Self::LinuxCnc(_) => "LinuxCNC",
            Self::Sinumerik(_) => "SINUMERIK",
            Self::Heidenhain(_) => "HEIDENHAIN",
            Self::Fanuc(_) => "FANUC",
            Self::Csv => "CSV",
        }
    }

    /// Why this control can be given no table at all: nobody knows the sign, and how it is found.
    #[must_use]
    pub fn without_sign(&self) -> Option<ExportError> {
        let (control, check) = match self {
            Self::Heidenhain(None) => (heidenhain::HEIDENHAIN_TABLE, heidenhain::HEIDENHAIN_CHECK),
            Self::Fanuc(Fanuc { sign: None, .. }) => (fanuc::FANUC_TABLE, fanuc::FANUC_CHECK),
            _ => return None,
        };
        Some(ExportError::SignUnproven { control, check })
    }
}

pub(super) fn write(
    errors: &Errors,
    measured: &Measured,
    wanted: &Wanted,
    control: &Control,
    selected: &mut Selected,
) {
    match control {
        Control::LinuxCnc(file_type) => {
            for own in &errors.positioning {
                let file = linuxcnc::compensation_file(own, *file_type);
                selected.take_positioning(own, file);
            }
        }
        Control::Sinumerik(set_up) => sinumerik(errors, wanted, set_up, selected),
        Control::Heidenhain(sign) => {
            for axis in wanted.axes.iter() {
                heidenhain_axis(errors, (axis, *sign), wanted, selected);
            }
        }
        Control::Fanuc(set_up) => {
            let mut taken = Vec::new();
            for own in &errors.positioning {
                let file = fanuc_file(own, wanted, set_up, &mut taken);
                selected.take_positioning(own, file);
            }
        }
        Control::Csv => csv_file(errors, measured, wanted, selected),
    }
    say_what_has_no_place(errors, measured, wanted, control, selected);
}

fn say_what_has_no_place(
    errors: &Errors,
    measured: &Measured,
    wanted: &Wanted,
    control: &Control,
    selected: &mut Selected,
) {
    let name = control.name();
    if matches!(control, Control::LinuxCnc(_) | Control::Fanuc(_)) {
        for cross in &errors.cross {
            selected.leave_out(cross.names(), no_place(cross, name));
        }
    }
    let takes_drift = matches!(control, Control::Sinumerik(_) | Control::Csv);
    if let (Some(model), false) = (&measured.thermal, takes_drift) {
        for axis in wanted
            .axes
            .iter()
            .filter(|axis| model.axes[*axis].is_some())
        {
            selected.leave_out(
                format!("drift of {axis}"),
                Reason::NoPlace { control: name },
            );
        }
    }
    if let (Some(model), Control::Sinumerik(set_up)) = (&measured.thermal, control) {
        for axis in wanted
            .axes
            .iter()
            .filter(|axis| model.axes[*axis].is_some())
        {
            let set_up = Temperature {
                machine_axis: set_up.names[axis].clone(),
                max_slope: set_up.max_slope,
                other_axes: set_up.other_axes,
                sign: set_up.temperature_sign,
            };
            selected.take(
                &format!("drift of {axis}"),
                plausible_drift(model, axis).and_then(|()| temperature(model, axis, &set_up)),
            );
        }
    }
}

fn plausible_drift(model: &ThermalModel, axis: Axis) -> Result<(), ExportError> {
    match &model.axes[axis] {
        Some(drift) => plausible::drift(axis, drift),
        None => Ok(()),
    }
}

fn no_place(cross: &CrossErrors, control: &'static str) -> Reason {
    if cross.direction().is_linear() {
        Reason::NoPlace { control }
    } else {
        Reason::Angular { control }
    }
}

/// Both directions in one table; what that leaves is said.
fn for_both(errors: &AxisErrors, parameter: &str, mut file: ExportFile) -> ExportFile {
    let reversal = errors.mean_reversal();
    if reversal.abs() > 0.0 {
        let unit = if errors.axis().is_linear() {
            "mm"
        } else {
            "rad"
        };
        file.notes.push(format!(
            "mean of both directions: errors up and down differ by {reversal:.6} {unit} on average, which belongs into {parameter}"
        ));
    }
    file
}

fn sinumerik(errors: &Errors, wanted: &Wanted, set_up: &Sinumerik, selected: &mut Selected) {
    let mut table = 0;
    let mut next = |base: Axis, direction: Axis, tables: usize| {
        let first = table;
        table += tables;
        CrossTable {
            table: first,
            max_tables: set_up.max_tables,
            max_points: set_up.max_cross_points,
            input_axis: set_up.names[base].clone(),
            output_axis: set_up.names[direction].clone(),
            max_sum: set_up.max_sum,
        }
    };
    for own in &errors.positioning {
        let axis = own.axis();
        let file = if set_up.for_each_direction {
            direction_tables(own, &next(axis, axis, 2))
        } else {
            let encoder = EncoderTable {
                machine_axis: set_up.names[axis].clone(),
                encoder: 0,
                max_points: set_up.max_points,
                reference: wanted.reference[axis],
            };
            let file = encoder_table(&own.mean(), &encoder);
            file.map(|file| for_both(own, "MD32450 $MA_BACKLASH (positive where the encoder leads the machine part: SINUMERIK 808D ADVANCED Parameter Manual, 08/2013, p. 228)", file))
        };
        selected.take_positioning(own, file);
    }
    for cross in &errors.cross {
        if cross.direction().is_linear() {
            let set_up = next(cross.base(), cross.direction(), 1);
            selected.take(&cross.names(), cross_table(cross, &set_up));
        } else {
            selected.leave_out(
                cross.names(),
                Reason::Angular {
                    control: "SINUMERIK",
                },
            );
        }
    }
}

/// The record of an axis; `taken` are the numbers of the axes before it.
fn fanuc_file(
    own: &AxisErrors,
    wanted: &Wanted,
    set_up: &Fanuc,
    taken: &mut Vec<(Axis, fanuc::Numbers)>,
) -> Result<ExportFile, ExportError> {
    let axis = own.axis();
    let sign = set_up.sign.ok_or(ExportError::SignUnproven {
        control: fanuc::FANUC_TABLE,
        check: fanuc::FANUC_CHECK,
    })?;
    let table = fanuc::PitchTable {
        reference_number: set_up.reference_number[axis],
        reference: wanted.reference[axis],
        detection_unit: set_up.detection_unit[axis],
        magnification: set_up.magnification,
        max_pulses: set_up.max_pulses,
        max_number: set_up.max_number,
        record: set_up.record,
        sign,
    };
    let varies = fanuc::lost_motion_varies(own, &table);
    let two = match set_up.tables {
        PitchTables::AsMeasured => varies && set_up.magnification == 1,
        PitchTables::One => false,
        PitchTables::Two => true,
    };
    let mut pitch = if two {
        fanuc::two_way_tables(own, &table)?
    } else {
        let pitch = fanuc::pitch_table(&own.mean(), &table)?;
        fanuc::Pitch {
            file: for_both(own, "parameters 1851 and 1852", pitch.file),
            numbers: pitch.numbers,
        }
    };
    if varies && !two {
        pitch.file.notes.push("the lost motion varies along the axis by more than two pulses, which 1851 cannot undo: --pitch-tables two with magnification 1 makes a table for each direction".to_owned());
    }
    for numbers in &pitch.numbers {
        let mut both = taken
            .iter()
            .map(|(other, of)| (*other, numbers.0.max(of.0), numbers.1.min(of.1)));
        if let Some((other, number, _)) = both.find(|(_, from, to)| from <= to) {
            return Err(ExportError::NumberTaken {
                control: fanuc::FANUC_TABLE,
                axis,
                number,
                other,
            });
        }
    }
    taken.extend(pitch.numbers.iter().map(|numbers| (axis, *numbers)));
    Ok(pitch.file)
}

/// Everything that is known in one table.
fn csv_file(errors: &Errors, measured: &Measured, wanted: &Wanted, selected: &mut Selected) {
    let mut known = csv::Known::default();
    for model in measured.models() {
        for (index, curve) in model.curves.iter().enumerate() {
            if wanted.axes.contains(curve.component.of) {
                let spacing = super::spacing(wanted, curve.component.of);
                let covariance = csv::covariance_of(model, index);
                let added = plausible::curve(curve, spacing, &wanted.travels)
                    .and_then(|()| known.add_curve(curve, covariance.as_ref(), spacing));
                match added {
                    Ok(()) => selected.list(curve.component),
                    Err(why) => selected.leave_out(curve.component.to_string(), why),
                }
            }
        }
    }
    if let Some(model) = &measured.thermal {
        for axis in wanted.axes.iter().filter(|a| model.axes[*a].is_some()) {
            let added = plausible_drift(model, axis).and_then(|()| known.add_drift(model, axis));
            if let Err(why) = added {
                selected.leave_out(format!("drift of {axis}"), why);
            }
        }
    }
    if !(errors.positioning.is_empty() && errors.cross.is_empty() && known.is_empty()) {
        let file = csv::table(&errors.positioning, &errors.cross, &known);
        selected.files.push(file);
        for own in &errors.positioning {
            selected.positioning[own.axis()] = Some(own.span());
        }
    }
}

/// One table for an axis: its columns need common points.
fn heidenhain_axis(
    errors: &Errors,
    (axis, sign): (Axis, Option<Sign>),
    wanted: &Wanted,
    selected: &mut Selected,
) {
    let own = errors.positioning.iter().find(|own| own.axis() == axis);
    let others: Vec<&CrossErrors> = errors.cross.iter().filter(|c| c.base() == axis).collect();
    let Some(own) = own else {
        for cross in others {
            selected.leave_out(cross.names(), Reason::NoPositioning);
        }
        return;
    };
    let spans = others
        .iter()
        .map(|c| (c.position()[0], c.position()[c.position().len() - 1]));
    let span = spans.fold(own.span(), |a, b| (a.0.max(b.0), a.1.min(b.1)));
    let file = Grid::inside(axis, super::spacing(wanted, axis), span).and_then(|grid| {
        let sign = sign.ok_or(ExportError::SignUnproven {
            control: heidenhain::HEIDENHAIN_TABLE,
            check: heidenhain::HEIDENHAIN_CHECK,
        })?;
        let own = own.on_grid(&grid)?;
        let others: Vec<CrossErrors> = others
            .iter()
            .map(|c| c.on_grid(&grid))
            .collect::<Result<_, _>>()?;
        heidenhain::compensation_table(&format!("{axis}_AXIS"), &own, &others, sign)
    });
    selected.take_positioning(own, file);
}
