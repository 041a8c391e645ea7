//! What a control is set up for.

use std::str::FromStr;

use clap::Args;
use machine::export::fanuc::Record;
use machine::export::linuxcnc::FileType;
use machine::export::selection::{Control, Fanuc, Sinumerik};
use machine::export::sinumerik::OtherAxes;
use metrology::{Axis, PerAxis};

use super::Format;
use crate::usage::above_zero;

/// `AXIS=NUMBER`; `kind` says what is taken as a number.
pub(super) fn of_axis<N: FromStr>(text: &str, kind: &str) -> Result<(Axis, N), String> {
    let (axis, number) = text.split_once('=').ok_or("must be AXIS=NUMBER")?;
    let axis = axis.parse::<Axis>().map_err(|error| error.to_string())?;
    let number = number.parse();
    Ok((axis, number.map_err(|_| format!("must be {kind}"))?))
}

/// The number of a point of an axis.
fn point_number(text: &str) -> Result<(Axis, u32), String> {
    of_axis(text, "a whole number, 0 or above")
}

/// Numbers of the control's set-up.
#[derive(Args)]
pub(super) struct SetUp {
    /// LinuxCNC: `COMP_FILE_TYPE`.
    #[arg(long, default_value_t = 0, value_parser = clap::value_parser!(u8).range(0..=1))]
    file_type: u8,
    /// SINUMERIK: points of a table (MD38000, MD18342).
    #[arg(long, default_value_t = 200)]
    max_points: usize,
    /// SINUMERIK: cross-axis tables.
    #[arg(long, default_value_t = 8)]
    max_tables: usize,
    /// SINUMERIK: greatest sum of cross-axis compensations (MD32720), mm.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true, value_parser = above_zero)]
    max_sum_mm: f64,
    /// SINUMERIK: greatest slope of the temperature compensation, mm/mm.
    #[arg(long, default_value_t = 1e-3, allow_negative_numbers = true, value_parser = above_zero)]
    max_slope: f64,
    /// SINUMERIK: positioning as two cross-axis tables, one for each direction.
    #[arg(long)]
    each_direction: bool,
    /// SINUMERIK: leave out drift that depends on other axes instead of refusing the axis.
    #[arg(long)]
    leave_out_other_axes: bool,
    /// FANUC: number of an axis' reference point such as X=40 (parameter 3620); others: 100 times the axis' place, and 100.
    #[arg(long, value_parser = point_number)]
    reference_number: Vec<(Axis, u32)>,
    /// FANUC: detection unit, um or 0.001 deg.
    #[arg(long, default_value_t = 1.0, allow_negative_numbers = true, value_parser = above_zero)]
    detection_unit: f64,
    /// FANUC: magnification (parameter 3623).
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..=100))]
    magnification: u32,
    /// FANUC: greatest size of one value, pulses.
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..))]
    max_pulses: u32,
    /// FANUC: greatest number of a point.
    #[arg(long, default_value_t = 1023)]
    max_number: u32,
    /// FANUC: mark pitch data with Q0 as series 30i and later do.
    #[arg(long)]
    marked: bool,
}

/// mm as they are, degrees as rad.
pub(super) fn inner(axis: Axis, value: f64) -> f64 {
    if axis.is_linear() {
        value
    } else {
        value.to_radians()
    }
}

/// A fraction of a millimetre or of a degree.
const THOUSANDTH: f64 = 1e-3;

impl SetUp {
    /// The control with its set-up.
    pub fn control(&self, format: Format) -> Control {
        match format {
            Format::Linuxcnc if self.file_type == 0 => Control::LinuxCnc(FileType::ActualPosition),
            Format::Linuxcnc => Control::LinuxCnc(FileType::Offset),
            Format::Sinumerik => Control::Sinumerik(self.sinumerik()),
            Format::Heidenhain => Control::Heidenhain,
            Format::Fanuc => Control::Fanuc(self.fanuc()),
            Format::Csv => Control::Csv,
        }
    }

    fn sinumerik(&self) -> Sinumerik {
        Sinumerik {
            names: PerAxis::from_fn(|axis| format!("{axis}1")),
            max_points: self.max_points,
            max_tables: self.max_tables,
            max_cross_points: self.max_points,
            max_sum: self.max_sum_mm,
            max_slope: self.max_slope,
            for_each_direction: self.each_direction,
            other_axes: if self.leave_out_other_axes {
                OtherAxes::LeaveOut
            } else {
                OtherAxes::Refuse
            },
        }
    }

    fn fanuc(&self) -> Fanuc {
        let mut reference_number = PerAxis::from_fn(|axis| 100 * axis.index() as u32 + 100);
        for (axis, number) in &self.reference_number {
            reference_number[*axis] = *number;
        }
        Fanuc {
            reference_number,
            detection_unit: PerAxis::from_fn(|axis| inner(axis, self.detection_unit * THOUSANDTH)),
            magnification: self.magnification,
            max_pulses: self.max_pulses,
            max_number: self.max_number,
            record: if self.marked {
                Record::Marked
            } else {
                Record::Plain
            },
        }
    }
}
