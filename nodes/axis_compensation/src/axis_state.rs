//! What one axis' compensation is doing, and where it is going therefore.
//!
//! ```text
//!            good value                 refused              hold_s over
//!   Off ───────────────▶ Active/Limited ───────▶ Holding ───────────────▶ Fading ──▶ Off
//!    ▲                      ▲      │  ▲            │                        │  │
//!    └── at rest at zero    └──────┼──┴────────────┴──── good value ────────┘  │
//!                                  └── disabled or shutting down ──▶ Fading ◀──┘
//! ```
//!
//! The target follows the model (Active), stays where it last was (Holding), or goes to zero along
//! a straight line in `fade_s` (Fading), or in `shutdown_fade_s` when the node is told to end. A value beyond the size limit is not followed and not cut:
//! the target stays at the last one inside (Limited). The limiter turns the target into the offset.

use metrology::sample::CompensationState;

use crate::limiter::{Limiter, Limits};
use crate::parts::PartRefusal;

/// Times of holding and fading, s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LetGo {
    /// How long the last good value is held.
    pub hold_s: f64,
    /// How long the way to zero takes.
    pub fade_s: f64,
    /// How long it takes at most when the node is told to end.
    pub shutdown_fade_s: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Mode {
    Off,
    Following,
    Holding { for_s: f64 },
    Fading { from: f64, for_s: f64 },
}

/// What is wanted of an axis at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Wanted {
    /// This offset, mm.
    Offset(f64),
    /// A part of it is refused.
    Refused(PartRefusal),
    /// Nothing may be added: disabled or shutting down.
    Nothing,
}

/// One compensated axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisState {
    limiter: Limiter,
    mode: Mode,
    target: f64,
    oversize: Option<f64>,
    lags: bool,
    tolerance: f64,
    let_go: LetGo,
    /// Time that the next fade takes.
    fade_s: f64,
}

impl AxisState {
    /// At rest at zero. A lag behind the target above two `pulse` counts as limited.
    #[must_use]
    pub fn new(limits: Limits, let_go: LetGo, pulse: f64) -> Self {
        Self {
            limiter: Limiter::new(limits),
            mode: Mode::Off,
            target: 0.0,
            oversize: None,
            lags: false,
            tolerance: pulse,
            let_go,
            fade_s: let_go.fade_s,
        }
    }

    /// The offset, mm.
    #[must_use]
    pub fn offset(&self) -> f64 {
        self.limiter.offset()
    }

    /// The wanted offset that exceeds the size limit at present, mm.
    #[must_use]
    pub fn oversize(&self) -> Option<f64> {
        self.oversize
    }

    /// The greatest offset allowed, mm.
    #[must_use]
    pub fn size_limit(&self) -> f64 {
        self.limiter.limits().size
    }

    /// Whether nothing is added and nothing moves.
    #[must_use]
    pub fn is_off(&self) -> bool {
        self.mode == Mode::Off && self.limiter.is_at_rest_at_zero()
    }

    /// What is published.
    #[must_use]
    pub fn state(&self) -> CompensationState {
        match self.mode {
            Mode::Off => CompensationState::Off,
            Mode::Following if self.oversize.is_some() || self.lags => CompensationState::Limited,
            Mode::Following => CompensationState::Active,
            Mode::Holding { .. } => CompensationState::Holding,
            Mode::Fading { .. } => CompensationState::Fading,
        }
    }

    /// Nothing was heard of the axes for a while: the offset stood, and goes on standing.
    pub fn freeze(&mut self) {
        self.limiter.freeze();
        if self.mode == Mode::Following {
            self.target = self.limiter.offset();
            self.mode = Mode::Holding { for_s: 0.0 };
        }
    }

    /// The node is told to end, or not to act: what is left goes to zero in `shutdown_fade_s`, as far as the limits allow.
    pub fn hasten(&mut self) {
        let fade_s = self.let_go.shutdown_fade_s;
        match self.mode {
            Mode::Fading { for_s, .. } if self.fade_s - for_s <= fade_s => {}
            Mode::Fading { .. } => {
                self.fade_s = fade_s;
                self.mode = Mode::Fading {
                    from: self.target,
                    for_s: 0.0,
                };
            }
            _ => self.fade_s = self.fade_s.min(fade_s),
        }
    }

    /// The node may act again: the next fade takes its ordinary time.
    pub fn take_time(&mut self) {
        if let Mode::Fading { .. } = self.mode {
            self.mode = Mode::Fading {
                from: self.target,
                for_s: 0.0,
            };
        }
        self.fade_s = self.let_go.fade_s;
    }

    /// One tick of `dt_s` > 0; the offset follows.
    pub fn step(&mut self, wanted: Wanted, dt_s: f64) {
        self.mode = self.next_mode(wanted, dt_s);
        self.oversize = None;
        match (self.mode, wanted) {
            (Mode::Following, Wanted::Offset(offset)) if offset.abs() <= self.size_limit() => {
                self.target = offset;
            }
            (Mode::Following, Wanted::Offset(offset)) => self.oversize = Some(offset),
            (Mode::Fading { from, for_s }, _) => {
                let left = 1.0 - for_s / self.fade_s;
                self.target = if left > 0.0 { from * left } else { 0.0 };
            }
            (Mode::Off, _) => self.target = 0.0,
            _ => {}
        }
        self.limiter.follow(self.target, dt_s);
        let lag = (self.target - self.limiter.offset()).abs();
        self.lags = lag > if self.lags { 0.5 } else { 2.0 } * self.tolerance;
        if matches!(self.mode, Mode::Fading { .. })
            && self.target == 0.0
            && self.limiter.is_at_rest_at_zero()
        {
            self.mode = Mode::Off;
        }
    }

    fn next_mode(&self, wanted: Wanted, dt_s: f64) -> Mode {
        let fade = Mode::Fading {
            from: self.target,
            for_s: dt_s,
        };
        match (wanted, self.mode) {
            (Wanted::Offset(_), _) => Mode::Following,
            (Wanted::Refused(_), Mode::Following) => Mode::Holding { for_s: 0.0 },
            (Wanted::Refused(_), Mode::Holding { for_s }) if for_s + dt_s < self.let_go.hold_s => {
                Mode::Holding {
                    for_s: for_s + dt_s,
                }
            }
            (Wanted::Refused(_), Mode::Holding { .. }) => fade,
            (Wanted::Nothing, Mode::Following | Mode::Holding { .. }) => fade,
            (_, Mode::Fading { from, for_s }) => Mode::Fading {
                from,
                for_s: for_s + dt_s,
            },
            (_, Mode::Off) => Mode::Off,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::Axis;
    use metrology::drift::DriftRefusal;

    const REFUSED: Wanted = Wanted::Refused(PartRefusal::Thermal {
        source: DriftRefusal::NotModelled { axis: Axis::X },
    });
    const DT_S: f64 = 1e-3;

    fn axis() -> AxisState {
        let limits = Limits {
            size: 0.2,
            rate: 0.1,
            acceleration: 1.0,
        };
        AxisState::new(
            limits,
            LetGo {
                hold_s: 1.0,
                fade_s: 2.0,
                shutdown_fade_s: 0.5,
            },
            1e-4,
        )
    }

    fn run(axis: &mut AxisState, wanted: Wanted, seconds: f64) {
        for _ in 0..(seconds / DT_S).round() as u32 {
            axis.step(wanted, DT_S);
        }
    }

    #[test]
    fn a_refused_model_is_held_then_faded_then_off() {
        let mut axis = axis();
        run(&mut axis, Wanted::Offset(0.05), 2.0);
        assert_eq!(axis.state(), CompensationState::Active);
        run(&mut axis, REFUSED, 0.9);
        assert_eq!(
            (axis.state(), axis.offset()),
            (CompensationState::Holding, 0.05)
        );
        run(&mut axis, REFUSED, 1.1);
        assert_eq!(axis.state(), CompensationState::Fading);
        assert!((axis.offset() - 0.025).abs() < 1e-3, "{}", axis.offset());
        run(&mut axis, REFUSED, 2.0);
        assert!(axis.is_off() && axis.offset() == 0.0);
        run(&mut axis, REFUSED, 1.0);
        assert_eq!(axis.state(), CompensationState::Off);
    }

    #[test]
    fn a_model_that_comes_back_is_followed_from_where_the_axis_is() {
        let mut axis = axis();
        run(&mut axis, Wanted::Offset(0.05), 2.0);
        run(&mut axis, REFUSED, 2.0);
        let before = axis.offset();
        axis.step(Wanted::Offset(0.05), DT_S);
        assert!((axis.offset() - before).abs() <= 0.1 * DT_S);
        run(&mut axis, Wanted::Offset(0.05), 2.0);
        assert_eq!(axis.state(), CompensationState::Active);
    }

    #[test]
    fn a_value_beyond_the_size_limit_is_not_cut_but_the_last_one_inside_is_kept() {
        let mut axis = axis();
        run(&mut axis, Wanted::Offset(0.15), 3.0);
        run(&mut axis, Wanted::Offset(0.21), 3.0);
        assert_eq!(axis.state(), CompensationState::Limited);
        assert_eq!(axis.oversize(), Some(0.21));
        assert!((axis.offset() - 0.15).abs() < 1e-12);
    }

    #[test]
    fn disabling_fades_from_any_state() {
        let mut axis = axis();
        run(&mut axis, Wanted::Offset(0.05), 2.0);
        run(&mut axis, REFUSED, 0.5);
        run(&mut axis, Wanted::Nothing, 0.1);
        assert_eq!(axis.state(), CompensationState::Fading);
        run(&mut axis, Wanted::Nothing, 2.5);
        assert!(axis.is_off());
    }

    #[test]
    fn hastened_the_fade_is_short_whether_or_not_one_is_under_way() {
        for fading in [false, true] {
            let mut axis = axis();
            run(&mut axis, Wanted::Offset(0.02), 2.0);
            if fading {
                run(&mut axis, Wanted::Nothing, 0.1);
            }
            axis.hasten();
            run(&mut axis, Wanted::Nothing, 0.7);
            assert!(axis.is_off(), "fading before: {fading}");
        }
    }

    #[test]
    fn after_a_hastened_fade_the_next_one_takes_its_time_again() {
        let mut axis = axis();
        run(&mut axis, Wanted::Offset(0.02), 2.0);
        axis.hasten();
        run(&mut axis, Wanted::Nothing, 0.25);
        axis.take_time();
        run(&mut axis, Wanted::Offset(0.02), 1.0);
        assert!((axis.offset() - 0.02).abs() < 1e-12);
        run(&mut axis, Wanted::Nothing, 1.0);
        assert!((axis.offset() - 0.01).abs() < 1e-3, "{}", axis.offset());
    }

    #[test]
    fn hastening_does_not_lengthen_a_fade_that_is_nearly_over() {
        let mut axis = axis();
        run(&mut axis, Wanted::Offset(0.05), 2.0);
        run(&mut axis, Wanted::Nothing, 1.8);
        axis.hasten();
        run(&mut axis, Wanted::Nothing, 0.4);
        assert!(axis.is_off());
    }

    #[test]
    fn a_gap_freezes_and_then_goes_on_from_rest() {
        let mut axis = axis();
        run(&mut axis, Wanted::Offset(0.1), 0.5);
        let before = axis.offset();
        axis.freeze();
        assert_eq!(axis.state(), CompensationState::Holding);
        axis.step(Wanted::Offset(0.1), DT_S);
        assert!((axis.offset() - before).abs() <= 1.0 * DT_S * DT_S + 1e-15);
    }
}
