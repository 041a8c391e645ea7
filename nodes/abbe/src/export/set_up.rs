//! What a control is set up for.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use control_tables::Sign;
use control_tables::fanuc::Record;
use control_tables::linuxcnc::FileType;
use control_tables::selection::{Control, Fanuc, PitchTables, Sinumerik};
use control_tables::sinumerik::OtherAxes;
use metrology::{Axis, AxisSet, PerAxis};

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

/// Which way a positive value moves the axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Towards {
    /// A positive value moves the axis towards greater positions while its display stays.
    Plus,
    /// A positive value moves the axis towards smaller positions while its display stays.
    Minus,
}

/// Which pitch error tables an axis gets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Pitch {
    /// Two where the lost motion varies along the axis by more than two pulses, else one.
    Auto,
    /// One, the mean of both directions; the lost motion belongs into 1851 and 1852.
    One,
    /// One for each direction (3605#0, 3626, 3627).
    Two,
}

/// Numbers of the control's set-up.
#[derive(Clone, Args)]
pub(super) struct SetUp {
    /// HEIDENHAIN, FANUC, temperature compensation of SINUMERIK: which way a positive value of the table moves the axis, as tried on the machine.
    #[arg(long, value_enum)]
    sign: Option<Towards>,
    /// LinuxCNC: `COMP_FILE_TYPE`; without it 0.
    #[arg(long, value_parser = clap::value_parser!(u8).range(0..=1))]
    pub(super) file_type: Option<u8>,
    /// SINUMERIK: points of a table (MD38000, MD18342); without it 200.
    #[arg(long)]
    pub(super) max_points: Option<usize>,
    /// SINUMERIK: cross-axis tables; without it 8.
    #[arg(long)]
    pub(super) max_tables: Option<usize>,
    /// SINUMERIK: greatest sum of cross-axis compensations (MD32720), mm; without it 1.
    #[arg(long, allow_negative_numbers = true, value_parser = above_zero)]
    pub(super) max_sum_mm: Option<f64>,
    /// SINUMERIK: greatest slope of the temperature compensation, mm/mm; without it 0.001.
    #[arg(long, allow_negative_numbers = true, value_parser = above_zero)]
    pub(super) max_slope: Option<f64>,
    /// SINUMERIK: positioning as two cross-axis tables, one for each direction.
    #[arg(long)]
    pub(super) each_direction: bool,
    /// SINUMERIK: leave out drift that depends on other axes instead of refusing the axis.
    #[arg(long)]
    pub(super) leave_out_other_axes: bool,
    /// FANUC: number of an axis' reference point such as X=40 (parameter 3620); others: 100 times the axis' place, and 100.
    #[arg(long, value_parser = point_number)]
    pub(super) reference_number: Vec<(Axis, u32)>,
    /// FANUC: detection unit, um or 0.001 deg; without it 1.
    #[arg(long, allow_negative_numbers = true, value_parser = above_zero)]
    pub(super) detection_unit: Option<f64>,
    /// FANUC: magnification (parameter 3623); without it 1.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=100))]
    pub(super) magnification: Option<u32>,
    /// FANUC: greatest size of one value, pulses; without it 7.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) max_pulses: Option<u32>,
    /// FANUC: greatest number of a point; without it 1023.
    #[arg(long)]
    pub(super) max_number: Option<u32>,
    /// FANUC: mark pitch data with Q0 as series 30i and later do.
    #[arg(long)]
    pub(super) marked: bool,
    /// FANUC: pitch error tables of an axis; without it auto.
    #[arg(long, value_enum)]
    pub(super) pitch_tables: Option<Pitch>,
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
/// Defaults for a control.
const MAX_POINTS: usize = 200;
const MAX_TABLES: usize = 8;
const MAX_SUM_MM: f64 = 1.0;
const MAX_SLOPE: f64 = 1e-3;
const MAX_PULSES: u32 = 7;
const MAX_NUMBER: u32 = 1023;

impl SetUp {
    /// Every option that was given, with the format that it is of.
    fn given(&self) -> Vec<(&'static str, Format)> {
        let linuxcnc = [("--file-type", self.file_type.is_some())];
        let sinumerik = [
            ("--max-points", self.max_points.is_some()),
            ("--max-tables", self.max_tables.is_some()),
            ("--max-sum-mm", self.max_sum_mm.is_some()),
            ("--max-slope", self.max_slope.is_some()),
            ("--each-direction", self.each_direction),
            ("--leave-out-other-axes", self.leave_out_other_axes),
        ];
        let fanuc = [
            ("--reference-number", !self.reference_number.is_empty()),
            ("--detection-unit", self.detection_unit.is_some()),
            ("--magnification", self.magnification.is_some()),
            ("--max-pulses", self.max_pulses.is_some()),
            ("--max-number", self.max_number.is_some()),
            ("--marked", self.marked),
            ("--pitch-tables", self.pitch_tables.is_some()),
        ];
        let of = |format, options: &[(&'static str, bool)]| -> Vec<(&'static str, Format)> {
            let given = options.iter().filter(|(_, is_given)| *is_given);
            given.map(|(option, _)| (*option, format)).collect()
        };
        let mut all = of(Format::Linuxcnc, &linuxcnc);
        all.extend(of(Format::Sinumerik, &sinumerik));
        all.extend(of(Format::Fanuc, &fanuc));
        all
    }

    /// Refuses options that do nothing for a format or an axis.
    pub fn check(&self, format: Format, axes: AxisSet) -> Result<(), String> {
        if let Some((option, of)) = self.given().iter().find(|(_, of)| *of != format) {
            return Err(format!(
                "{option} is an option of --format {} and does nothing with --format {}: leave it out",
                of.name(),
                format.name()
            ));
        }
        if self.sign.is_some() && matches!(format, Format::Linuxcnc | Format::Csv) {
            return Err(format!(
                "--sign does nothing with --format {}: {}: leave it out",
                format.name(),
                match format {
                    Format::Linuxcnc => "its sign was tried on LinuxCNC itself",
                    _ => "error and compensation both stand in its table",
                }
            ));
        }
        let named: Vec<Axis> = self
            .reference_number
            .iter()
            .map(|(axis, _)| *axis)
            .collect();
        once_and_exported("--reference-number", &named, axes)
    }
}

/// Refuses axes that are named twice or that no table is made of.
pub(super) fn once_and_exported(option: &str, named: &[Axis], axes: AxisSet) -> Result<(), String> {
    for (k, axis) in named.iter().enumerate() {
        if named[..k].contains(axis) {
            return Err(format!("{option} {axis} is given twice: give it once"));
        }
        if !axes.contains(*axis) {
            return Err(format!(
                "{option} {axis} does nothing: {axis} is not among the axes of --axis"
            ));
        }
    }
    Ok(())
}

impl SetUp {
    /// The control with its set-up.
    pub fn control(&self, format: Format) -> Control {
        match format {
            Format::Linuxcnc if self.file_type.unwrap_or(0) == 0 => {
                Control::LinuxCnc(FileType::ActualPosition)
            }
            Format::Linuxcnc => Control::LinuxCnc(FileType::Offset),
            Format::Sinumerik => Control::Sinumerik(self.sinumerik()),
            Format::Heidenhain => Control::Heidenhain(self.sign()),
            Format::Fanuc => Control::Fanuc(self.fanuc()),
            Format::Csv | Format::Mtx => Control::Csv,
        }
    }

    /// Which way a positive value moves an axis, where the user tried it.
    pub fn sign(&self) -> Option<Sign> {
        self.sign.map(|towards| match towards {
            Towards::Plus => Sign::Plus,
            Towards::Minus => Sign::Minus,
        })
    }

    fn sinumerik(&self) -> Sinumerik {
        Sinumerik {
            names: PerAxis::from_fn(|axis| format!("{axis}1")),
            max_points: self.max_points.unwrap_or(MAX_POINTS),
            max_tables: self.max_tables.unwrap_or(MAX_TABLES),
            max_cross_points: self.max_points.unwrap_or(MAX_POINTS),
            max_sum: self.max_sum_mm.unwrap_or(MAX_SUM_MM),
            max_slope: self.max_slope.unwrap_or(MAX_SLOPE),
            for_each_direction: self.each_direction,
            other_axes: if self.leave_out_other_axes {
                OtherAxes::LeaveOut
            } else {
                OtherAxes::Refuse
            },
            temperature_sign: self.sign(),
        }
    }

    fn fanuc(&self) -> Fanuc {
        let mut reference_number = PerAxis::from_fn(|axis| 100 * axis.index() as u32 + 100);
        for (axis, number) in &self.reference_number {
            reference_number[*axis] = *number;
        }
        let detection_unit = self.detection_unit.unwrap_or(1.0);
        Fanuc {
            reference_number,
            detection_unit: PerAxis::from_fn(|axis| inner(axis, detection_unit * THOUSANDTH)),
            magnification: self.magnification.unwrap_or(1),
            max_pulses: self.max_pulses.unwrap_or(MAX_PULSES),
            max_number: self.max_number.unwrap_or(MAX_NUMBER),
            record: if self.marked {
                Record::Marked
            } else {
                Record::Plain
            },
            tables: match self.pitch_tables {
                None | Some(Pitch::Auto) => PitchTables::AsMeasured,
                Some(Pitch::One) => PitchTables::One,
                Some(Pitch::Two) => PitchTables::Two,
            },
            sign: self.sign(),
        }
    }
}
