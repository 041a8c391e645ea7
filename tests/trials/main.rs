//! Blind trials of the diagnosis: it sees its inputs alone, a series goes on where it ended, and a small fixed set
//! does not drop below what was reached.
#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(
    clippy::disallowed_methods,
    reason = "tests look at clocks and read files"
)]

mod blind;
mod designed;
mod floor;
mod page;
mod series;
mod shop;
