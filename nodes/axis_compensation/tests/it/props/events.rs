//! What may happen to a stage.

use proptest::prelude::*;

use crate::props::geometry::{Geometry, geometry};

#[derive(Clone, Debug)]
pub enum Event {
    Sweep(Sweep),
    State {
        step_nanos: i64,
        position_mm: [f64; 3],
        rotary_rad: Rotary,
        heard: Heard,
        beyond_motor_mm: f64,
    },
    Test {
        begin: bool,
        completed: bool,
    },
    Model {
        k0_mm: f64,
        slope: f64,
        life_s: f64,
        rate_mm_s: f64,
    },
    Geometry(Box<Geometry>),
    Enable(bool),
    Active(bool),
    Tick,
    Wait {
        host_nanos: i64,
    },
    Shutdown,
}

/// X and Z run from one place to another, and so do the rotary axes.
#[derive(Clone, Copy, Debug)]
pub struct Sweep {
    from_mm: f64,
    to_mm: f64,
    from_rad: Rotary,
    to_rad: Rotary,
    pub ticks: u32,
}

/// Positions of A and C.
pub type Rotary = [f64; 2];

/// Of which axes a state tells.
#[derive(Clone, Copy, Debug)]
pub enum Heard {
    All,
    Linear,
    YAlone,
}

impl Event {
    /// A state of a machine at zero.
    pub fn at_zero(step_nanos: i64) -> Self {
        Self::State {
            step_nanos,
            position_mm: [0.0; 3],
            rotary_rad: [0.0; 2],
            heard: Heard::All,
            beyond_motor_mm: 0.0,
        }
    }
}

impl Sweep {
    /// One of its states.
    pub fn state(&self, tick: u32) -> Event {
        let between =
            |from: f64, to: f64| from + (to - from) * f64::from(tick) / f64::from(self.ticks);
        let x_mm = between(self.from_mm, self.to_mm);
        let rotary_rad = [0, 1].map(|place| between(self.from_rad[place], self.to_rad[place]));
        Event::State {
            step_nanos: 1_000_000,
            position_mm: [x_mm, 0.0, -x_mm],
            rotary_rad,
            heard: Heard::All,
            beyond_motor_mm: 0.03 * (0.05 * x_mm).sin(),
        }
    }
}

fn position() -> impl Strategy<Value = f64> {
    prop_oneof![
        12 => -320.0..320.0_f64,
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => Just(-1e300),
    ]
}

fn spacing() -> impl Strategy<Value = i64> {
    prop_oneof![
        10 => Just(1_000_000_i64),
        6 => 1_000..200_000_000_i64,
        3 => Just(100_000_000),
        1 => Just(0),
        1 => -5_000_000_000..0_i64,
        1 => 200_000_001..100_000_000_000_i64,
        1 => Just(i64::MAX / 2),
        1 => Just(i64::MIN / 2),
    ]
}

fn number(range: std::ops::Range<f64>) -> impl Strategy<Value = f64> {
    prop_oneof![15 => range, 1 => Just(f64::NAN), 1 => Just(f64::NEG_INFINITY), 1 => Just(1e200)]
}

/// Of a machine with three axes, or of one whose rotary axes stand at zero.
pub fn event() -> impl Strategy<Value = Event> {
    let sweep = (-320.0..320.0_f64, -320.0..320.0_f64, 50..3000_u32);
    let state = (
        spacing(),
        position(),
        position(),
        position(),
        prop::bool::weighted(0.95),
        number(-0.05..0.05),
    );
    prop_oneof![
        3 => sweep.prop_map(|(from_mm, to_mm, ticks)| Event::Sweep(Sweep {
            from_mm,
            to_mm,
            from_rad: [0.0; 2],
            to_rad: [0.0; 2],
            ticks,
        })),
        40 => state.prop_map(|(step_nanos, x, y, z, all_axes, beyond_motor_mm)| Event::State {
            step_nanos,
            position_mm: [x, y, z],
            rotary_rad: [0.0; 2],
            heard: if all_axes { Heard::All } else { Heard::YAlone },
            beyond_motor_mm,
        }),
        2 => (any::<bool>(), any::<bool>()).prop_map(|(begin, completed)| Event::Test { begin, completed }),
        4 => (number(-0.15..0.15), number(-3e-4..3e-4), number(0.0..2.0), number(-1e-4..1e-4))
            .prop_map(|(k0_mm, slope, life_s, rate_mm_s)| Event::Model { k0_mm, slope, life_s, rate_mm_s }),
        2 => any::<bool>().prop_map(Event::Enable),
        3 => any::<bool>().prop_map(Event::Active),
        3 => Just(Event::Tick),
        2 => (-1_000_000_000..1_000_000_000_i64).prop_map(|host_nanos| Event::Wait { host_nanos }),
        1 => prop::bool::weighted(0.1).prop_map(|b| if b { Event::Shutdown } else { Event::Tick }),
    ]
}

fn angle() -> impl Strategy<Value = f64> {
    prop_oneof![
        20 => -3.2..3.2_f64,
        3 => -40.0..40.0_f64,
        1 => Just(f64::NAN),
        1 => Just(f64::NEG_INFINITY),
        1 => Just(1e300),
    ]
}

/// Of a machine whose rotary axes move too, and of which geometry models come.
pub fn event_of_five_axes() -> impl Strategy<Value = Event> {
    let turned = || [-6.3..6.3_f64, -6.3..6.3_f64];
    let sweep = (
        -320.0..320.0_f64,
        -320.0..320.0_f64,
        turned(),
        turned(),
        50..3000_u32,
    );
    let heard =
        prop_oneof![18 => Just(Heard::All), 1 => Just(Heard::Linear), 1 => Just(Heard::YAlone)];
    let positions = (position(), position(), position(), angle(), angle());
    prop_oneof![
        24 => event(),
        3 => sweep.prop_map(|(from_mm, to_mm, from_rad, to_rad, ticks)| Event::Sweep(Sweep {
            from_mm,
            to_mm,
            from_rad,
            to_rad,
            ticks,
        })),
        24 => (spacing(), positions, heard, number(-0.05..0.05))
            .prop_map(|(step_nanos, (x, y, z, a, c), heard, beyond_motor_mm)| Event::State {
                step_nanos,
                position_mm: [x, y, z],
                rotary_rad: [a, c],
                heard,
                beyond_motor_mm,
            }),
        8 => geometry().prop_map(|geometry| Event::Geometry(Box::new(geometry))),
    ]
}
