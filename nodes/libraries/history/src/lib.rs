//! The history of machines: figures of every report and diagnosis over time.
//!
//! An [`Entry`] holds the figures of one report or diagnosis with machine, time and hashes. The [`Store`] keeps entries in one
//! SQLite file or on a PostgreSQL server, each once. Statistics read no store: they take [`Point`]s and give trends, change points, dates at which a
//! limit is reached, outliers of a fleet, changes between two dates and tests that are due.

mod bound;
mod change_points;
mod comparison;
mod conditions;
mod due;
mod entry;
mod error;
mod fleet;
mod gap_figures;
mod left_out;
mod limit_crossing;
mod point;
mod report_figures;
mod schema;
mod store;
mod student;
mod trend;

pub use change_points::{ChangePoint, SURE, change_points, since_last_change};
pub use comparison::{Difference, Verdict, difference, latest_until};
pub use due::{Due, due};
pub use entry::{Entry, Figure, Kind};
pub use error::HistoryError;
pub use fleet::{Fleet, LEAST_MACHINES, Standing, fleet};
pub use gap_figures::{Gap, gap_figures};
pub use left_out::{LeftOut, left_out};
pub use limit_crossing::{Crossing, Limit, Side, crossing};
pub use point::{Point, YEAR_S};
pub use report_figures::report_figures;
pub use schema::VERSION;
pub use store::{
    Added, Kept, Last, MachineSummary, Options, Series, SeriesKey, Store, Window, is_server, shown,
};
pub use trend::Trend;
