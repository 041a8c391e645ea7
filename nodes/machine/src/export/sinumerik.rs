//! Compensations of SINUMERIK 840D sl / 828D: leadscrew table, cross-axis tables, temperature.
//!
//! # Sign
//!
//! The manual says of the leadscrew compensation that it alters the *actual value* of the axis by the table's
//! value and that a positive value makes the axis move in the negative direction \[1\]. So
//!
//! ```text
//!   position reached = command - value + e(p)      value = +e(p)             (1)
//! ```
//!
//! The error goes into the table with its own sign. For the cross-axis tables and the temperature parameters
//! the pages seen name the actual value as what is changed (\[2\] 4.2, \[4\]) but give no sentence on the direction of
//! motion; the same sign is **derived** from that, and each file says so. Verify it with a dial gauge.
//!
//! # Units and rounding
//! mm and degrees. Values to 1 nm (1e-6 degree), positions and spacing to 1e-9, since the control multiplies the spacing by
//! the point's number.
//!
//! # Agreement
//! Interpreted from the manual, an axis off by 31.5 to 33.6 µm is left with 1.0 nm by the leadscrew table, 4.3 nm by two
//! cross-axis tables (one a direction), 1.4 nm by the temperature line; with the sign turned round its error doubles.
//!
//! # References
//! \[1\] SINUMERIK 808D Function Manual, 01/2017, p. 106 (leadscrew error compensation; value zero at the
//! reference point). \[2\] SINUMERIK 840D sl / 828D Function Manual Extended Functions, 03/2013,
//! 6FC5397-1BP40-3BA1, K3: 4.2 p. 228 (temperature), 4.4.2.3 p. 242 (example of a table), 4.4.3 p. 245 to 249 (cross-axis tables),
//! 4.4.4.3 p. 264 (tables for each direction). \[3\] SINUMERIK 802D sl Function Manual, 11/2012,
//! 6FC5397-1CP10-5BA0, 11.3 p. 222 (example of a cross-axis table). \[4\] SINUMERIK 840C Installation
//! Instructions, 12.19.4 p. 12-188 (the line of the temperature compensation).

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
