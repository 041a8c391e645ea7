//! Blind trials of the diagnosis: it sees its inputs alone, a series goes on where it ended, and a small fixed set
//! does not drop below what was reached.

mod blind;
mod floor;
mod series;
