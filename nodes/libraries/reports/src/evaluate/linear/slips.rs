//! Readings of a stop that are far from all others of their target.
//!
//! ISO 230-2 leaves no reading out. A deviation more than half a millimetre from the others of its target is no deviation of an
//! axis: the beam was lost, the reference was zeroed, or the table has a slip. The run is invalid then, as a circle with such a
//! reading is: none of its figures is stated, the reading is named, and the other runs are evaluated. A reading that is far from
//! the others and may be one of the machine stays in every figure and is named.

use metrology::number::number;

use crate::evaluate::circles::median;

/// Farther from the middle of its target no reading of a run that counts is: mm, and rad of a rotary axis.
pub(super) const SLIP: [f64; 2] = [0.5, 0.005];
/// A reading this many times as far from its nearest neighbour as the others are from each other is far from them.
const FAR_SPANS: f64 = 20.0;
/// Nearer none is far: mm, and rad.
const LEAST_FAR: [f64; 2] = [0.005, 5e-5];
/// Other readings that a far one is held against.
const LEAST_OTHERS: usize = 3;

/// Deviations of runs at their targets.
#[derive(Debug)]
struct Deviations<'a> {
    /// Whether the axis is linear: in mm; otherwise in rad.
    pub is_linear: bool,
    /// In mm or rad.
    pub targets: &'a [f64],
    /// Numbers of the runs.
    pub runs: &'a [u32],
    /// By side (up, down), run and target; a side may be empty.
    pub sides: [&'a [Vec<f64>]; 2],
}

/// One reading.
#[derive(Clone, Copy)]
struct Place {
    side: usize,
    run: usize,
    target: usize,
}

/// Readings of a test that are far from the others of their targets.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Outlying {
    /// Runs that no figure counts: a slip or contradictory readings make them invalid, or they were broken off. Their numbers, and the reason.
    pub slips: Vec<(u32, String)>,
    /// Readings that every figure counts, a sentence each.
    pub far: Vec<String>,
}

impl Outlying {
    /// Takes the runs with a slip out of the sides of a test; names what is far in the others.
    pub(in crate::evaluate) fn of(
        is_linear: bool,
        targets: &[f64],
        runs: &mut Vec<u32>,
        sides: [&mut Vec<Vec<f64>>; 2],
    ) -> Self {
        let [up, down] = sides;
        let of = |runs: &[u32], up: &[Vec<f64>], down: &[Vec<f64>]| {
            let all = Deviations {
                is_linear,
                targets,
                runs,
                sides: [up, down],
            };
            (all.slips(), all.far())
        };
        let (slips, _) = of(runs, up, down);
        let is_sound: Vec<bool> = { runs.iter() }
            .map(|run| slips.iter().all(|(slipped, _)| slipped != run))
            .collect();
        for side in [&mut *up, &mut *down] {
            let mut sound = is_sound.iter();
            side.retain(|_| sound.next().is_none_or(|sound| *sound));
        }
        let mut sound = is_sound.iter();
        runs.retain(|_| sound.next().is_none_or(|sound| *sound));
        let (_, far) = of(runs, up, down);
        Self { slips, far }
    }

    /// With runs that were taken out before, in the order of their numbers.
    pub(in crate::evaluate) fn with(mut self, unusable: Vec<(u32, String)>) -> Self {
        self.slips.extend(unusable);
        self.slips.sort_by_key(|(run, _)| *run);
        self
    }

    /// The runs that do not count, for the list of what was left out.
    pub(in crate::evaluate) fn left_out(&self) -> impl Iterator<Item = String> {
        let slips = self.slips.iter();
        slips.map(|(run, reason)| format!("run {run}: {reason}"))
    }
}

impl Deviations<'_> {
    /// Runs with a slip; empty where so many runs have one at a target that it is the machine's.
    fn slips(&self) -> Vec<(u32, String)> {
        let limit = SLIP[usize::from(!self.is_linear)];
        let mut found: Vec<(usize, String, usize)> = Vec::new();
        for target in 0..self.targets.len() {
            let all = self.at(target);
            let Some(middle) = median(all.iter().map(|(_, value)| *value)) else {
                continue;
            };
            let far = all
                .iter()
                .filter(|(_, value)| (value - middle).abs() > limit);
            let far: Vec<&(Place, f64)> = far.collect();
            if far.len() * 3 > all.len() {
                continue;
            }
            for (place, value) in far {
                match found.iter_mut().find(|(run, ..)| *run == place.run) {
                    Some((.., more)) => *more += 1,
                    None => {
                        let words = format!(
                            "{}, at most {} from the others of its target, which are about {}",
                            self.words(*place, *value),
                            self.size(limit),
                            self.size(middle)
                        );
                        found.push((place.run, words, 0));
                    }
                }
            }
        }
        found.sort_by_key(|(run, ..)| *run);
        let slip = |(run, words, more): (usize, String, usize)| {
            let more = match more {
                0 => String::new(),
                n => format!("; {n} more of this run"),
            };
            let reason = format!("{words}{more}: mend the reading or repeat the run");
            Some((*self.runs.get(run)?, reason))
        };
        found.into_iter().filter_map(slip).collect()
    }

    /// Readings far from the others of their target and side that stay in every figure, a sentence each.
    fn far(&self) -> Vec<String> {
        let least = LEAST_FAR[usize::from(!self.is_linear)];
        let mut lines = Vec::new();
        for target in 0..self.targets.len() {
            let all = self.at(target);
            for (place, value) in &all {
                let beside = all
                    .iter()
                    .filter(|(other, _)| other.side == place.side && other.run != place.run);
                let others: Vec<f64> = beside.map(|(_, value)| *value).collect();
                let low = others.iter().copied().fold(f64::INFINITY, f64::min);
                let high = others.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let nearest = (low - value).max(value - high);
                if others.len() >= LEAST_OTHERS && nearest > least.max(FAR_SPANS * (high - low)) {
                    lines.push(format!(
                        "{}; the other runs have {} to {}. It is in every figure; repeat the run where it is a slip",
                        self.words(*place, *value),
                        self.size(low),
                        self.size(high)
                    ));
                }
            }
        }
        lines
    }

    /// Every reading at a target.
    fn at(&self, target: usize) -> Vec<(Place, f64)> {
        let sides = self.sides.iter().enumerate();
        let all = sides.flat_map(|(side, runs)| {
            let runs = runs.iter().enumerate();
            runs.filter_map(move |(run, row)| {
                Some((Place { side, run, target }, *row.get(target)?))
            })
        });
        all.collect()
    }

    fn words(&self, place: Place, value: f64) -> String {
        let way = if place.side == 0 { "up" } else { "down" };
        let run = self.runs.get(place.run).copied().unwrap_or_default();
        let target = self.targets.get(place.target).copied().unwrap_or_default();
        let at = if self.is_linear {
            format!("{target:.3} mm")
        } else {
            format!("{:.3} deg", target.to_degrees())
        };
        format!(
            "the deviation of run {run} at {at} {way} is {}",
            self.size(value)
        )
    }

    fn size(&self, value: f64) -> String {
        size(self.is_linear, value)
    }
}

/// A deviation in µm or arcsec, of one in mm or rad.
pub(super) fn size(is_linear: bool, value: f64) -> String {
    if is_linear {
        format!("{} µm", number((value * 1e4).round() / 10.0))
    } else {
        let arcsec = value.to_degrees() * 3600.0;
        format!("{} arcsec", number((arcsec * 100.0).round() / 100.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Five runs at two targets, with what one reading is.
    fn rows(slip_mm: Option<f64>) -> [Vec<Vec<f64>>; 2] {
        let side = |sign: f64| {
            let row = |run: u32| {
                let own = f64::from(run) * 2e-4;
                vec![sign * 0.001 + own, 0.004 + sign * 0.001 - own]
            };
            (0..5).map(row).collect::<Vec<Vec<f64>>>()
        };
        let mut both = [side(1.0), side(-1.0)];
        if let Some(slip_mm) = slip_mm {
            both[0][2][1] = slip_mm;
        }
        both
    }

    /// What is found, the runs that count, and their deviations.
    fn of(mut rows: [Vec<Vec<f64>>; 2]) -> (Outlying, Vec<u32>, Vec<Vec<f64>>) {
        let mut runs = vec![1, 2, 3, 4, 5];
        let [up, down] = &mut rows;
        let found = Outlying::of(true, &[10.0, 20.0], &mut runs, [up, down]);
        let [up, down] = rows;
        assert_eq!((up.len(), down.len()), (runs.len(), runs.len()));
        (found, runs, [up, down].concat())
    }

    #[test]
    fn a_lost_beam_makes_its_run_invalid_and_names_run_target_and_reading() {
        for (slip_mm, size) in [
            (9.999, "9999 µm"),
            (0.99999, "1000 µm"),
            (32.767, "32767 µm"),
            (-100.0, "-100000 µm"),
        ] {
            let (found, runs, left) = of(rows(Some(slip_mm)));
            assert_eq!(runs, [1, 2, 4, 5], "{slip_mm}: {found:?}");
            assert!(left.iter().flatten().all(|value| value.abs() < 0.01));
            let words = format!("the deviation of run 3 at 20.000 mm up is {size}");
            assert!(found.slips[0].1.starts_with(&words), "{found:?}");
            assert_eq!((found.slips.len(), found.far.len()), (1, 0));
        }
        assert_eq!(of(rows(None)).0, Outlying::default());
    }

    #[test]
    fn a_reading_far_from_the_others_that_may_be_the_machines_is_named_and_counts() {
        let (found, runs, _) = of(rows(Some(0.06)));
        assert_eq!((runs.len(), found.slips.len()), (5, 0));
        let [far] = &found.far[..] else {
            panic!("{found:?}");
        };
        let words =
            "the deviation of run 3 at 20.000 mm up is 60 µm; the other runs have 4.2 µm to 5 µm";
        assert!(far.starts_with(words), "{far}");
        assert_eq!(of(rows(Some(0.007))).0, Outlying::default());
    }

    #[test]
    fn a_backlash_of_a_millimetre_is_no_slip() {
        let mut worn = rows(None);
        worn[1].iter_mut().flatten().for_each(|value| *value -= 1.2);
        assert_eq!(of(worn).0, Outlying::default());
    }
}
