//! Friction of guides and bearings: Maxwell-slip elements under a Stribeck level that lags.
//!
//! ```text
//!   s(v)    = F_c + (F_s - F_c) / (1 + (v/v_s)^2)                      (1)  Stribeck, Lorentz form
//!   ds/dt   = (s(v) - s) / tau                                         (2)  frictional memory
//!   F_i    <- clip(F_i + k_i dx, -w_i s, +w_i s),   sum w_i = 1        (3)  elastic slip element
//!   F       = sum F_i + c v                                            (4)
//! ```
//!
//! Why slip elements and not LuGre: below a micrometre friction is a spring with memory of every
//! reversal, which LuGre lacks, and LuGre creeps under a load that it should hold, so that a resting
//! axis would drift during a four-hour run. (3) is a return mapping: whatever the step, no element
//! carries more than its share. Equation (2) stands for the slip-phase lag of the generalised model \[1\].
//!
//! Four elements break away at 1/8, 1/4, 1/2 and all of the presliding distance.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | F_c, F_s | `coulomb`, `breakaway` | unit of acceleration (force over total inertia) |
//! | v_s | `stribeck_velocity` | mm/s or rad/s |
//! | tau | `memory_s` | s |
//!
//! # Holds when
//! The step is shorter than a quarter period of mass and presliding stiffness. Not modelled: wear, dependence
//! on temperature. Of lubrication [`Friction::run_dry`] has the level alone: the contacts stay as stiff.
//!
//! # References
//! \[1\] F. Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Autom. Control 50(11), 2005, doi:10.1109/TAC.2005.858676 (from memory).

const ELEMENTS: usize = 4;
const SHARE: [f64; ELEMENTS] = [0.3, 0.3, 0.2, 0.2];
const BREAKAWAY_AT: [f64; ELEMENTS] = [0.125, 0.25, 0.5, 1.0];

/// Constants of one friction contact; forces are divided by the drive's total inertia.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrictionConstants {
    pub(super) coulomb: f64,
    pub(super) breakaway: f64,
    pub(super) stribeck_velocity: f64,
    pub(super) viscous: f64,
    pub(super) presliding: f64,
    pub(super) memory_s: f64,
}

/// One friction contact with its state.
#[derive(Clone, Debug)]
pub(super) struct Friction {
    constants: FrictionConstants,
    /// Coulomb and breakaway friction with oil.
    oiled: [f64; 2],
    stiffness: [f64; ELEMENTS],
    inverse_stribeck_velocity: f64,
    element: [f64; ELEMENTS],
    level: f64,
    /// Share of (2) that one step closes, by backward Euler.
    follow: f64,
}

impl Friction {
    pub(super) fn new(constants: FrictionConstants) -> Self {
        let stiffness = std::array::from_fn(|i| {
            SHARE[i] * constants.breakaway / (BREAKAWAY_AT[i] * constants.presliding)
        });
        Self {
            constants,
            oiled: [constants.coulomb, constants.breakaway],
            stiffness,
            inverse_stribeck_velocity: 1.0 / constants.stribeck_velocity,
            element: [0.0; ELEMENTS],
            level: constants.breakaway,
            follow: 0.0,
        }
    }

    /// The level of (1) becomes that with oil times a ratio.
    pub(super) fn run_dry(&mut self, ratio: f64) {
        let [coulomb, breakaway] = self.oiled.map(|level| ratio * level);
        (self.constants.coulomb, self.constants.breakaway) = (coulomb, breakaway);
    }

    /// Forgets all elastic stress.
    pub(super) fn relax(&mut self) {
        self.element = [0.0; ELEMENTS];
        self.level = self.constants.breakaway;
    }

    /// Stiffness at rest, before any element slips.
    pub(super) fn rest_stiffness(&self) -> f64 {
        self.stiffness.iter().sum()
    }

    /// Fixes the length of the steps to come.
    pub(super) fn prepare(&mut self, step_s: f64) {
        self.follow = step_s / (self.constants.memory_s + step_s);
    }

    /// Moves the contact by `displacement` at `velocity` and gives the force against the motion.
    pub(super) fn step(&mut self, displacement: f64, velocity: f64) -> f64 {
        let constants = &self.constants;
        let ratio = velocity * self.inverse_stribeck_velocity;
        let target =
            constants.coulomb + (constants.breakaway - constants.coulomb) / (1.0 + ratio * ratio); // (1)
        self.level += (target - self.level) * self.follow; // (2)
        let mut force = constants.viscous * velocity;
        for ((element, stiffness), share) in
            self.element.iter_mut().zip(&self.stiffness).zip(&SHARE)
        {
            let limit = share * self.level;
            *element = (*element + stiffness * displacement).max(-limit).min(limit); // (3)
            force += *element; // (4)
        }
        force
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn contact() -> Friction {
        let mut contact = Friction::new(FrictionConstants {
            coulomb: 100.0,
            breakaway: 150.0,
            stribeck_velocity: 2.0,
            viscous: 0.5,
            presliding: 0.008,
            memory_s: 0.004,
        });
        contact.prepare(1e-3);
        contact
    }

    /// Slides at constant velocity until everything has settled.
    fn steady(contact: &mut Friction, velocity: f64) -> f64 {
        (0..4000).fold(0.0, |_, _| contact.step(velocity * 1e-3, velocity))
    }

    #[test]
    fn eq1_steady_friction_follows_the_stribeck_curve_in_both_directions() {
        for velocity in [0.1, 2.0, 20.0, -0.1, -2.0, -20.0] {
            let force = steady(&mut contact(), velocity);
            let curve = 100.0 + 50.0 / (1.0 + (velocity / 2.0_f64).powi(2));
            let expected = curve * velocity.signum() + 0.5 * velocity;
            assert!(
                (force - expected).abs() < 1e-6 * expected.abs(),
                "{velocity}: {force}"
            );
        }
    }

    #[test]
    fn eq2_friction_lags_a_velocity_step() {
        let mut contact = contact();
        let slow = steady(&mut contact, 0.1);
        let at_once = contact.step(0.02, 20.0) - 0.5 * 20.0;
        assert!(at_once > 0.75 * slow, "{at_once} after {slow}");
        let later = steady(&mut contact, 20.0) - 0.5 * 20.0;
        assert!(later < 0.7 * slow);
    }

    #[test]
    fn eq3_virgin_curve_starts_stiff_and_breaks_away_at_the_presliding_distance() {
        let mut contact = contact();
        let first = (contact.step(1e-6, 1e-3) - 0.5 * 1e-3) / 1e-6;
        let expected = 150.0 / 0.008 * (0.3 / 0.125 + 0.3 / 0.25 + 0.2 / 0.5 + 0.2);
        assert!((first / expected - 1.0).abs() < 1e-3);
        let mut force = 0.0;
        for _ in 0..8000 {
            force = contact.step(1e-6, 1e-3);
        }
        assert!(
            (force - 150.0).abs() < 0.1,
            "breaks away at the presliding distance: {force}"
        );
    }

    #[test]
    fn eq3_presliding_loops_close_with_memory_of_the_reversal_point() {
        let mut contact = contact();
        let mut walk = |steps: i32, sign: f64| {
            (0..steps).fold(0.0, |_, _| contact.step(sign * 1e-6, sign * 1e-3))
        };
        let outer = walk(3000, 1.0);
        walk(800, -1.0);
        let back = walk(800, 1.0);
        assert!(
            (outer - back).abs() < 0.05,
            "an inner loop returns to where it left: {outer} {back}"
        );
    }

    #[test]
    fn a_constant_load_below_breakaway_is_held_without_creep() {
        let mut contact = contact();
        contact.prepare(5e-4);
        let (mut position, mut velocity, mut friction) = (0.0_f64, 0.0_f64, 0.0_f64);
        let mut after_a_second = 0.0;
        for tick in 0..60_000 {
            velocity += (80.0 - friction - 20.0 * velocity) * 5e-4;
            position += velocity * 5e-4;
            friction = contact.step(velocity * 5e-4, velocity);
            if tick == 2000 {
                after_a_second = position;
            }
        }
        assert!(
            (position - after_a_second).abs() < 1e-6,
            "{position} {after_a_second}"
        );
    }
}
