//! A recorded session as the simulator wants it: runs, commands, and what each instrument read beyond them.
//!
//! [`SessionBuilder`] takes the samples of one bag, or of several one after another, in the order in which
//! they were recorded, and gives a [`twin::Session`] with an [`Account`] of everything that could
//! not be used. The live node and the command line use the same builder.
//!
//! # What a deviation is
//!
//! Measured minus nominal, mm (rad for rotary axes). Nominal is what the command says, and an applied
//! compensation c (topic `compensation`, zero-order hold) is part of what was commanded:
//!
//! ```text
//!   motor, scale     d = reading - (command + c)                          (1)
//!   grid             d = reading - (command + c) along u or v - zero      (2)
//!   ballbar          d = reading - distance of (command + c) from the centre
//!   length           d = reading - (command + c) along the beam - zero    (3)
//!   touch            d = surface latched along the approach - surface of the machine file   (4)
//!   thermometer      d = reading - reading of the first thermometer at its place            (5)
//! ```
//!
//! A touch is at the place where the command passed the surface of the machine file, which does not scatter with its
//! trigger. (4) needs no c: a latched position is where the motor was, compensation included, and so is the
//! command that an uncompensated machine would have needed. A circle that was measured with the compensation
//! on therefore shows the same deviations as without it. The zero of (2) and (3) is the mean of the first
//! run under that count; between runs of one count differences stay.
//!
//! # What is read when
//!
//! | run | readings |
//! |---|---|
//! | circle in motion | on the nominal circle at 98 % of the feed or more |
//! | other contours in motion | from where they first have their feed to where they last have it, while the record is at its full rate; the whole motion where they never have it; of lines the passes at the feed after 50 ms |
//! | encoders | of axes that move in what is read |
//! | with stations, positioning, diagonals | the mean of each stop after [`SessionConfig::settle_s`] |
//! | touches | each touch of a feature that the machine file has, up to 2 s after the end of its segment |
//!
//! A run holds what is stamped from its begin to its end, in whatever order topics arrive: up to 2 s apart. The clocks of
//! the hosts must agree (`host_clock`). A segment that is stamped further from the samples begins or ends a run when its
//! message comes; where it is older than they are that is counted.
//!
//! A contour has at most [`SessionConfig::readings_per_run`] readings per channel: means of an odd number of
//! neighbours, the same number in every repeat. The commanded motion is kept at each of them, at reversals,
//! starts and stops tick by tick, and at least every 50 ms or 0.5 mm. While a run is open, ticks of axes that stand are
//! held every 20 ms only.
//!
//! # When the record is not whole
//!
//! | what | answer |
//! |---|---|
//! | hole in the axis states | readings inside are left out, unless they bear the stamp of a state |
//! | hole in them while the axes moved, of more than 0.25 s and 20 spacings | the run is left out, counted |
//! | reading more than 10 m, rad or K from its nominal value | left out, counted |
//! | value that is no number, count of another zero, sensor that stands while it is to change | left out, counted |
//! | one coordinate of a grid encoder that stands while it is to change | that coordinate is left out, counted |
//! | time that goes back by less than 2 s | the sample is left out, counted |
//! | a clock that jumps back by more | the session's time goes on, the open run is cut, counted |
//! | segment that the end of the bag cuts | kept up to there, counted |
//! | segment that failed | left out, counted |
//! | topics that are not there | the session holds the other channels |
//! | touches without axis states, block measurements without touches | the motion that touches have by themselves (`touching`) |
//! | another machine's axes, positions outside its travel | [`SessionError`] |
//!
//! # Holds when
//! Rotary axes rest at zero during grid and length runs. Positions on a curve are those commanded.

pub(crate) mod changes;
pub(crate) mod fewer;
pub(crate) mod log;
pub(crate) mod over_session;
pub(crate) mod thermal;
pub(crate) mod unread;

mod account;
mod builder;
mod channels;
mod close;
mod config;
mod error;
mod motion;
mod nominal;
mod past;
mod recent;
mod record;
mod select;
mod standing;
pub(crate) mod thermal_floats;
mod thermometers;
mod time;
mod touching;

pub use account::{Account, Reason};
pub use builder::{Input, SessionBuilder, outside_travel};
pub use config::SessionConfig;
pub use error::SessionError;
pub(crate) use select::HOLDS_FEED_S;
