//! Screw-compensation files of LinuxCNC (`COMP_FILE`), both types.
//!
//! # Format
//!
//! A line holds three numbers in machine units (mm, degrees): nominal position, a number for motion
//! towards greater positions, a number for motion towards smaller ones \[1\]. The reader stops at the
//! first line that is not three numbers \[2\]; notes therefore stand *behind* the last point, never before it.
//!
//! # Sign
//!
//! ```text
//!   motor command = position command + trim                                  (1)
//!   type 0:  trim = nominal - number       number = p + e(p)                 (2)
//!   type 1:  trim = number                 number = -e(p)                    (3)
//! ```
//!
//! (1) and the two meanings of the number are in the source \[2\], \[3\]. Type 0 wants to know where the slide
//! *is*, type 1 what to *add*, so their numbers for the same error have opposite signs. The documentation's
//! words for type 1, "positive offset ... in the positive direction, negative offset ... in a negative
//! direction", describe its example of a backlash and are no rule of sign.
//!
//! # Rounding
//! To 1 nm or 1e-6 degree. LinuxCNC reads doubles; less would only add noise.
//!
//! # Holds when
//! At most 256 points a joint, ascending. Between points the trim is linear, beyond the outer ones it stays \[3\].
//! `BACKLASH` of the joint is ignored when a file is given \[1\]: both directions must be in it. The trim follows
//! the direction of the last motion and is ramped with half of the joint's velocity and acceleration limits,
//! so `STEPGEN_MAXACCEL` and following-error limits need that room \[3\].
//!
//! # Agreement
//! Interpreted from the source, an axis off by 32.5 µm is left with 4.3 nm at the points (the product of error and
//! slope), with the sign turned round the error becomes 1.9998 to 2.0003 times as large; the examples of the documentation come out as printed.
//! On LinuxCNC 2.9 itself, whose HAL adds lead error, thread error and lost motion of together 39.6 µm (rms 23.2 µm), files of both types
//! made from stops every 30 mm leave 2.1 µm (rms 0.52 µm) at stops every 15 mm; with the sign turned round the rms
//! becomes 1.996 times as large (type 0 in `tests/linuxcnc`, type 1 in `nodes/linuxcnc_bridge/tests/it/linuxcnc/screw_error.rs`).
//!
//! # References
//! \[1\] LinuxCNC documentation, INI Configuration, \[JOINT_n\] section, `COMP_FILE`, `COMP_FILE_TYPE`.
//! \[2\] LinuxCNC 2.9 source, `src/emc/motion/usrmotintf.cc`, `usrmotLoadComp`.
//! \[3\] LinuxCNC 2.9 source, `src/emc/motion/command.c`, `EMCMOT_SET_JOINT_COMP`, and `control.c`, `compute_screw_comp`.

use super::axis_errors::{AxisErrors, check_count};
use super::error::ExportError;
use super::file::{ExportFile, comments};
use super::number::{fixed, mm_or_deg, unit};
use super::sign::{check, tried};

const LINUXCNC_TABLE: &str = "LinuxCNC COMP_FILE";
/// `EMCMOT_COMP_SIZE` of the source.
const MAX_TABLE_POINTS: usize = 256;
const DECIMALS: usize = 6;
/// Two nominal positions must differ after rounding, mm or degrees.
const LEAST_SPACING: f64 = 2e-6;

/// What the second and third number of a line mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FileType {
    /// Type 0: where the slide is when the command is the nominal position.
    ActualPosition,
    /// Type 1: what is added to the motor's command.
    Offset,
}

impl FileType {
    /// Value of `COMP_FILE_TYPE`.
    #[must_use]
    pub const fn number(self) -> u8 {
        match self {
            Self::ActualPosition => 0,
            Self::Offset => 1,
        }
    }
}

/// The file for the joint that moves the axis.
///
/// # Errors
/// More than 256 points; points closer than the rounding.
pub fn compensation_file(
    errors: &AxisErrors,
    file_type: FileType,
) -> Result<ExportFile, ExportError> {
    let axis = errors.axis();
    check_count(
        LINUXCNC_TABLE,
        axis,
        errors.position().len(),
        MAX_TABLE_POINTS,
    )?;
    for pair in errors.position().windows(2) {
        let spacing = pair[1] - pair[0];
        if mm_or_deg(axis, spacing) <= LEAST_SPACING {
            let least = LEAST_SPACING / mm_or_deg(axis, 1.0);
            return Err(ExportError::Spacing {
                axis,
                spacing,
                least,
            });
        }
    }
    let number = |at: f64, error: f64| match file_type {
        FileType::ActualPosition => at + error, // (2)
        FileType::Offset => -error,             // (3)
    };
    let mut text = String::new();
    let both = errors.up().iter().zip(errors.down());
    for (at, (up, down)) in errors.position().iter().zip(both) {
        let numbers = [*at, number(*at, *up), number(*at, *down)]
            .map(|value| fixed(mm_or_deg(axis, value), DECIMALS));
        text.push_str(&numbers.join(" "));
        text.push('\n');
    }
    let name = format!("{}.comp", axis.letter().to_lowercase());
    let mut notes = notes(errors, file_type, &name);
    notes.extend_from_slice(errors.remarks());
    text.push_str(&comments("#", &notes));
    Ok(ExportFile::new(name, text, notes))
}

fn notes(errors: &AxisErrors, file_type: FileType, name: &str) -> Vec<String> {
    let axis = errors.axis();
    let meaning = match file_type {
        FileType::ActualPosition => "actual position moving up, actual position moving down",
        FileType::Offset => "offset added moving up, offset added moving down",
    };
    let step = match file_type {
        FileType::ActualPosition => {
            "in a copy write nominal + 0.010 as both numbers of one line and nominal in the others, move there and read a dial gauge with and without the file: it must move by 10 um towards smaller positions"
        }
        FileType::Offset => {
            "in a copy write 0.010 as both numbers of one line and 0 in the others, move there and read a dial gauge with and without the file: it must move by 10 um towards greater positions"
        }
    };
    vec![
        format!(
            "LinuxCNC screw compensation of axis {axis}, COMP_FILE_TYPE = {}, {}",
            file_type.number(),
            unit(axis)
        ),
        format!("columns: nominal, {meaning}"),
        tried(
            "LinuxCNC 2.9, types 0 and 1, left 2 um of 40 um, and with the sign turned round twice the error",
        ),
        check(step),
        format!(
            "in the [JOINT_n] section of this axis: COMP_FILE = {name}, COMP_FILE_TYPE = {}; BACKLASH is then ignored",
            file_type.number()
        ),
        "comments stand at the end: LinuxCNC stops reading at the first line without three numbers"
            .to_owned(),
    ]
}
