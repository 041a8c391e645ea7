//! What changes during a shift.
//!
//! | change | in the plant | over time |
//! |---|---|---|
//! | a clamp slips | a block stands elsewhere | at once, during production |
//! | a block creeps | as above | (1) |
//! | the plate slips, creeps | it moves within one of the three times of circles | at once; evenly |
//! | lost motion steps up | the gap of a drive is wider | at once, during production |
//! | oil lacks | friction of the guides of an axis | (2) |
//!
//! ```text
//!   s(t) = s ln(1 + (t - t_0)/T) / ln(1 + (t_1 - t_0)/T)                  (1)
//!   F(t)/F_0 = 1 + (F/F_0) ((t - t_0)/(t_1 - t_0))^p                      (2)
//! ```
//!
//! t_1 is the end of the shift. (1) is how a clamped joint settles after a load, (2) a film that is used up; both are made of
//! steps of some minutes.

use fake_cnc::plant::{BumpEntry, LubricationEntry, WearEntry};
use metrology::Axis;
use rand::Rng;
use rand::seq::IndexedRandom;
use rand_pcg::Pcg64Mcg;

use super::plate::PlateMove;
use super::programme::{RunOfShift, Timeline};
use crate::error::TrialError;
use crate::rig::Rig;
use crate::shop::dice::log_uniform;
use crate::shop::{Name, name};

/// Steps that (1) and (2) are made of, s.
const CREEP_STEP_S: f64 = 120.0;
/// Part of the shift in which changes at once come, and gradual ones begin.
const AT_ONCE: [f64; 2] = [0.2, 0.8];
const BEGINS: [f64; 2] = [0.05, 0.5];

/// Kinds of changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    ClampSlips,
    BlockCreeps,
    PlateSlips,
    PlateCreeps,
    PlaySteps,
    OilLacks,
}

impl Kind {
    pub(super) const ALL: [Self; 6] = [
        Self::ClampSlips,
        Self::BlockCreeps,
        Self::PlateSlips,
        Self::PlateCreeps,
        Self::PlaySteps,
        Self::OilLacks,
    ];

    /// In the words of a shop.
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::ClampSlips => "a clamp slips",
            Self::BlockCreeps => "a block creeps",
            Self::PlateSlips => "the plate slips",
            Self::PlateCreeps => "the plate creeps",
            Self::PlaySteps => "lost motion steps up",
            Self::OilLacks => "oil lacks",
        }
    }

    /// Least and greatest size, and the unit.
    pub(super) const fn sizes(self) -> ([f64; 2], &'static str) {
        match self {
            Self::ClampSlips | Self::BlockCreeps => ([0.5, 80.0], "µm"),
            Self::PlateSlips | Self::PlateCreeps => ([0.2, 60.0], "µm"),
            Self::PlaySteps => ([0.3, 25.0], "µm"),
            Self::OilLacks => ([20.0, 2000.0], "N"),
        }
    }
}

/// A change with its time and form, without its size.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Change {
    pub kind: Kind,
    /// The axis of a drive.
    pub axis: Axis,
    /// Which block.
    block: usize,
    /// A direction of length 1.
    direction: [f64; 3],
    /// Begin and end since the session began, s; no end where it is at once.
    pub from_s: f64,
    pub until_s: Option<f64>,
    /// Time from one test that shows it to the next, s.
    pub cycle_s: f64,
    /// T of (1), s, p of (2), turn of the plate per shift, rad/mm.
    settling_s: f64,
    power: f64,
    turn_per_mm: f64,
}

impl Change {
    /// Draws one of a kind that a shift with these runs can show; `axes` are those that circles move.
    pub(super) fn draw(
        random: &mut Pcg64Mcg,
        kind: Kind,
        timeline: &Timeline,
        axes: &[Axis],
    ) -> Option<Self> {
        let angle = random.random_range(0.0..std::f64::consts::TAU);
        let tilt: f64 = random.random_range(-0.3..0.3);
        let level = (1.0 - tilt * tilt).sqrt();
        let (from_s, until_s, cycle_s) = when(random, kind, timeline)?;
        Some(Self {
            kind,
            axis: *axes.choose(random)?,
            block: random.random_range(0..2),
            direction: [level * angle.cos(), level * angle.sin(), tilt],
            from_s,
            until_s,
            cycle_s,
            settling_s: log_uniform(random, [300.0, 7200.0]),
            power: random.random_range(1.0..3.0),
            turn_per_mm: random.random_range(-0.01..0.01),
        })
    }

    /// Lets a machine have it, which has worked for `past_s` before the session.
    pub(super) fn hide(&self, size: f64, rig: &mut Rig, past_s: f64) -> Result<(), TrialError> {
        let done = match self.kind {
            Kind::ClampSlips | Kind::BlockCreeps => self.move_block(size, rig, past_s),
            Kind::PlateSlips | Kind::PlateCreeps => {
                let size_mm = size / 1e3;
                let [u, v, _] = self.direction;
                rig.plate_moves = Some(PlateMove {
                    from_s: self.from_s,
                    over_s: self.until_s.map_or(0.0, |until_s| until_s - self.from_s),
                    shift_mm: [size_mm * u, size_mm * v],
                    turn_rad: size_mm * self.turn_per_mm,
                });
                Some(())
            }
            Kind::PlaySteps => rig.plant.linear_drives.get_mut(&self.axis).map(|drive| {
                drive.wear.push(WearEntry {
                    after_s: past_s + self.from_s,
                    backlash_um: drive.backlash_um + size,
                });
            }),
            Kind::OilLacks => rig.plant.linear_drives.get_mut(&self.axis).map(|drive| {
                let gain = size / drive.guide_friction.coulomb_n;
                let entry = |(at_s, share): (f64, f64)| LubricationEntry {
                    after_s: past_s + at_s,
                    friction_ratio: 1.0 + gain * share.powf(self.power), // (2)
                };
                drive
                    .lubrication
                    .extend(self.steps().into_iter().map(entry));
            }),
        };
        done.ok_or(TrialError::Impossible {
            effect: self.kind.words(),
            axis: "",
            size,
        })
    }

    fn move_block(&self, size_um: f64, rig: &mut Rig, past_s: f64) -> Option<()> {
        let id = rig.machine.blocks.get(self.block)?.id.clone();
        let bump = |(at_s, by): (f64, f64)| BumpEntry {
            id: id.clone(),
            at_s: past_s + at_s,
            shift_um: self.direction.map(|along| size_um * by * along),
        };
        let bumps: Vec<BumpEntry> = if self.until_s.is_none() {
            vec![bump((self.from_s, 1.0))]
        } else {
            let whole = self.settled(1.0);
            let mut before = 0.0;
            let of = |(at_s, share): (f64, f64)| {
                let now = self.settled(share) / whole; // (1)
                let by = now - before;
                before = now;
                bump((at_s, by))
            };
            self.steps().into_iter().map(of).collect()
        };
        rig.plant.faults.bumped_blocks.extend(bumps);
        Some(())
    }

    /// ln of (1) at a share of the time.
    fn settled(&self, share: f64) -> f64 {
        let length_s = self.until_s.map_or(0.0, |until_s| until_s - self.from_s);
        (share * length_s / self.settling_s).ln_1p()
    }

    /// Instants of a gradual change, s, with the share of its time that has passed.
    fn steps(&self) -> Vec<(f64, f64)> {
        let length_s = self.until_s.map_or(0.0, |until_s| until_s - self.from_s);
        let count = (length_s / CREEP_STEP_S).ceil().max(1.0);
        let of = |k: usize| {
            let share = k as f64 / count;
            (self.from_s + share * length_s, share)
        };
        (1..=count as usize).map(of).collect()
    }

    /// Names of the catalogue that are true of it, and those that may be there as well.
    pub(super) fn names(&self) -> [Vec<Name>; 2] {
        let axis = self.axis.letter();
        match self.kind {
            Kind::PlaySteps => [vec![name("backlash", axis)], vec![]],
            // What friction stretches is lost motion once the slide moves, and a loop overcomes it late.
            Kind::OilLacks => [
                vec![name("backlash", axis), name("reversal_spike", axis)],
                vec![name("feed_lost_motion", axis), name("stick_slip", axis)],
            ],
            _ => [vec![], vec![]],
        }
    }
}

/// Begin, end and test cycle of a change.
fn when(random: &mut Pcg64Mcg, kind: Kind, timeline: &Timeline) -> Option<(f64, Option<f64>, f64)> {
    let whole_s = timeline.length_s();
    let blocks = timeline.blocks();
    let cycle_s = match (blocks.first(), blocks.last()) {
        (Some(first), Some(last)) if blocks.len() > 1 => {
            (last.from_s - first.from_s) / (blocks.len() - 1) as f64
        }
        _ => return None,
    };
    let mut within = |[low, high]: [f64; 2]| whole_s * random.random_range(low..high);
    match kind {
        Kind::ClampSlips | Kind::PlaySteps => {
            let at_s = within(AT_ONCE);
            // During production, not during a test.
            let test = timeline
                .runs
                .iter()
                .find(|run| (run.from_s..=run.until_s).contains(&at_s));
            let is_test =
                test.is_some_and(|run| run.kind != metrology::sample::TestKind::Production);
            let at_s = if is_test {
                test.map_or(at_s, |run| run.until_s + 1.0)
            } else {
                at_s
            };
            Some((at_s, None, cycle_s))
        }
        Kind::BlockCreeps | Kind::OilLacks => Some((within(BEGINS), Some(whole_s), cycle_s)),
        Kind::PlateSlips | Kind::PlateCreeps => {
            let groups = timeline.circle_groups();
            let group: &Vec<&RunOfShift> = groups.choose(random)?;
            let (first, last) = (group.first()?, group.last()?);
            let own_s = 0.5 * (last.from_s - first.from_s);
            if kind == Kind::PlateCreeps {
                return Some((first.from_s, Some(last.until_s), own_s));
            }
            // Two circles or more on either side of it.
            let places = 2..group.len().checked_sub(1)?;
            let at = (!places.is_empty()).then(|| random.random_range(places))?;
            Some((group.get(at)?.from_s - 0.5, None, own_s))
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    fn change(kind: Kind, until_s: Option<f64>) -> Change {
        Change {
            kind,
            axis: Axis::X,
            block: 0,
            direction: [0.6, 0.8, 0.0],
            from_s: 1000.0,
            until_s,
            cycle_s: 1200.0,
            settling_s: 600.0,
            power: 2.0,
            turn_per_mm: 0.0,
        }
    }

    fn rig() -> Rig {
        Rig::draw(&mut Pcg64Mcg::seed_from_u64(6), false).unwrap()
    }

    #[test]
    fn eq1_a_block_settles_by_the_logarithm_of_time_and_ends_at_its_size() {
        let mut rig = rig();
        let creep = change(Kind::BlockCreeps, Some(13_000.0));
        creep.hide(10.0, &mut rig, 50_000.0).unwrap();
        let bumps = &rig.plant.faults.bumped_blocks;
        let sum = |until_s: f64| {
            let own = bumps.iter().filter(|bump| bump.at_s <= 50_000.0 + until_s);
            let all = own.map(|bump| bump.shift_um);
            all.fold([0.0; 2], |sum, shift| {
                [sum[0] + shift[0], sum[1] + shift[1]]
            })
        };
        let [x, y] = sum(13_000.0);
        assert!((x - 6.0).abs() < 1e-9 && (y - 8.0).abs() < 1e-9);
        // Half of the time: ln(1 + 6000/600) / ln(1 + 12000/600) = 2.3979 / 3.0445.
        let [x, _] = sum(7000.0);
        assert!((x / 6.0 - 0.7876).abs() < 1e-4, "{x}");
    }

    #[test]
    fn eq2_friction_rises_to_its_size_and_a_quarter_of_it_at_half_of_the_time() {
        let mut rig = rig();
        let coulomb_n = rig.plant.linear_drives[&Axis::X].guide_friction.coulomb_n;
        let dry = change(Kind::OilLacks, Some(13_000.0));
        dry.hide(400.0, &mut rig, 0.0).unwrap();
        let course = &rig.plant.linear_drives[&Axis::X].lubrication;
        let at = |at_s: f64| {
            let entry = course.iter().rfind(|entry| entry.after_s <= at_s).unwrap();
            coulomb_n * (entry.friction_ratio - 1.0)
        };
        assert!((at(13_000.0) - 400.0).abs() < 1e-6, "{}", at(13_000.0));
        assert!((at(7000.0) - 100.0).abs() < 1e-6, "{}", at(7000.0));
        fake_cnc::Plant::new(&rig.control, &rig.plant).unwrap();
    }

    #[test]
    fn a_step_of_lost_motion_adds_to_what_is_there() {
        let mut rig = rig();
        let drive = rig.plant.linear_drives.get_mut(&Axis::X).unwrap();
        drive.backlash_um = 2.0;
        let step = change(Kind::PlaySteps, None);
        step.hide(3.0, &mut rig, 500.0).unwrap();
        let wear = &rig.plant.linear_drives[&Axis::X].wear;
        assert_eq!(wear.len(), 1);
        assert!((wear[0].after_s - 1500.0).abs() < 1e-9);
        assert!((wear[0].backlash_um - 5.0).abs() < 1e-9);
    }
}
