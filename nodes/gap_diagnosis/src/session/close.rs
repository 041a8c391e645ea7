//! Makes a run of what was recorded of it.

use metrology::sample::{FARTHEST_FROM_NOMINAL, ProbeTrigger, TestSegment};
use metrology::{Axis, PerAxis};
use twin::{Channel, Motion, Reading, Run, Touch};

use super::account::Reason;
use super::builder::SessionBuilder;
use super::channels::{Scope, Series, take_zero, touches_only};
use super::error::SessionError;
use super::motion::{of, thin, times_s, wanted};
use super::nominal;
use super::record::Record;
use super::select::{Selection, index};
use super::touching;

/// A touch further from every tick than this has its own motion, s.
const NEAR_S: f64 = 0.05;
/// Kinds of tests of which is remembered how many readings make one mean; of more the oldest is forgotten.
const MOST_KINDS: usize = 1_000;

impl SessionBuilder {
    /// Ends a run.
    pub(super) fn close(&mut self, mut open: Record) {
        let unordered = open.leave_out_unordered();
        self.account.note_many(Reason::WentBack, unordered);
        self.account.note_many(Reason::TooLong, open.beyond_limit);
        if open.compensation_broke_off() {
            self.account.note(Reason::CompensationHeld);
        }
        // What is no motion was refused sample by sample before.
        if let Ok(Some(run)) = self.run(open) {
            self.runs.push(run);
            self.closed += 1;
        }
    }

    fn run(&mut self, open: Record) -> Result<Option<Run>, SessionError> {
        if touches_only(open.segment.kind) && !is_followed(&open) {
            return self.run_of_touches(&open);
        }
        if open.has_hole_in_motion() {
            self.account.note(Reason::HoleInMotion);
            return Ok(None);
        }
        let times = times_s(&open.ticks);
        let mut motion = of(&open.ticks, times, self.axes)?;
        motion.follow(&self.machine);
        let touches = self.touches(&open, &motion);
        as_approached(&touches, &mut motion);
        let selection = Selection::of(&open.segment, &motion, open.lead_in, self.config.settle_s);
        let block = self.block_of(&open.segment, selection.len());
        let scope = Scope {
            machine: &self.machine,
            record: &open,
            motion: &motion,
            judged: selection.span(),
        };
        let mut series = scope.channels(&mut self.account);
        for (_, readings) in &mut series {
            let before = readings.len();
            readings.retain(|raw| raw.deviation.abs() <= FARTHEST_FROM_NOMINAL);
            self.account
                .note_many(Reason::Beyond, before - readings.len());
            *readings = selection.apply(readings, block);
        }
        take_zero(&mut self.zeros, &open, &mut series);
        let mut marks = vec![false; motion.len()];
        wanted(&motion, &mut marks);
        let places = series.iter().flat_map(|(_, readings)| readings);
        for place in places.map(|raw| raw.place) {
            marks[index(place)] = true;
            if place.fract() > 0.0 && index(place) + 1 < marks.len() {
                marks[index(place) + 1] = true;
            }
        }
        for tick in touches.iter().filter_map(|(touch, _)| touch.tick) {
            marks[tick] = true;
        }
        Ok(assemble(open.segment, &motion, &marks, series, touches))
    }

    /// A run whose motion was not recorded beyond where its touches were latched.
    fn run_of_touches(&mut self, open: &Record) -> Result<Option<Run>, SessionError> {
        let mut touches = self.touches(open, &Motion::default());
        touches.sort_by(|a, b| a.0.time_s.total_cmp(&b.0.time_s));
        let motion = touching::motion(&self.machine, self.axes, &mut touches)?;
        let marks = vec![true; motion.len()];
        let segment = open.segment.clone();
        Ok(assemble(segment, &motion, &marks, vec![], touches))
    }

    /// How many neighbours make one reading: the same odd number in every repeat.
    fn block_of(&mut self, segment: &TestSegment, n: usize) -> usize {
        if let Some((_, block)) = self.blocks.iter().find(|(known, _)| alike(known, segment)) {
            return *block;
        }
        let block = n.div_ceil(self.config.readings_per_run.max(1)).max(1) | 1;
        if self.blocks.len() >= MOST_KINDS {
            self.blocks.remove(0);
        }
        self.blocks.push((segment.clone(), block));
        block
    }

    /// Touches with their deviation (4); faces of blocks where there are none.
    fn touches(&mut self, open: &Record, motion: &Motion) -> Vec<(Touch, f64)> {
        let mut touches = vec![];
        self.account
            .note_many(Reason::TouchMissing, missing(&open.triggers));
        for (time_s, trigger) in &open.triggers {
            let beyond = self.beyond(&trigger.feature_id, &trigger.latched, &trigger.approach);
            let Some(deviation) = beyond else {
                self.account.note(Reason::UnknownFeature);
                continue;
            };
            let tick = nearest(open, trigger).filter(|tick| *tick < motion.len());
            let tick = tick.map(|tick| at_surface(motion, tick, trigger, deviation));
            touches.push((
                Touch {
                    time_s: tick.map_or(*time_s, |tick| motion.time_s[tick]),
                    feature_id: trigger.feature_id.clone(),
                    approach: trigger.approach,
                    feed_mm_s: trigger.feed_mm_s,
                    position: on_surface(trigger, deviation),
                    tick,
                },
                deviation,
            ));
        }
        if touches.is_empty() && open.triggers.is_empty() {
            for (time_s, feature, approach, positions) in &open.faces {
                let touch = Touch {
                    time_s: *time_s,
                    feature_id: feature.clone(),
                    approach: *approach,
                    feed_mm_s: 0.0,
                    position: *positions,
                    tick: None,
                };
                let beyond = self.beyond(feature, positions, approach);
                touches.extend(beyond.map(|deviation| (touch, deviation)));
            }
        }
        touches
    }

    fn beyond(
        &self,
        feature: &str,
        latched: &PerAxis<f64>,
        approach: &nalgebra::Vector3<f64>,
    ) -> Option<f64> {
        nominal::beyond_surface_mm(&self.machine, &self.kinematics, feature, latched, approach)
    }
}

/// The run with the marked ticks of its motion; none without a reading.
fn assemble(
    segment: TestSegment,
    motion: &Motion,
    marks: &[bool],
    series: Vec<Series>,
    touches: Vec<(Touch, f64)>,
) -> Option<Run> {
    let (thinned, kept) = thin(motion, marks);
    let mut readings: Vec<Reading> = vec![];
    for (channel, raws) in series {
        readings.extend(raws.into_iter().map(|raw| {
            let (at, fraction) = place_in(motion, &thinned, &kept, raw.place);
            Reading {
                channel: channel.clone(),
                at,
                fraction,
                deviation: raw.deviation,
            }
        }));
    }
    let mut kept_touches = vec![];
    for (mut touch, deviation) in touches {
        touch.tick = touch.tick.map(|tick| kept[tick]);
        readings.push(Reading {
            channel: Channel::Touch,
            at: kept_touches.len(),
            fraction: 0.0,
            deviation,
        });
        kept_touches.push(touch);
    }
    if readings.is_empty() {
        return None;
    }
    Some(Run {
        segment,
        motion: thinned,
        touches: kept_touches,
        readings,
    })
}

/// Ticks before the one nearest to a latch at which second differences, which reach two ticks further, end before it.
const BEFORE_LATCH: usize = 3;

/// Gives the tick of each touch the speed and acceleration of the approach. Differences about the tick would mix
/// them with the stop behind it, while the ball had met its surface before the axes began to slow down.
fn as_approached(touches: &[(Touch, f64)], motion: &mut Motion) {
    for tick in touches.iter().filter_map(|(touch, _)| touch.tick) {
        let Some(before) = tick.checked_sub(BEFORE_LATCH) else {
            continue;
        };
        for axis in motion.axes.iter() {
            motion.velocity[axis][tick] = motion.velocity[axis][before];
            motion.acceleration[axis][tick] = motion.acceleration[axis][before];
            motion.driven[axis][tick] = motion.driven[axis][before];
        }
    }
}

/// How many numbers are left out between the touches of one run.
fn missing(triggers: &[(f64, ProbeTrigger)]) -> usize {
    let numbers = triggers.iter().map(|(_, trigger)| trigger.sequence);
    let pairs = numbers.clone().zip(numbers.skip(1));
    let between = pairs.map(|(before, after)| after.saturating_sub(before).saturating_sub(1));
    between.map(|lacking| lacking as usize).sum()
}

/// Tick nearest to a touch, by the controller's clock.
fn nearest(open: &Record, trigger: &ProbeTrigger) -> Option<usize> {
    let at = trigger.controller_at;
    let after = open.ticks.partition_point(|tick| tick.controller_at <= at);
    let before = after.checked_sub(1)?;
    let off = |k: usize| {
        let tick = open.ticks.get(k)?;
        Some((tick.controller_at - at).nanos().saturating_abs())
    };
    match (off(before), off(after)) {
        (Some(a), Some(b)) if b < a => Some(after),
        _ => Some(before),
    }
}

/// Where the axes were when the ball met the surface of the machine file. The place of the latch is further by the touch's
/// own deviation: a curve over it would explain any scatter of triggers.
fn on_surface(trigger: &ProbeTrigger, deviation_mm: f64) -> PerAxis<f64> {
    let mut position = trigger.latched;
    for axis in Axis::LINEAR {
        position[axis] -= deviation_mm * trigger.approach[axis.index()];
    }
    position
}

/// Tick at which the command was nearest to that place, on the way on which a touch was latched at another.
fn at_surface(motion: &Motion, latched: usize, trigger: &ProbeTrigger, deviation_mm: f64) -> usize {
    let there = on_surface(trigger, deviation_mm);
    let off_mm = |tick: usize| {
        let along = Axis::LINEAR.into_iter().map(|axis| {
            let here = motion.position[axis].get(tick).copied();
            here.map_or(0.0, |mm| mm - there[axis]) * trigger.approach[axis.index()]
        });
        along.sum::<f64>()
    };
    let mut tick = latched;
    loop {
        let here_mm = off_mm(tick);
        let next = if here_mm > 0.0 {
            tick.checked_sub(1)
        } else {
            Some(tick + 1).filter(|next| *next < motion.len())
        };
        match next {
            Some(next) if off_mm(next).abs() < here_mm.abs() => tick = next,
            _ => return tick,
        }
    }
}

/// Whether the axis states tell how the axes went to each touch.
fn is_followed(open: &Record) -> bool {
    let is_near = |(_, trigger): &(f64, ProbeTrigger)| {
        nearest(open, trigger).is_some_and(|tick| {
            let off = open.ticks[tick].controller_at - trigger.controller_at;
            off.as_secs_f64().abs() <= NEAR_S
        })
    };
    if open.triggers.is_empty() {
        return open.faces.is_empty();
    }
    open.triggers.iter().all(is_near)
}

/// Index and fraction in the thinned motion of a place in the full one.
fn place_in(full: &Motion, thinned: &Motion, kept: &[usize], place: f64) -> (usize, f64) {
    let k = index(place);
    let time = |k: usize| full.time_s.get(k).copied();
    let here = full.time_s[k];
    let at_s = here + (time(k + 1).unwrap_or(here) - here) * place.fract();
    let at = kept[k];
    let before_s = thinned.time_s[at];
    let fraction = thinned
        .time_s
        .get(at + 1)
        .map_or(0.0, |after_s| (at_s - before_s) / (after_s - before_s));
    (at, fraction.clamp(0.0, 1.0))
}

/// Whether two runs are repeats of one test.
fn alike(a: &TestSegment, b: &TestSegment) -> bool {
    a.kind == b.kind
        && a.plane == b.plane
        && a.stations == b.stations
        && a.features == b.features
        && (a.radius_mm - b.radius_mm).abs() < 1e-9
        && (a.feed_mm_s - b.feed_mm_s).abs() < 1e-9
}

#[cfg(test)]
mod tests {
    use metrology::AxisSet;
    use metrology::stamp::Stamp;
    use nalgebra::Vector3;

    use super::*;

    #[test]
    fn a_touch_has_the_acceleration_of_its_approach_and_not_that_of_the_stop_behind_it() {
        let period_s = 0.008;
        let times: Vec<f64> = (0..40).map(|k| period_s * f64::from(k)).collect();
        // 8 mm/s until the latch at tick 25, standing one tick later.
        let mut position = PerAxis::<Vec<f64>>::default();
        position[Axis::X] = times.iter().map(|t| 8.0 * t.min(25.5 * period_s)).collect();
        let axes = AxisSet::EMPTY.with(Axis::X);
        let mut motion = Motion::new(times, axes, position).expect("a motion");
        assert!(motion.acceleration[Axis::X][25] < -100.0);
        let touch = Touch {
            time_s: 25.0 * period_s,
            feature_id: String::new(),
            approach: Vector3::x(),
            feed_mm_s: 8.0,
            position: PerAxis::default(),
            tick: Some(25),
        };
        as_approached(&[(touch, 0.0)], &mut motion);
        assert!(motion.acceleration[Axis::X][25].abs() < 1e-9);
        assert!((motion.velocity[Axis::X][25] - 8.0).abs() < 1e-9);
        // The stop itself stays what it was.
        assert!(motion.acceleration[Axis::X][26] < -100.0);
    }

    #[test]
    fn where_a_touch_met_its_surface_does_not_depend_on_when_its_trigger_came() {
        let times: Vec<f64> = (0..60).map(|k| 0.004 * f64::from(k)).collect();
        let mut position = PerAxis::<Vec<f64>>::default();
        position[Axis::X] = times.iter().map(|t| 8.0 * t.min(0.2)).collect();
        let motion = Motion::new(times, AxisSet::EMPTY.with(Axis::X), position).expect("a motion");
        let surface_mm = 1.1;
        for late_s in [0.0, 0.002, 0.0061, 0.0155] {
            let mut latched = PerAxis::default();
            latched[Axis::X] = surface_mm + 8.0 * late_s;
            let trigger = ProbeTrigger {
                received_at: Stamp::from_nanos(0),
                controller_at: Stamp::from_nanos(0),
                feature_id: String::new(),
                approach: Vector3::x(),
                feed_mm_s: 8.0,
                latched,
                axes: AxisSet::EMPTY.with(Axis::X),
                sequence: 0,
            };
            let came = motion.position[Axis::X].partition_point(|mm| *mm < latched[Axis::X]);
            let tick = at_surface(&motion, came, &trigger, 8.0 * late_s);
            assert_eq!(tick, 34, "{late_s}");
        }
    }
}
