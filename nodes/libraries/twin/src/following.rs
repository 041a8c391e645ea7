//! What the control loops of the machine file leave by themselves: the nominal following error.
//!
//! A position loop of gain K with a share f of velocity feed-forward. Around an ideal velocity loop (no
//! `velocity_loop` in the machine file):
//!
//! ```text
//!   de/dt = -K e - (1 - f) dr/dt,   e = motor - command                   (1)
//!   e -> -(1 - f) v / K at constant velocity                              (2)
//! ```
//!
//! Around a velocity loop with proportional and integral action on the axis' inertia, which has the natural
//! frequency w and the damping ratio d and is fed back through a filter of time t:
//!
//! ```text
//!   c = -K e + f dr/dt,    de/dt = v - dr/dt                              (3)
//!   dv/dt = 2 d w (c - u) + z,   dz/dt = w^2 (c - u)                      (4)
//!   du/dt = (v - u) / t;   u = v where t is 0                             (5)
//!   e = -(1 - f) r' / K + [(1 - f) / K^2 + t / K] r'' - f r''' / (w^2 K) + ..    (6)
//! ```
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | K, f | `position_gain_per_s`, `velocity_feedforward` | 1/s, 1 |
//! | w | 2 pi `velocity_loop.frequency_hz` | rad/s |
//! | d | `velocity_loop.damping` | 1 |
//! | t | `velocity_loop.filter_ms` | ms |
//! | z, u | acceleration of the integral part, filtered velocity | mm/s², mm/s |
//!
//! Both are stepped exactly, by the matrix exponential, for commands that are parabolas between ticks, since chords run
//! inside a circle by r'' h²/12 (1 µm at 750 mm/s² and 4 ms): from the mean velocity of the step and its change,
//!
//! ```text
//!   dr/dt = (r_1 - r_0) / h + (v_1 - v_0) (t / h - 1/2),   v as in `Motion`            (7)
//! ```
//!
//! The run is taken to begin in the state (2). This is nominal: every prediction of the machine as it is
//! described has it, so that an effect such as `servo_lag` is only what the real loop does differently.
//!
//! # Holds when
//! No limit of force or velocity is met, and the drive behind the motor's encoder is stiff. An ideal velocity loop
//! is fast against K; what a real one adds to it, the last two terms of (6), is found as `acceleration_lag`.
//!
//! # Agreement
//! `val_the_loop_integrated_finely`: 1e-5 µm of 33 µm on a circle, with an ideal velocity loop.
//! `val_the_loop_with_its_velocity_loop_integrated_finely`: 0.006 µm of 33 µm, at 400 mm/s² and 1 ms.
//!
//! # References
//! \[1\] C. F. Van Loan, IEEE Trans. Autom. Control 23(3), 1978, doi:10.1109/TAC.1978.1101743 (exact step of
//! a driven linear system by one exponential).

use std::collections::BTreeMap;

use metrology::Axis;
use nalgebra::{SMatrix, SVector};

use super::motion::Motion;
use super::response::Response;
use crate::effects::{Effect, Scene};
use machine::MachineFile;
use machine::file::{AxisEntry, VelocityLoopEntry};

use waves::Inner;
pub(crate) use waves::Wave;

mod waves;

/// The nominal following errors of all axes.
#[derive(Clone, Copy, Debug)]
pub struct Following;

impl Effect for Following {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        for axis in scene.machine.axes.keys() {
            add_errors(scene, *axis, &mut response.servo[*axis]);
        }
    }
}

impl Motion {
    /// Computes the acceleration of each axis behind its control loops, to which what has inertia yields. It differs from the
    /// command's where that changes faster than the loops can follow.
    pub fn follow(&mut self, machine: &MachineFile) {
        for (axis, entry) in &machine.axes {
            if self.position[*axis].is_empty() {
                continue;
            }
            let mut follower = Follower::new(entry, self, *axis);
            let each = (0..self.len()).map(|tick| {
                if tick > 0 {
                    let step_s = self.time_s[tick] - self.time_s[tick - 1];
                    let (begin, change) = within(self, *axis, tick, step_s);
                    follower.advance(begin, change, step_s);
                }
                follower.acceleration(self.acceleration[*axis][tick])
            });
            self.driven[*axis] = each.collect();
        }
    }
}

fn add_errors(scene: &Scene<'_>, axis: Axis, errors: &mut [f64]) {
    let Some(entry) = scene.machine.axes.get(&axis) else {
        return;
    };
    let motion = &scene.run.motion;
    let mut follower = Follower::new(entry, motion, axis);
    for (tick, sum) in errors
        .iter_mut()
        .enumerate()
        .take(motion.position[axis].len())
    {
        if tick > 0 {
            let step_s = motion.time_s[tick] - motion.time_s[tick - 1];
            let (begin, change) = within(motion, axis, tick, step_s);
            follower.advance(begin, change, step_s);
        }
        *sum += follower.error();
    }
}

/// Steps that differ by less are one, s.
const SAME_STEP_S: f64 = 1e-9;

/// Steps that are remembered.
const MOST_KNOWN: usize = 256;

/// K and f.
#[derive(Clone, Copy, Debug)]
struct Gains {
    position_per_s: f64,
    feedforward: f64,
}

impl Gains {
    fn of(entry: &AxisEntry) -> (Self, Option<&VelocityLoopEntry>) {
        let (position_per_s, feedforward, velocity_loop) = match entry {
            AxisEntry::Linear(a) => (
                a.position_gain_per_s,
                a.velocity_feedforward,
                &a.velocity_loop,
            ),
            AxisEntry::Rotary(a) => (
                a.position_gain_per_s,
                a.velocity_feedforward,
                &a.velocity_loop,
            ),
        };
        let gains = Self {
            position_per_s,
            feedforward,
        };
        (gains, velocity_loop.as_ref())
    }

    /// (2) for a velocity of one.
    fn left_s(&self) -> f64 {
        (1.0 - self.feedforward) / self.position_per_s
    }
}

/// A motor that follows its command.
pub(crate) struct Follower {
    gains: Gains,
    /// Rates of change of the state around a velocity loop.
    rate: Option<SMatrix<f64, STATES, STATES>>,
    /// The velocity loop; none where it is ideal.
    inner: Option<Inner>,
    period_s: f64,
    /// Share of an error that a period leaves, around an ideal velocity loop.
    kept: f64,
    passed: SMatrix<f64, STATES, STATES>,
    /// What passes a period, by its nanoseconds: a thinned record has a few dozen different ones.
    known: BTreeMap<u64, SMatrix<f64, STATES, STATES>>,
    state: Driven,
}

impl Follower {
    /// In the state (2).
    pub(crate) fn new(entry: &AxisEntry, motion: &Motion, axis: Axis) -> Self {
        let (gains, velocity_loop) = Gains::of(entry);
        let first = motion.velocity[axis].first().copied().unwrap_or(0.0);
        let state = [-gains.left_s() * first, first, 0.0, first, first, 0.0];
        Self::of(gains, velocity_loop, Driven::from(state))
    }

    /// At rest, with another share of velocity feed-forward.
    pub(crate) fn at_rest(entry: &AxisEntry, feedforward: f64) -> Self {
        let (gains, velocity_loop) = Gains::of(entry);
        let gains = Gains {
            feedforward,
            ..gains
        };
        Self::of(gains, velocity_loop, Driven::zeros())
    }

    fn of(gains: Gains, velocity_loop: Option<&VelocityLoopEntry>, state: Driven) -> Self {
        let inner = velocity_loop.map(Inner::of);
        Self {
            rate: inner.as_ref().map(|inner| gains.rate(inner)),
            inner,
            period_s: 0.0,
            kept: 1.0,
            passed: SMatrix::identity(),
            known: BTreeMap::new(),
            state,
            gains,
        }
    }

    /// Motor minus command.
    pub(crate) fn error(&self) -> f64 {
        self.state[ERROR]
    }

    /// Velocity of the motor.
    pub(crate) fn velocity(&self) -> f64 {
        self.state[VELOCITY]
    }

    /// Acceleration of the motor, where the command has `of_command`.
    fn acceleration(&self, of_command: f64) -> f64 {
        let state = &self.state;
        match &self.rate {
            Some(rate) => (rate.row(VELOCITY) * state)[0],
            // Of v = f r' - K e.
            None => {
                let slower = state[VELOCITY] - state[COMMAND];
                self.gains.feedforward * of_command - self.gains.position_per_s * slower
            }
        }
    }

    /// Goes on by a step in which the command's velocity changes evenly from `begin` by `change`.
    pub(crate) fn advance(&mut self, begin: f64, change: f64, step_s: f64) {
        let is_new = (step_s - self.period_s).abs() > SAME_STEP_S;
        let gains = self.gains;
        if let Some(rate) = &self.rate {
            if is_new {
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "a step is positive and far below a century"
                )]
                let key = (step_s / SAME_STEP_S).round() as u64;
                if self.known.len() >= MOST_KNOWN {
                    self.known.clear();
                }
                let passed = self.known.entry(key);
                self.passed = *passed.or_insert_with(|| (rate * step_s).exp());
                self.period_s = step_s;
            }
            (self.state[COMMAND], self.state[CHANGE]) = (begin, change / step_s);
            self.state = self.passed * self.state; // (3) to (5)
            return;
        }
        if is_new {
            (self.period_s, self.kept) = (step_s, (-gains.position_per_s * step_s).exp());
        }
        let lag = change / step_s / gains.position_per_s;
        let steady = [begin - lag, begin + change - lag].map(|v| -gains.left_s() * v);
        let error = steady[1] + (self.state[ERROR] - steady[0]) * self.kept; // (1)
        self.state[COMMAND] = begin + change;
        self.state[ERROR] = error;
        self.state[VELOCITY] = gains.feedforward * (begin + change) - gains.position_per_s * error;
    }
}

impl Gains {
    /// Rates of change of the state, the acceleration of the command held.
    fn rate(&self, inner: &Inner) -> SMatrix<f64, STATES, STATES> {
        let filter_s = inner.filter_s;
        let fed_back = if filter_s > 0.0 { FILTERED } else { VELOCITY };
        let mut rate = SMatrix::zeros();
        rate[(ERROR, VELOCITY)] = 1.0; // (3)
        rate[(ERROR, COMMAND)] = -1.0;
        let parts = [
            (VELOCITY, inner.proportional_per_s),
            (INTEGRAL, inner.integral_per_s2),
        ];
        for (row, gain) in parts {
            rate[(row, ERROR)] -= gain * self.position_per_s; // (4)
            rate[(row, COMMAND)] += gain * self.feedforward;
            rate[(row, fed_back)] -= gain;
        }
        rate[(VELOCITY, INTEGRAL)] += 1.0;
        rate[(COMMAND, CHANGE)] = 1.0;
        if filter_s > 0.0 {
            rate[(FILTERED, VELOCITY)] = 1.0 / filter_s; // (5)
            rate[(FILTERED, FILTERED)] = -1.0 / filter_s;
        }
        rate
    }
}

/// (7) of the step that ends at a tick: the command's velocity where it begins, and its change.
pub(crate) fn within(motion: &Motion, axis: Axis, tick: usize, step_s: f64) -> (f64, f64) {
    let (position, velocity) = (&motion.position[axis], &motion.velocity[axis]);
    let mean = (position[tick] - position[tick - 1]) / step_s;
    let change = velocity[tick] - velocity[tick - 1];
    (mean - 0.5 * change, change)
}

/// Places in the state: e, v, z, u, the command's velocity and its rate of change.
const ERROR: usize = 0;
const VELOCITY: usize = 1;
const INTEGRAL: usize = 2;
const FILTERED: usize = 3;
const COMMAND: usize = 4;
const CHANGE: usize = 5;
const STATES: usize = 6;
type Driven = SVector<f64, STATES>;
