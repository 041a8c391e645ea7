//! Compensations of SINUMERIK 840D sl / 828D: leadscrew table, cross-axis tables, temperature.
//!
//! # Sign
//!
//! Leadscrew table: "The principle of the MSEC is to modify the axis-specific position actual value by the assigned
//! compensation value ... A positive compensation value causes the corresponding machine axis to move in the
//! negative direction" (\[2\] 4.4.2.1 p. 238; \[1\]).
//!
//! Cross-axis table: "This compensation is sent to the position control loop as an additional setpoint. A positive
//! compensation value causes the corresponding machine axis to move in the negative direction" (\[5\] 5.4.3 p. 372; \[6\] 5.4.3
//! p. 357). One table changes the actual value, the other is an additional setpoint; the manual gives both the same direction of motion, and
//! that, not the word setpoint, decides. So in both
//!
//! ```text
//!   position reached = command - value + e(p)      value = +e(p)             (1)
//! ```
//!
//! The error goes into the table with its own sign. The manual's figure says the same: a cross-arm that sags in the
//! negative Z1 direction (e < 0) gets negative values, which lift Z1.
//!
//! Temperature: no page seen says which way the axis moves. \[2\] 4.2.1 p. 225 gives the line of the compensation
//! value and calls its slope that of the error line, \[4\] labels one ordinate "Error (comp. value)"; whether that error is of the reading or of
//! the slide is not said. The user gives the sign ([`super::Sign`]).
//!
//! # Units and rounding
//! mm and degrees. Values to 1 nm (1e-6 degree), positions and spacing to 1e-9, since the control multiplies the spacing by
//! the point's number.
//!
//! # Agreement
//! Of an axis off by 31.5 to 33.6 µm, moved as the sentences above say, the leadscrew table leaves 1.0 nm and two
//! cross-axis tables (one a direction) 4.3 nm; the temperature line, moved as the given sign says, 1.4 nm. The examples of \[2\] p. 242,
//! p. 264 and \[3\] come out as printed.
//!
//! # References
//! \[1\] SINUMERIK 808D Function Manual, 01/2017, p. 106 (leadscrew error compensation; value zero at the
//! reference point). \[2\] SINUMERIK 840D sl / 828D Function Manual Extended Functions, 03/2013,
//! 6FC5397-1BP40-3BA1, K3: 4.2 p. 225, 228 (temperature), 4.4.2.1 p. 238 (sign of the leadscrew table), 4.4.2.3 p. 242 (example of a table),
//! 4.4.3 p. 243 to 249 (cross-axis tables), 4.4.4.3 p. 264 (tables for each direction). \[3\] SINUMERIK 802D sl Function Manual, 11/2012,
//! 6FC5397-1CP10-5BA0, 11.3 p. 222 (example of a cross-axis table). \[4\] SINUMERIK 840C Installation
//! Instructions, 12.19.4 p. 12-188 (the line of the temperature compensation). \[5\] SINUMERIK 840D sl Function
//! Manual Extended Functions, 03/2009, 6FC5397-1BP10-4BA0, K3 5.4.3 p. 372 (sign of the cross-axis tables). \[6\] the same, 01/2008,
//! 6FC5397-1BP10-3BA0, p. 357. The page of that sentence in \[2\] was not seen; \[3\] 11.3.3 p. 214 has it up to "A positive
//! compensation value causes".

mod cross_table;
mod encoder_table;
mod temperature;

pub use cross_table::{CrossTable, Traverse, cross_table, direction_tables};
pub use encoder_table::{EncoderTable, encoder_table};
pub use temperature::{OtherAxes, Temperature, temperature};

use super::error::ExportError;
use super::number::is_name;

const VALUE_DECIMALS: usize = 6;
const POSITION_DECIMALS: usize = 9;

fn check_name(control: &'static str, name: &str) -> Result<(), ExportError> {
    if is_name(name) {
        return Ok(());
    }
    let name = name.to_owned();
    Err(ExportError::Name { control, name })
}
