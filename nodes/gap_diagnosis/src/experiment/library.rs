//! The experiments that a machine, its instruments and the recorded session allow.
//!
//! | experiment | tells apart by |
//! |---|---|
//! | circles of other radius, feed, centre, plane, in both senses | geometry, delay, inertia, friction |
//! | lines on the plate or along a beam, moving and with stops | position, direction, velocity |
//! | a line of small steps with dwells | way and time since a reversal |
//! | touches at three feeds, with another stylus, around an artefact | latency, pretravel, lever, lobing |
//! | standing still | drift without motion |
//! | one axis to and fro, a test before and behind it | heat of that axis |
//! | the session's tests in reverse order | what goes with time |
//!
//! Only instruments that the session had, or that the machine file lists, are proposed, and only ways within the
//! travels, feeds and accelerations of the machine.

mod planar;
mod touches;

use std::collections::BTreeSet;

use machine::MachineFile;
use metrology::Axis;
use nalgebra::Vector3;
use twin::simulate::plate_axes;
use twin::{Instrument, Session};

use super::course::acceleration_mm_s2;
use super::{Experiment, Pass, short};
use crate::noise::repeats::same_condition;
use planar::Stand;

/// Setting up once more where the instrument stands, min.
const SAME_PLACE_MIN: f64 = 1.0;
/// Moving an instrument that is at hand, or changing a stylus, min.
const OTHER_PLACE_MIN: f64 = 10.0;
/// Fetching an instrument that the session did not use, min.
const OTHER_INSTRUMENT_MIN: f64 = 25.0;
/// Time that an axis is moved to warm it, s.
const WARM_S: f64 = 900.0;
/// Time of standing still, s.
const STILL_S: f64 = 600.0;
/// Most runs that are repeated in reverse order.
const MOST_AGAIN: usize = 16;

/// Everything that could be measured next.
pub fn experiments(machine: &MachineFile, session: &Session) -> Vec<Experiment> {
    let shop = Shop::new(machine, session);
    let mut all = shop.circles();
    all.extend(shop.lines());
    all.extend(shop.touches());
    all.extend(shop.still());
    all.extend(shop.warm());
    all.extend(shop.reversed());
    all.retain(|experiment| experiment.passes.iter().all(|pass| shop.allows(pass)));
    all
}

struct Shop<'s> {
    machine: &'s MachineFile,
    session: &'s Session,
    had: BTreeSet<Instrument>,
    stands: Vec<Stand>,
}

impl<'s> Shop<'s> {
    fn new(machine: &'s MachineFile, session: &'s Session) -> Self {
        let readings = session.runs.iter().flat_map(|run| &run.readings);
        let had: BTreeSet<Instrument> = readings.map(|r| r.channel.instrument()).collect();
        let mut shop = Self {
            machine,
            session,
            had,
            stands: vec![],
        };
        shop.stands = shop.stands();
        shop
    }

    fn setup_min(&self, instrument: Instrument) -> f64 {
        if self.had.contains(&instrument) {
            OTHER_PLACE_MIN
        } else {
            OTHER_INSTRUMENT_MIN
        }
    }

    fn still(&self) -> Vec<Experiment> {
        let Some(stand) = self
            .stands
            .iter()
            .find(|s| s.instrument == Instrument::Grid)
        else {
            return vec![];
        };
        vec![Experiment {
            title: format!(
                "standing still for {} min on the plate",
                short(STILL_S / 60.0)
            ),
            passes: vec![Pass::Still {
                instrument: stand.instrument,
                plane: stand.plane,
                axis: Axis::X,
                at_mm: stand.centre.into(),
                seconds: STILL_S,
            }],
            setup_min: stand.setup_min,
        }]
    }

    fn warm(&self) -> Vec<Experiment> {
        let (Some(stand), false) = (self.stands.first(), self.session.history.is_empty()) else {
            return vec![];
        };
        let (radius_mm, feed_mm_s) = self.usual_circle(stand);
        let of_axis = |axis: Axis| {
            let entry = self.machine.linear(axis)?;
            let [low, high] = entry.travel_mm;
            let test = self.circle(stand, radius_mm, &[feed_mm_s]);
            let warm = Pass::Warm {
                axis,
                between_mm: [low + 0.1 * (high - low), high - 0.1 * (high - low)],
                feed_mm_s: 0.5 * entry.feed_limit_mm_min / 60.0,
                seconds: WARM_S,
            };
            Some(Experiment {
                title: format!(
                    "{} before and after {} min of {axis} to and fro, the other axes idle",
                    test.title,
                    short(WARM_S / 60.0)
                ),
                passes: [&test.passes[..], &[warm], &test.passes[..]].concat(),
                setup_min: test.setup_min,
            })
        };
        Axis::LINEAR.into_iter().filter_map(of_axis).collect()
    }

    fn reversed(&self) -> Vec<Experiment> {
        let mut kept = Vec::<usize>::new();
        for (run, entry) in self.session.runs.iter().enumerate().rev() {
            let same = |other: &usize| same_condition(&self.session.runs[*other], entry);
            if !entry.readings.is_empty() && !kept.iter().any(same) {
                kept.push(run);
            }
        }
        if !(2..=MOST_AGAIN).contains(&kept.len()) {
            return vec![];
        }
        vec![Experiment {
            title: format!("the session's {} tests in reverse order", kept.len()),
            passes: kept.into_iter().map(|run| Pass::Again { run }).collect(),
            setup_min: SAME_PLACE_MIN,
        }]
    }

    /// Whether the machine can do it.
    fn allows(&self, pass: &Pass) -> bool {
        let within = |at: Vector3<f64>| {
            Axis::LINEAR.into_iter().all(|axis| {
                self.machine.linear(axis).is_none_or(|entry| {
                    let [low, high] = entry.travel_mm;
                    (low..=high).contains(&at[axis.index()])
                })
            })
        };
        let feeds = |axes: &[Axis], feed_mm_s: f64| {
            axes.iter().all(|axis| {
                let entry = self.machine.linear(*axis);
                entry.is_some_and(|entry| feed_mm_s * 60.0 <= entry.feed_limit_mm_min)
            })
        };
        match pass {
            Pass::Circle {
                plane,
                centre_mm,
                radius_mm,
                feed_mm_s,
                ..
            } => {
                let Some(axes) = plate_axes(*plane) else {
                    return false;
                };
                let centre = Vector3::from(*centre_mm);
                let corner = |sign: f64| {
                    let mut at = centre;
                    at[axes[0].index()] += sign * radius_mm;
                    at[axes[1].index()] += sign * radius_mm;
                    at
                };
                within(corner(1.0))
                    && within(corner(-1.0))
                    && feeds(&axes, *feed_mm_s)
                    && feed_mm_s.powi(2) / radius_mm <= 0.5 * acceleration_mm_s2(self.machine)
            }
            Pass::Line {
                axis,
                from_mm,
                to_mm,
                feed_mm_s,
                ..
            } => {
                within(Vector3::from(*from_mm))
                    && within(Vector3::from(*to_mm))
                    && feeds(&[*axis], *feed_mm_s)
            }
            Pass::Touches { touches, .. } => {
                !touches.is_empty()
                    && touches
                        .iter()
                        .all(|touch| within(Vector3::from(touch.at_mm)))
            }
            Pass::Still { at_mm, .. } => within(Vector3::from(*at_mm)),
            Pass::Warm {
                axis, feed_mm_s, ..
            } => feeds(&[*axis], *feed_mm_s),
            Pass::Again { .. } => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::course::{self, Frame};
    use metrology::PerAxis;
    use twin::{Channel, Run};

    fn frame(machine: &MachineFile) -> Frame<'_> {
        Frame {
            machine,
            rest: PerAxis::default(),
            beside: vec![],
            tool_offset_mm: Vector3::zeros(),
            setup: 1,
            servo_s: 1e-3,
        }
    }

    fn stays_within(machine: &MachineFile, run: &Run, title: &str) {
        for axis in Axis::LINEAR {
            let Some(entry) = machine.linear(axis) else {
                continue;
            };
            let most = |series: &[f64]| series.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
            let [low, high] = entry.travel_mm;
            let inside = |p: &f64| (low - 1e-6..=high + 1e-6).contains(p);
            let position = &run.motion.position[axis];
            assert!(position.iter().all(inside), "{title} {axis}");
            let fastest = most(&run.motion.velocity[axis]) * 60.0;
            let limit = 1.001 * entry.feed_limit_mm_min;
            assert!(fastest <= limit, "{title} {axis}: {fastest}");
        }
    }

    /// Two planes read every axis: a line along Y is none that somebody could run unless its plane is told.
    #[test]
    fn every_experiment_has_a_title_of_its_own_on_the_plates_that_the_session_had() {
        let text = include_str!("../../../../launch_configs/volumetric/machine.yaml");
        let machine = MachineFile::parse(text, "machine").expect("a machine");
        let frame = frame(&machine);
        let mut session = Session::default();
        let of_circles = experiments(&machine, &session)
            .into_iter()
            .filter(|experiment| experiment.title.starts_with("circle "));
        for pass in of_circles.flat_map(|circles| circles.passes) {
            session.runs.extend(course::run(&frame, &pass, 1, 5.0));
        }
        assert!(!session.runs.is_empty());
        let all = experiments(&machine, &session);
        let mut titles = std::collections::BTreeSet::new();
        for experiment in &all {
            assert!(titles.insert(&experiment.title), "{}", experiment.title);
        }
        assert!(
            titles.iter().any(|title| title.contains("on the YZ plate")),
            "{titles:#?}"
        );
    }

    /// Every way that is proposed, with ramps, clearances and corners, as the axes would go it.
    #[test]
    fn prop_every_proposed_way_stays_within_travel_and_feed() {
        for text in [
            include_str!("../../../../launch_configs/grid_xy/machine.yaml"),
            include_str!("../../../../launch_configs/gap_first/machine.yaml"),
            include_str!("../../../../launch_configs/volumetric/machine.yaml"),
        ] {
            let machine = MachineFile::parse(text, "machine").expect("a machine");
            let frame = frame(&machine);
            let all = experiments(&machine, &Session::default());
            assert!(all.len() > 8, "{}", all.len());
            let mut circles = 0;
            for (experiment, pass) in all
                .iter()
                .flat_map(|e| e.passes.iter().map(move |p| (e, p)))
            {
                let Some(run) = course::run(&frame, pass, 1, 5.0) else {
                    continue;
                };
                assert!(!run.readings.is_empty(), "{}", experiment.title);
                let took_s = run.motion.time_s[run.motion.len() - 1] - 5.0;
                let said_s = course::duration_s(pass, &machine, |_| 0.0);
                assert!(
                    !run.touches.is_empty() || (took_s - said_s).abs() < 0.05 * said_s + 0.1,
                    "{}: {took_s} {said_s}",
                    experiment.title
                );
                stays_within(&machine, &run, &experiment.title);
                if run.readings.iter().any(|r| r.channel == Channel::GridU)
                    && run.segment.radius_mm > 0.0
                {
                    circles += 1;
                }
            }
            assert!(circles > 4);
        }
    }
}
