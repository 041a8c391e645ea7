//! LinuxCNC behind the same boundary as the fake machine.
//!
//! LinuxCNC runs as it is, without a display. Programs and commands go to it as lines of text over
//! TCP (`linuxcncrsh`); positions and the probe input come back from a sampler in its servo thread,
//! one record per servo period; compensation enters between its position command and the drives.
//!
//! # The latch
//!
//! LinuxCNC polls the probe input once per servo period Δ and reports the positions fed back in the
//! period in which it saw the input change. A contact at time `t_c` therefore passes three waits:
//!
//! ```text
//!   t_latch = t_c + w_c + D + w_p                                                     (1)
//!   latched = position(t_latch),  latched - surface = f (w_c + D + w_p)               (2)
//! ```
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | w_c | wait until contact is next looked at: zero for a real switch, up to Δ where contact itself is computed in the servo thread | s |
//! | D | delay between contact and the input pin: what a latency calibration wants to know | s |
//! | w_p | wait until motion polls the pin next: uniform in [0, Δ), mean Δ/2, standard deviation Δ/√12 | s |
//! | f | feed at contact | mm/s |
//!
//! A real probe has `w_c = 0`, so the mean apparent latency is `D + Δ/2`. A delay made in the servo
//! thread itself (HAL `timedelay`) is a whole number of periods: it counts the period in which it
//! first sees the contact as one, so that an on-delay `D` becomes `(⌈D/Δ⌉ - 1) Δ`, with `w_c` uniform
//! in [0, Δ) and `w_p = 0`. The mean apparent latency of the simulated machine is then
//!
//! ```text
//!   T = (⌈D/Δ⌉ - 1) Δ + Δ/2                                                           (3)
//! ```
//!
//! which lies within Δ/2 of D. A constant stand-off meets every touch at one feed in the same phase
//! of the servo period, and then averaging does not help: [`latch`] says what does.
//!
//! # Agreement
//!
//! `touches_at_five_feeds_give_the_delay_that_only_hal_holds`: on-delay 4.2 ms, 5 feeds of 2 to 30 mm/s,
//! 8 touches each with spread phases: single waits 4.003 to 4.979 ms, latency 4.504 ms where (3) gives
//! 4.500 ms, surface within 1 nm; every published position equals LinuxCNC's own probed one to the nm.
//! `the_latency_cycle_gives_the_delay_that_only_hal_holds`: the suite's own cycle, same feeds and repeats:
//! 4.511 ms on an X face, 4.572 ms on a Z face, surfaces within 0.3 µm.
//! Records reach the host later than the fastest one by 5 ms (median), 12 ms (99 %).
//!
//! # Which position is `latched`
//!
//! `#5061…` of LinuxCNC are workpiece coordinates without compensation. The motors' positions of the
//! very period in which motion saw the input are in the sampler's record; they differ from `#5061…`
//! by offsets and compensation only, and are what is published.

pub mod clock;
pub mod compensation;
pub mod condition;
pub mod config;
pub mod error;
pub mod fault;
pub mod frame;
pub mod io;
pub mod latch;
pub mod live;
pub mod modal;
pub mod program;
pub mod protocol;
pub mod run;
pub mod samples;
pub mod session;
pub mod stage;
pub mod waiting;
pub mod watch;
pub mod work_systems;

pub use config::{BridgeConfig, Settings};
pub use error::BridgeError;
pub use stage::{BridgeStage, Input, Output};
