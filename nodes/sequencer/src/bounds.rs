//! The bounds of every number of a plan and of a cycle's goal, checked before anything is made of them.
//!
//! A plan is a file and a goal is a message of the network: either may hold any number. What is made of them is a program
//! of at most 1,000,000 lines (what a control takes), a touch of which is up to six, and lists of what is planned. Each
//! bound is far above what a measurement needs and far below what a computer notices.

use metrology::bound::{
    Bound, BoundError, MAX_FEATURE_POINTS, MOST_POSES, MOST_RUNS, MOST_STOPS, Range, TOUCHES_OF_RUN,
};
use metrology::leaves::{self, Row};
use metrology::number::number;
use metrology::sample::{CycleKind, CycleOrder};

use crate::plan::{DiagonalStep, GridStep, Plan, PositioningStep, Step};
use crate::rotary::RotaryStep;
use crate::touch_along::TouchAlongStep;

/// Steps of a plan: each is checked, and planned, before the first is run.
const STEPS: Bound = Bound::at_most(1_000);
/// Runs or repeats of one step, or touches of one point: a run takes seconds at least, so this many take a day.
const RUNS: Bound = Bound::at_most(MOST_RUNS);
/// Runs of all measuring steps: each is a program and two segments.
const RUNS_OF_PLAN: Bound = Bound::at_most(20_000).with_remedy("; divide the plan into several");
/// Stops of all measuring steps: a stop takes a second or more.
const STOPS_OF_PLAN: Bound =
    Bound::at_most(1_000_000).with_remedy("; divide the plan into several");
/// Targets along one axis, stations of a contour: what one program may have.
const STOPS: Bound = Bound::at_most(MOST_STOPS);
/// Beams of one step: a length reference has a handful.
const BEAMS: Bound = Bound::at_most(100);
/// Poses of rotary axes, given or planned.
const POSES: Bound = Bound::at_most(MOST_POSES);
/// Visits of all poses: what `rotary_axes` evaluates as one run.
const VISITS: Bound = Bound::at_most(500).with_remedy("; divide the poses between several steps");
/// Points on a bore or sphere, or on the side of a plane's grid.
const POINTS: Bound = Bound::at_most(MAX_FEATURE_POINTS);
/// Different feeds of one latency cycle.
const FEEDS: Bound = Bound::at_most(100);
/// Blocks, faces or artefacts of one cycle.
const FEATURES: Bound = Bound::at_most(1_000);
/// Touches of one cycle: with six lines each its program stays below the 1,000,000 lines that a control takes.
const TOUCHES: Bound = Bound::at_most(TOUCHES_OF_RUN as u64)
    .with_remedy("; measure in several cycles, a program has at most 1000000 lines");
/// Length of a title, a label or a name in bytes: they stand in messages, segments and comments of programs.
const NAME_BYTES: Bound = Bound::at_most(255);
/// Production, rest and way of a plan in all, two years, which is the longest time that a scenario gives a plan.
const MINUTES: Range = Range::new(0.0, 1e6, " min");
/// Coordinates and lengths: a gantry of 30 m stands anywhere in a hall.
const HALL_MM: f64 = 1e5;
/// Least and greatest feed: slower, a millimetre takes more than an hour and a half.
const FEEDS_MM_MIN: (f64, f64) = (0.01, 1e7);
/// Ranges of the physical numbers of a plan by their keys.
const ROWS: &[Row] = &[
    ("feed_mm_min", FEEDS_MM_MIN.0, FEEDS_MM_MIN.1),
    ("feeds_mm_min", FEEDS_MM_MIN.0, FEEDS_MM_MIN.1),
    ("dwell_s", 0.0, 3600.0),
    ("seconds", 1e-3, 6e7),
    ("minutes", 1e-3, 1e6),
    ("radius_mm", 1e-3, HALL_MM),
    ("second_radius_mm", 1e-3, HALL_MM),
    ("length_mm", 1e-3, HALL_MM),
    ("from_deg", -36_000.0, 36_000.0),
    ("swept_deg", -36_000.0, 36_000.0),
    ("angle_deg", -36_000.0, 36_000.0),
    ("between_deg", -36_000.0, 36_000.0),
    ("offset_mm", -HALL_MM, HALL_MM),
    ("at_mm", -HALL_MM, HALL_MM),
    ("overrun_mm", 0.0, HALL_MM),
    ("targets_mm", -HALL_MM, HALL_MM),
    ("from_mm", -HALL_MM, HALL_MM),
    ("to_mm", -HALL_MM, HALL_MM),
    ("spacing_mm", 1e-9, HALL_MM),
    ("poses", -1e8, 1e8),
    ("probe_axes", -1e8, 1e8),
];

const ENTRIES: &str = "entries";

/// What the measuring steps of a plan add up to.
#[derive(Default)]
pub(crate) struct Sum {
    pub(crate) runs: u64,
    pub(crate) stops: u64,
    /// Rest, production and way.
    pub(crate) rest_min: f64,
}

/// Refuses a plan with a number out of its bound; gives what its measuring steps add up to.
pub(crate) fn of_plan(plan: &Plan) -> Result<Sum, BoundError> {
    name(|| "title".to_owned(), &plan.title)?;
    STEPS.check_amount(|| "steps".to_owned(), ENTRIES, plan.steps.len())?;
    physics(plan)?;
    let mut sum = Sum::default();
    for (at, step) in plan.steps.iter().enumerate() {
        of_step(at, step, &mut sum)?;
    }
    Ok(sum)
}

/// Refuses physical numbers that no plan needs; of a feed with the time that the step's way would take.
fn physics(plan: &Plan) -> Result<(), BoundError> {
    let mut wrong = match leaves::check(ROWS, plan) {
        Ok(()) => return Ok(()),
        Err(wrong) => wrong,
    };
    if let BoundError::Number {
        place, value, unit, ..
    } = &mut wrong
    {
        match place.rsplit('.').next() {
            Some("minutes") => unit.to_mut().push_str(" min"),
            Some("seconds") => unit.to_mut().push_str(" s"),
            Some("feed_mm_min") if *value > 0.0 => {
                let step = plan.steps.iter().enumerate();
                let mut step = step.filter(|(at, _)| place.starts_with(&format!("steps[{at}].")));
                if let Some(way_mm) = step.next().and_then(|(_, step)| way_mm(step)) {
                    let (way, years) = (number(way_mm), number(way_mm / *value / MINUTES_OF_YEAR));
                    let more = format!("; {way} mm of way take {years} years at this feed");
                    unit.to_mut().push_str(&more);
                }
            }
            _ => {}
        }
    }
    Err(wrong)
}

const MINUTES_OF_YEAR: f64 = 525_960.0;

/// About how far the tool goes in the measuring runs of a step.
fn way_mm(step: &Step) -> Option<f64> {
    match step {
        Step::Grid(step) => {
            let round = |radius_mm: f64| std::f64::consts::TAU * radius_mm;
            let once_mm = step.length_mm.or(step.radius_mm.map(round))?;
            Some(once_mm * f64::from(step.repeats) * step.sense.list().len() as f64)
        }
        Step::Positioning(step) | Step::Scan(step) => {
            let targets = step.targets_mm.iter().copied();
            let all = targets.chain(step.from_mm).chain(step.to_mm);
            let (low, high) = all.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), mm| {
                (low.min(mm), high.max(mm))
            });
            (high > low).then(|| 2.0 * (high - low) * f64::from(step.runs))
        }
        _ => None,
    }
}

fn of_step(at: usize, step: &Step, sum: &mut Sum) -> Result<(), BoundError> {
    let key = |key: &'static str| move || format!("steps[{at}].{key}");
    match step {
        Step::Compensation { .. } => Ok(()),
        Step::Blocks { blocks, .. } => names(key("blocks"), blocks),
        Step::Latency {
            feature,
            feeds_mm_min,
            repeats,
        } => {
            name(key("feature"), feature)?;
            FEEDS.check_amount(key("feeds_mm_min"), ENTRIES, feeds_mm_min.len())?;
            RUNS.check(key("repeats"), *repeats)?;
            let factors = [
                (len(feeds_mm_min), "feeds"),
                (u64::from(*repeats), "repeats"),
            ];
            touches(key("repeats"), &factors)
        }
        Step::Artefact { id, points } => {
            name(key("id"), id)?;
            POINTS.check(key("points"), *points)
        }
        Step::Rotary(step) => of_rotary(at, step),
        Step::TouchAlong(step) => of_touch_along(at, step),
        Step::Produce {
            program, minutes, ..
        } => {
            name(key("program"), program)?;
            sum.rest(key("minutes"), *minutes)
        }
        Step::Verify { program, label } => {
            name(key("program"), program)?;
            name(key("label"), label)
        }
        Step::Wait { seconds } => sum.rest(key("seconds"), *seconds / 60.0),
        Step::Run { program } => name(key("program"), program),
        Step::Grid(grid) => {
            of_grid(at, grid, sum)?;
            add_way(at, step, grid.feed_mm_min, sum)
        }
        Step::Positioning(line) | Step::Scan(line) => {
            of_positioning(at, line, sum)?;
            add_way(at, step, line.feed_mm_min, sum)
        }
        Step::Diagonals(step) => of_diagonals(at, step, sum),
    }
}

fn of_rotary(at: usize, step: &RotaryStep) -> Result<(), BoundError> {
    let key = |key: &'static str| move || format!("steps[{at}].{key}");
    name(key("sphere"), &step.sphere)?;
    POSES.check_amount(key("poses"), ENTRIES, step.poses.len())?;
    POSES.check(key("planned"), step.planned)?;
    POINTS.check(key("points"), step.points)?;
    RUNS.check(key("repeats"), step.repeats)?;
    let poses = len(&step.poses).max(u64::from(step.planned));
    let visits = [(poses, "poses"), (u64::from(step.repeats), "repeats")];
    VISITS.check_product(key("repeats"), "visits", &visits)?;
    let factors = [
        (poses, "poses"),
        (u64::from(step.points), "points"),
        (u64::from(step.repeats), "repeats"),
    ];
    touches(key("repeats"), &factors)
}

fn of_touch_along(at: usize, step: &TouchAlongStep) -> Result<(), BoundError> {
    let key = |key: &'static str| move || format!("steps[{at}].{key}");
    name(key("sphere"), &step.sphere)?;
    POSES.check_amount(key("probe_axes"), ENTRIES, step.probe_axes.len())?;
    RUNS.check(key("repeats"), step.repeats)?;
    let factors = [
        (len(&step.probe_axes), "probe axes"),
        (u64::from(step.repeats), "repeats"),
    ];
    touches(key("repeats"), &factors)
}

fn of_grid(at: usize, step: &GridStep, sum: &mut Sum) -> Result<(), BoundError> {
    let key = |key: &'static str| move || format!("steps[{at}].{key}");
    name(key("placement"), &step.placement)?;
    RUNS.check(key("repeats"), step.repeats)?;
    let stations = step.stations.unwrap_or(1);
    STOPS.check(key("stations"), stations)?;
    let dwell_s = step.dwell_s.unwrap_or(0.0);
    let runs = [
        (u64::from(step.repeats), "repeats"),
        (len(step.sense.list()), "senses"),
    ];
    sum.add(
        key("repeats"),
        &runs,
        (u64::from(stations), "stations"),
        dwell_s,
    )
}

fn of_positioning(at: usize, step: &PositioningStep, sum: &mut Sum) -> Result<(), BoundError> {
    let key = |key: &'static str| move || format!("steps[{at}].{key}");
    if let Some(beam) = &step.beam {
        name(key("beam"), beam)?;
    }
    RUNS.check(key("runs"), step.runs)?;
    STOPS.check_amount(key("targets_mm"), ENTRIES, step.targets_mm.len())?;
    let spaced = spaced_targets(step);
    if spaced > STOPS.greatest() as f64 {
        return Err(BoundError::Amount {
            place: key("spacing_mm")(),
            value: spaced as u64,
            what: "targets",
            greatest: STOPS.greatest(),
            remedy: "; a wider spacing gives fewer",
        });
    }
    let dwell_s = step.dwell_s.unwrap_or(0.0);
    let targets = len(&step.targets_mm).max(spaced as u64).max(1);
    let runs = [(u64::from(step.runs), "runs"), (2, "ways")];
    sum.add(key("runs"), &runs, (targets, "targets"), dwell_s)
}

/// About how many targets a spacing gives; 0 where it is absent or invalid.
fn spaced_targets(step: &PositioningStep) -> f64 {
    match (step.from_mm, step.to_mm, step.spacing_mm) {
        (Some(from_mm), Some(to_mm), Some(spacing_mm)) => {
            let parts = (to_mm - from_mm) / spacing_mm;
            if parts > 0.0 { parts.ceil() + 1.0 } else { 0.0 }
        }
        _ => 0.0,
    }
}

fn of_diagonals(at: usize, step: &DiagonalStep, sum: &mut Sum) -> Result<(), BoundError> {
    let key = |key: &'static str| move || format!("steps[{at}].{key}");
    BEAMS.check_amount(key("beams"), ENTRIES, step.beams.len())?;
    step.beams
        .iter()
        .try_for_each(|beam| name(key("beams"), beam))?;
    RUNS.check(key("runs"), step.runs)?;
    STOPS.check(key("targets"), step.targets)?;
    let runs = [
        (u64::from(step.runs), "runs"),
        (len(&step.beams), "beams"),
        (2, "ways"),
    ];
    sum.add(
        key("runs"),
        &runs,
        (u64::from(step.targets), "targets"),
        step.dwell_s,
    )
}

/// Adds the time of the way of a measuring step.
fn add_way(at: usize, step: &Step, feed_mm_min: f64, sum: &mut Sum) -> Result<(), BoundError> {
    let minutes = way_mm(step).unwrap_or(0.0) / feed_mm_min;
    sum.rest(|| format!("steps[{at}].feed_mm_min"), minutes)
}

impl Sum {
    /// Adds a measuring step.
    fn add(
        &mut self,
        place: impl Fn() -> String,
        runs: &[(u64, &str)],
        stops: (u64, &str),
        dwell_s: f64,
    ) -> Result<(), BoundError> {
        let n = RUNS_OF_PLAN.check_product(&place, "runs", runs)?;
        let all: Vec<(u64, &str)> = runs.iter().copied().chain([stops]).collect();
        let n_stops = STOPS_OF_PLAN.check_product(&place, "stops", &all)?;
        self.runs += n;
        self.stops += n_stops;
        RUNS_OF_PLAN.check_amount(&place, "runs of the plan so far", self.runs)?;
        STOPS_OF_PLAN.check_amount(&place, "stops of the plan so far", self.stops)?;
        self.rest(place, n_stops as f64 * dwell_s / 60.0)
    }

    fn rest(&mut self, place: impl Fn() -> String, minutes: f64) -> Result<(), BoundError> {
        if minutes > 0.0 {
            self.rest_min += minutes;
        }
        MINUTES.check(
            || format!("{}: rest, production and way of the plan so far", place()),
            self.rest_min,
        )
    }
}

/// Refuses an order with a number out of its bound; `n_known`: how many of the kind the machine file has, `points`: how many
/// each gets.
pub(crate) fn of_order(order: &CycleOrder, n_known: usize, points: u32) -> Result<(), BoundError> {
    let key = |key: &'static str| move || key.to_owned();
    for (at, feed_mm_min) in order.feeds_mm_min.iter().enumerate() {
        let range = Range::new(FEEDS_MM_MIN.0, FEEDS_MM_MIN.1, " mm/min");
        range.check(|| format!("feeds[{at}]"), *feed_mm_min)?;
    }
    names(key("features"), &order.features)?;
    FEEDS.check_amount(key("feeds"), ENTRIES, order.feeds_mm_min.len())?;
    POINTS.check(key("points"), order.points)?;
    RUNS.check(key("repeats"), order.repeats)?;
    let repeats = (u64::from(order.repeats.max(1)), "repeats");
    let points = u64::from(points);
    let n_features = match order.features.len() {
        0 => n_known,
        n => n,
    };
    let features = (n_features as u64, "features");
    let factors = match order.kind {
        CycleKind::Latency => vec![(len(&order.feeds_mm_min), "feeds"), repeats],
        CycleKind::Blocks => vec![features, (3, "faces"), repeats],
        CycleKind::Touch => vec![features, repeats],
        CycleKind::Plane => vec![features, (points, "rows"), (points, "columns"), repeats],
        CycleKind::Bore | CycleKind::Sphere => vec![features, (points, "points"), repeats],
    };
    touches(key("repeats"), &factors)
}

fn touches(place: impl FnOnce() -> String, factors: &[(u64, &str)]) -> Result<(), BoundError> {
    TOUCHES.check_product(place, "touches", factors).map(|_| ())
}

fn names(place: impl Fn() -> String, names: &[String]) -> Result<(), BoundError> {
    FEATURES.check_amount(&place, ENTRIES, names.len())?;
    names
        .iter()
        .enumerate()
        .try_for_each(|(at, text)| name(|| format!("{}[{at}]", place()), text))
}

fn name(place: impl FnOnce() -> String, text: &str) -> Result<(), BoundError> {
    NAME_BYTES.check_amount(place, "bytes of text", text.len())
}

fn len<T>(list: &[T]) -> u64 {
    list.len() as u64
}

#[cfg(test)]
mod tests;
