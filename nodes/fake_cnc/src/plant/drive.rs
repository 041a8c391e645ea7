//! One drive: motor, screw or gear with soft backlash, slide, and friction on both.
//!
//! ```text
//!   r_m dv/dt = clip(u, -u_max, u_max) - c - f_m(theta)                (1)  motor side
//!   r_s dw/dt = c - f_s(s)                                             (2)  slide side
//!   c = F(theta - s) + D(theta - s) (v - w)                            (3)  screw and nut
//!   r_m + r_s = 1
//! ```
//!
//! Forces are over the total inertia, so that the demand `u` is the acceleration of a machine
//! without friction. Both masses advance by semi-implicit Euler (velocity first) in half periods;
//! that is stable while the fastest natural frequency times the step stays below 2, which
//! [`Drive::natural_step_product`] gives to the check at construction. The damping `D` works only
//! where the spring is engaged.
//!
//! The linear or rotary motion at the motor's encoder is `theta`; the slide's own `s` lags it by the
//! wind-up and lies on one or the other flank of the gap. What heat does to the screw between both
//! is not here but in `screw`.
//!
//! # Holds when
//! One elastic mode per drive; the motor's current loop is taken as ideal.

use super::backlash::SoftBacklash;
use super::friction::{Friction, FrictionConstants};

/// Parts into which a servo period is divided.
const SUBSTEPS: u32 = 2;

/// Constants of a drive, per unit of its total inertia.
#[derive(Clone, Copy, Debug)]
pub(super) struct DriveConstants {
    pub(super) motor_share: f64,
    pub(super) demand_limit: f64,
    pub(super) coupling: SoftBacklash,
    pub(super) damping_ratio: f64,
    pub(super) motor_friction: FrictionConstants,
    pub(super) slide_friction: FrictionConstants,
}

/// One drive with its state; mm or rad.
#[derive(Clone, Debug)]
pub(super) struct Drive {
    constants: DriveConstants,
    /// Half the width of the gap from an instant (s since the start) on.
    wear: Vec<(f64, f64)>,
    has_worn: usize,
    /// Friction of the guides from an instant on, over that with oil.
    dryness: Vec<(f64, f64)>,
    has_dried: usize,
    /// Damping over engaged stiffness, s.
    damping_time_s: f64,
    motor_friction: Friction,
    slide_friction: Friction,
    motor_force: f64,
    slide_force: f64,
    /// Period for which the gains below were made, s.
    period_s: f64,
    step_s: f64,
    motor_gain_s: f64,
    slide_gain_s: f64,
    pub(super) motor: f64,
    pub(super) motor_velocity: f64,
    pub(super) slide: f64,
    pub(super) slide_velocity: f64,
}

impl Drive {
    pub(super) fn new(constants: DriveConstants) -> Self {
        let stiffness = constants
            .coupling
            .stiffness_up
            .max(constants.coupling.stiffness_down);
        let reduced = constants.motor_share * (1.0 - constants.motor_share);
        Self {
            damping_time_s: 2.0 * constants.damping_ratio * (reduced / stiffness).sqrt(),
            motor_friction: Friction::new(constants.motor_friction),
            slide_friction: Friction::new(constants.slide_friction),
            constants,
            wear: Vec::new(),
            has_worn: 0,
            dryness: Vec::new(),
            has_dried: 0,
            motor_force: 0.0,
            slide_force: 0.0,
            period_s: 0.0,
            step_s: 0.0,
            motor_gain_s: 0.0,
            slide_gain_s: 0.0,
            motor: 0.0,
            motor_velocity: 0.0,
            slide: 0.0,
            slide_velocity: 0.0,
        }
    }

    /// The drive with a gap that widens: instants in s since the start, half widths.
    pub(super) fn that_wears(mut self, wear: Vec<(f64, f64)>) -> Self {
        self.wear = wear;
        self
    }

    /// The drive with guides that run dry: instants in s since the start, friction over that with oil.
    pub(super) fn that_dries(mut self, dryness: Vec<(f64, f64)>) -> Self {
        self.dryness = dryness;
        self
    }

    /// Lets the gap have the width, and the guides the friction, that they have at `elapsed_s`.
    pub(super) fn age(&mut self, elapsed_s: f64) {
        while let Some((_, half_width)) = due(&self.wear, self.has_worn, elapsed_s) {
            self.constants.coupling.half_width = half_width;
            self.has_worn += 1;
        }
        while let Some((_, ratio)) = due(&self.dryness, self.has_dried, elapsed_s) {
            self.slide_friction.run_dry(ratio);
            self.has_dried += 1;
        }
    }

    /// Fastest natural frequency times the inner step; must stay below 2.
    pub(super) fn natural_step_product(&self, period_s: f64) -> f64 {
        let coupling = &self.constants.coupling;
        let spring = coupling.stiffness_up.max(coupling.stiffness_down);
        let motor = (spring + self.motor_friction.rest_stiffness()) / self.constants.motor_share;
        let slide =
            (spring + self.slide_friction.rest_stiffness()) / (1.0 - self.constants.motor_share);
        (motor + slide).sqrt() * period_s / f64::from(SUBSTEPS)
    }

    /// At rest at `position`, without stress.
    pub(super) fn settle_at(&mut self, position: f64) {
        self.motor = position;
        self.slide = position;
        self.motor_velocity = 0.0;
        self.slide_velocity = 0.0;
        self.motor_force = 0.0;
        self.slide_force = 0.0;
        self.motor_friction.relax();
        self.slide_friction.relax();
    }

    /// Divisions that every period would repeat, for periods of `period_s`.
    fn prepare(&mut self, period_s: f64) {
        self.period_s = period_s;
        self.step_s = period_s / f64::from(SUBSTEPS);
        self.motor_gain_s = self.step_s / self.constants.motor_share;
        self.slide_gain_s = self.step_s / (1.0 - self.constants.motor_share);
        self.motor_friction.prepare(self.step_s);
        self.slide_friction.prepare(self.step_s);
    }

    /// One servo period under a constant acceleration demand.
    #[expect(clippy::float_cmp, reason = "an unchanged period needs no new gains")]
    pub(super) fn step(&mut self, demand: f64, period_s: f64) {
        if period_s != self.period_s {
            self.prepare(period_s);
        }
        let limit = self.constants.demand_limit;
        let demand = demand.max(-limit).min(limit);
        for _ in 0..SUBSTEPS {
            let lead = self.motor - self.slide;
            let (spring, engaged) = self.constants.coupling.force_and_stiffness(lead);
            let closing = self.motor_velocity - self.slide_velocity;
            let coupling = spring + self.damping_time_s * engaged * closing; // (3)
            self.motor_velocity += self.motor_gain_s * (demand - coupling - self.motor_force); // (1)
            self.slide_velocity += self.slide_gain_s * (coupling - self.slide_force); // (2)
            let motor_move = self.motor_velocity * self.step_s;
            let slide_move = self.slide_velocity * self.step_s;
            self.motor += motor_move;
            self.slide += slide_move;
            self.motor_force = self.motor_friction.step(motor_move, self.motor_velocity);
            self.slide_force = self.slide_friction.step(slide_move, self.slide_velocity);
        }
    }
}

/// The entry of a course that is next, where its instant has come.
fn due(course: &[(f64, f64)], next: usize, elapsed_s: f64) -> Option<(f64, f64)> {
    let entry = course.get(next).copied();
    entry.filter(|(after_s, _)| *after_s <= elapsed_s)
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 1e-3;

    fn constants() -> DriveConstants {
        let friction = FrictionConstants {
            coulomb: 60.0,
            breakaway: 90.0,
            stribeck_velocity: 2.0,
            viscous: 0.5,
            presliding: 0.008,
            memory_s: 0.004,
        };
        DriveConstants {
            motor_share: 0.65,
            demand_limit: 6000.0,
            coupling: SoftBacklash {
                half_width: 1.5e-3,
                softness: 2e-4,
                stiffness_up: 1.1e5,
                stiffness_down: 1.0e5,
            },
            damping_ratio: 0.1,
            motor_friction: friction,
            slide_friction: friction,
        }
    }

    /// Follows a slow command with a plain PID on the motor; gives (motor, slide) at each tick.
    fn follow(drive: &mut Drive, command: impl Fn(f64) -> f64, seconds: f64) -> Vec<(f64, f64)> {
        let mut integral = 0.0;
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "few ticks"
        )]
        let ticks = (seconds / PERIOD_S) as u32;
        (0..ticks)
            .map(|tick| {
                let error = command(f64::from(tick) * PERIOD_S) - drive.motor;
                integral += error * PERIOD_S;
                let demand = 6400.0 * error + 60_000.0 * integral - 120.0 * drive.motor_velocity;
                drive.step(demand, PERIOD_S);
                (drive.motor, drive.slide)
            })
            .collect()
    }

    #[test]
    fn eq1_free_acceleration_equals_the_demand_less_friction() {
        let mut drive = Drive::new(constants());
        for _ in 0..200 {
            drive.step(3000.0, PERIOD_S);
        }
        let before = drive.motor_velocity;
        for _ in 0..20 {
            drive.step(3000.0, PERIOD_S);
        }
        let acceleration = (drive.motor_velocity - before) / 0.02;
        let friction = 2.0 * (60.0 + 0.5 * drive.motor_velocity);
        assert!(
            (acceleration - (3000.0 - friction)).abs() < 30.0,
            "{acceleration}"
        );
    }

    #[test]
    fn eq1_the_demand_saturates_at_the_force_limit() {
        let (mut limited, mut beyond) = (Drive::new(constants()), Drive::new(constants()));
        for _ in 0..50 {
            limited.step(6000.0, PERIOD_S);
            beyond.step(60_000.0, PERIOD_S);
        }
        assert_eq!(limited.motor.to_bits(), beyond.motor.to_bits());
    }

    #[test]
    fn val_slow_reversal_shows_backlash_and_windup() {
        let mut drive = Drive::new(constants());
        let triangle = |t: f64| if t < 3.0 { t } else { 6.0 - t };
        let trace = follow(&mut drive, triangle, 6.0);
        let lead = |from: usize, to: usize| {
            trace[from..to].iter().map(|(m, s)| m - s).sum::<f64>() / (to - from) as f64
        };
        let seen = lead(2000, 2900) - lead(5000, 5900);
        // At 1 mm/s the guide's Stribeck force is 60 + 30/(1 + 0.25) + 0.5.
        let guide = 60.0 + 30.0 / 1.25 + 0.5;
        let expected = 3e-3 + guide / 1.1e5 + guide / 1.0e5;
        assert!(
            (seen - expected).abs() < 5e-5,
            "seen {seen}, expected {expected}"
        );
    }

    #[test]
    fn a_gap_widens_at_its_time_and_not_before() {
        let mut drive = Drive::new(constants()).that_wears(vec![(60.0, 4e-3)]);
        let half_width = |drive: &Drive| drive.constants.coupling.half_width;
        drive.age(59.0);
        assert!((half_width(&drive) - 1.5e-3).abs() < 1e-12);
        drive.age(60.0);
        assert!((half_width(&drive) - 4e-3).abs() < 1e-12);
    }

    #[test]
    fn guides_that_run_dry_wind_the_screw_up_by_their_friction() {
        // At 50 mm/s the Stribeck part is gone: 60 + 30/626 + 25 of 110,000 and 100,000 one way and the other.
        let lost_mm = |ratio: f64| {
            let mut drive = Drive::new(constants()).that_dries(vec![(60.0, ratio)]);
            drive.age(60.0);
            let triangle = |t: f64| 50.0 * if t < 2.0 { t } else { 4.0 - t };
            let trace = follow(&mut drive, triangle, 4.0);
            let lead = |from: usize, to: usize| {
                trace[from..to].iter().map(|(m, s)| m - s).sum::<f64>() / (to - from) as f64
            };
            lead(1500, 1900) - lead(3500, 3900)
        };
        let more_mm = lost_mm(3.0) - lost_mm(1.0);
        let expected_mm = 2.0 * (60.0 + 30.0 / 626.0) * (1.0 / 1.1e5 + 1.0 / 1e5);
        assert!(
            (more_mm / expected_mm - 1.0).abs() < 0.03,
            "{more_mm} {expected_mm}"
        );
    }

    #[test]
    fn a_settled_drive_stays_where_it_is() {
        let mut drive = Drive::new(constants());
        drive.settle_at(12.5);
        for _ in 0..5000 {
            drive.step(0.0, PERIOD_S);
        }
        assert!((drive.motor - 12.5).abs() < 1e-4 && (drive.slide - 12.5).abs() < 1e-4);
    }

    #[test]
    fn the_inner_step_is_well_inside_the_stable_range() {
        assert!(Drive::new(constants()).natural_step_product(PERIOD_S) < 1.0);
    }
}
