//! What each control takes of the errors of a machine.

use metrology::{Axis, PerAxis};

use super::super::axis_errors::AxisErrors;
use super::super::cross_errors::CrossErrors;
use super::super::file::ExportFile;
use super::super::grid::Grid;
use super::super::linuxcnc::FileType;
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
}

/// For whom.
#[derive(Clone, Debug, PartialEq)]
pub enum Control {
    /// `COMP_FILE` of this type.
    LinuxCnc(FileType),
    /// Error tables, cross-axis tables, temperature parameters.
    Sinumerik(Sinumerik),
    /// `.COM` tables.
    Heidenhain,
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
            Self::Heidenhain => "HEIDENHAIN",
            Self::Fanuc(_) => "FANUC",
            Self::Csv => "CSV",
        }
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
        Control::Heidenhain => {
            for axis in wanted.axes.iter() {
                heidenhain_axis(errors, axis, wanted, selected);
            }
        }
        Control::Fanuc(set_up) => {
            for own in &errors.positioning {
                let file = fanuc_file(own, wanted, set_up);
                selected.take_positioning(own, file);
            }
        }
        Control::Csv => {
            if !(errors.positioning.is_empty() && errors.cross.is_empty()) {
                selected
                    .files
                    .push(csv::table(&errors.positioning, &errors.cross));
                for own in &errors.positioning {
                    selected.positioning[own.axis()] = Some(own.span());
                }
            }
        }
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
    if let (Some(model), false) = (&measured.thermal, matches!(control, Control::Sinumerik(_))) {
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
            };
            selected.take(
                &format!("drift of {axis}"),
                temperature(model, axis, &set_up),
            );
        }
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
            file.map(|file| for_both(own, "MD32450 $MA_BACKLASH", file))
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

fn fanuc_file(
    own: &AxisErrors,
    wanted: &Wanted,
    set_up: &Fanuc,
) -> Result<ExportFile, super::ExportError> {
    let axis = own.axis();
    let table = fanuc::PitchTable {
        reference_number: set_up.reference_number[axis],
        reference: wanted.reference[axis],
        detection_unit: set_up.detection_unit[axis],
        magnification: set_up.magnification,
        max_pulses: set_up.max_pulses,
        max_number: set_up.max_number,
        record: set_up.record,
    };
    let file = fanuc::pitch_table(&own.mean(), &table)?;
    Ok(for_both(own, "parameters 1851 and 1852", file))
}

/// One table for an axis: its columns need common points.
fn heidenhain_axis(errors: &Errors, axis: Axis, wanted: &Wanted, selected: &mut Selected) {
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
        let own = own.on_grid(&grid)?;
        let others: Vec<CrossErrors> = others
            .iter()
            .map(|c| c.on_grid(&grid))
            .collect::<Result<_, _>>()?;
        heidenhain::compensation_table(&format!("{axis}_AXIS"), &own, &others)
    });
    selected.take_positioning(own, file);
}
