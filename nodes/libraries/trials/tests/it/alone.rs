//! Effects of the catalogue, each alone, out of the plant's own physics: named, class and axis, at D above 20.
//!
//! Every machine is drawn from one seed that was fixed before anything was looked at. What is hidden is hidden in the
//! plant (or the control, or on an instrument's clock) alone; the programme is measured in simulated time, the session
//! built from its samples and diagnosed. The catalogue takes no part in making the data.
//!
//! | file | effects |
//! |---|---|
//! | `classes` | the fourteen classes of blind trials, as their arm `alone` draws them |
//! | `angles` | `angular_error` at two heights, which that arm's programme does not measure |
//! | `probe` | `probe_lobing`, `probe_pretravel`, `latency_drift` |
//! | `heat` | `spindle_growth`, `column_bend`, `ambient_drift`, `thermometer_offset` |
//! | `drives` | `acceleration_lag`, `feed_lost_motion` |
//! | `instruments` | `clock_drift`, `plate_error`, `length_misalignment`, `interpolation_error` |
//! | `rotary` | `rotary_location` |
//! | `scatter` | `latency_jitter`, `stick_slip`; `probe_repeatability` and `vibration_random` that are in the noise floor |
//! | `in_part` | oil that is used up, a coupling with play, a cable: not of the catalogue, and in part like something in it |
//!
//! What the plant lacks, or has only together with something else, is in the README.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]
#![expect(clippy::print_stdout, reason = "a test tells what it saw")]

mod rigs;

mod judge;

mod angles;
mod classes;
mod drives;
mod heat;
mod in_part;
mod instruments;
mod probe;
mod rotary;
mod scatter;
