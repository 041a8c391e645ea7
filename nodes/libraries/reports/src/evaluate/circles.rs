//! Circles over the plate of a grid encoder, or with a ballbar: the readings of one whole turn at the test feed.
//!
//! The grid counts from where it was zeroed, which nothing states. All circles under one zero are therefore shifted
//! alike: by the mean of commanded minus read place over all of them. A sense that is shifted alone would lose what
//! the senses differ by, and G(b), D and H compare them.
//! The module `turn` has the rules by which run-in and run-out are left out.
//!
//! A length that is read during a circle is that of a ballbar, from the centre: it lies at the angle of the command, and
//! counts from the centre of its mount, for nothing tells where that is. Where the plate was read too, the plate counts.

use metrology::Axis;
use metrology::sample::{
    AxisState, GridSample, LengthSample, Sense, TestKind, TestPlane, TestSegment,
};
use metrology::stamp::{Host, Machine, Stamp};

mod turn;

pub(crate) use turn::median;
use turn::{AtFeed, Tick};
pub use turn::{EvaluatedTurn, SETTLING_S, TurnBy};
pub(super) use turn::{FEWEST_SPARSE, SPARSE};

/// The command is on the circle when it is this close to it, mm.
const ON_CIRCLE_MM: f64 = 2e-3;
/// Share of the feed below which the command is still running in.
const AT_FEED: f64 = 0.98;

/// One reading on the circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CirclePoint {
    /// Place along u and v, mm: from the nominal centre in the frame of the zero, or from a ballbar's mount.
    pub at_mm: [f64; 2],
    /// Time since the first evaluated reading, s.
    pub time_s: f64,
}

/// One circle, recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct CircleRecording {
    /// The test.
    pub segment: TestSegment,
    /// Readings of the evaluated turn in the order of time.
    pub points: Vec<CirclePoint>,
    /// Which turn it is.
    pub turn: EvaluatedTurn,
    /// Whether anything was added to the commands.
    pub compensated: bool,
    /// What measured.
    pub instrument: Instrument,
}

/// What reads a circle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Instrument {
    /// Both coordinates.
    GridEncoder,
    /// The radius alone.
    Ballbar,
}

/// Letters of the axes along u and v.
#[must_use]
pub fn plane_axes(plane: TestPlane) -> Option<[Axis; 2]> {
    match plane {
        TestPlane::Xy => Some([Axis::X, Axis::Y]),
        TestPlane::Yz => Some([Axis::Y, Axis::Z]),
        TestPlane::Zx => Some([Axis::Z, Axis::X]),
        TestPlane::None => None,
    }
}

#[derive(Debug)]
struct Current {
    segment: TestSegment,
    axes: [Axis; 2],
    /// The last state, with its stamp of the controller.
    state: Option<(Tick, Stamp<Machine>)>,
    /// Speed of the command there, mm/s.
    speed_mm_s: f64,
    /// When the command reached its feed on the circle.
    at_feed_since: Option<Stamp<Host>>,
    /// States on the circle at feed.
    ticks: Vec<Tick>,
    /// Readings of the plate there.
    plate: Vec<AtFeed>,
    /// Readings of a ballbar there.
    radial: Vec<AtFeed>,
    compensated: bool,
}

/// A circle in the frame of its instrument.
#[derive(Debug)]
struct Recorded {
    circle: CircleRecording,
    /// Nominal centre along u and v in the machine frame, mm.
    centre_mm: [f64; 2],
    apart: Apart,
}

/// Collects the circles of a recording.
#[derive(Debug, Default)]
pub struct Circles {
    current: Option<Current>,
    done: Vec<Recorded>,
}

impl Circles {
    /// Begin or end of a test.
    pub fn segment(&mut self, segment: &TestSegment) {
        if segment.begin {
            let axes = plane_axes(segment.plane).filter(|_| {
                segment.kind == TestKind::Circle && segment.radius_mm > 0.0 && segment.stations == 0
            });
            self.current = axes.map(|axes| Current {
                segment: segment.clone(),
                axes,
                state: None,
                speed_mm_s: 0.0,
                at_feed_since: None,
                ticks: Vec::new(),
                plate: Vec::new(),
                radial: Vec::new(),
                compensated: false,
            });
        } else if let Some(current) = self.current.take()
            && segment.completed
            && segment.run == current.segment.run
            && segment.sense != Sense::None
        {
            self.done.push(current.finished());
        }
    }

    /// Something is added to the commands, or nothing.
    pub fn compensation(&mut self, acts: bool) {
        if let Some(current) = &mut self.current {
            current.compensated |= acts;
        }
    }

    /// Positions at one tick.
    pub fn axes(&mut self, state: &AxisState) {
        if let Some(current) = &mut self.current {
            current.axes(state);
        }
    }

    /// One reading of the plate.
    pub fn grid(&mut self, sample: &GridSample) {
        let Some(current) = &mut self.current else {
            return;
        };
        if sample.plane != current.segment.plane || sample.zero_id != current.segment.zero_id {
            return;
        }
        if let Some(tick) = current.counting() {
            current.plate.push(AtFeed {
                at: sample.at,
                read_mm: [sample.u_mm, sample.v_mm],
                tick,
            });
        }
    }

    /// One reading of a length: of a ballbar.
    pub fn length(&mut self, sample: &LengthSample) {
        let Some(current) = &mut self.current else {
            return;
        };
        if let Some(tick) = current.counting()
            && sample.displacement_mm.is_finite()
        {
            let [u, v] = tick.place_mm;
            current.radial.push(AtFeed {
                at: sample.at,
                read_mm: [u, v].map(|along| along / u.hypot(v) * sample.displacement_mm),
                tick,
            });
        }
    }

    /// The circles, in the order of the recording, those under one zero in one frame.
    #[must_use]
    pub fn recordings(self) -> Vec<CircleRecording> {
        let apart = || self.done.iter().map(|circle| &circle.apart);
        let shifts_mm: Vec<[f64; 2]> = apart()
            .map(|own| mean_mm(apart().filter(|other| other.zero == own.zero)))
            .collect();
        let all = self.done.into_iter().zip(shifts_mm);
        all.map(|(circle, shift_mm)| circle.framed(shift_mm))
            .collect()
    }
}

/// Commanded minus read places of one circle.
#[derive(Debug)]
struct Apart {
    /// Instrument, plane, set-up and zero.
    zero: (Instrument, TestPlane, u32, u32),
    sum_mm: [f64; 2],
    n: usize,
}

fn mean_mm<'a>(all: impl Iterator<Item = &'a Apart>) -> [f64; 2] {
    let (mut sum_mm, mut n) = ([0.0; 2], 0);
    for apart in all {
        n += apart.n;
        sum_mm = [0, 1].map(|idx| sum_mm[idx] + apart.sum_mm[idx]);
    }
    sum_mm.map(|sum_mm| sum_mm / n.max(1) as f64)
}

impl Current {
    fn axes(&mut self, state: &AxisState) {
        let place_mm = self
            .axes
            .map(|axis| state.commanded[axis] - self.segment.centre_mm[axis.index()]);
        let at = state.received_at;
        let mut tick = Tick {
            at,
            place_mm,
            step_s: 0.0,
            swept_rad: 0.0,
            since_feed_s: 0.0,
        };
        if let Some((before, stamped_at)) = self.state {
            let dt_s = (at - before.at).as_secs_f64();
            let [u, v] = before.place_mm;
            if dt_s > 0.0 {
                self.speed_mm_s = (place_mm[0] - u).hypot(place_mm[1] - v) / dt_s;
            }
            tick.step_s = (state.controller_at - stamped_at).as_secs_f64();
            if self.at_feed_since.is_some() {
                let (sin, cos) = (
                    u * place_mm[1] - v * place_mm[0],
                    u * place_mm[0] + v * place_mm[1],
                );
                tick.swept_rad = before.swept_rad + sin.atan2(cos).abs();
            }
        }
        if self.is_at_feed(&tick) {
            let since = *self.at_feed_since.get_or_insert(at);
            tick.since_feed_s = (at - since).as_secs_f64();
            self.ticks.push(tick);
        }
        self.state = Some((tick, state.controller_at));
    }

    fn is_at_feed(&self, tick: &Tick) -> bool {
        let [u, v] = tick.place_mm;
        (u.hypot(v) - self.segment.radius_mm).abs() < ON_CIRCLE_MM
            && self.speed_mm_s >= AT_FEED * self.segment.feed_mm_s
    }

    /// The command, where a reading counts: on the circle at its feed.
    fn counting(&self) -> Option<Tick> {
        let (tick, _) = self.state?;
        self.is_at_feed(&tick).then_some(tick)
    }

    fn finished(self) -> Recorded {
        let (readings, instrument) = if self.plate.is_empty() && !self.radial.is_empty() {
            (self.radial, Instrument::Ballbar)
        } else {
            (self.plate, Instrument::GridEncoder)
        };
        let (readings, turn) = turn::evaluated(&self.ticks, readings);
        let segment = self.segment;
        let centre_mm = self.axes.map(|axis| segment.centre_mm[axis.index()]);
        let along = |idx: usize| -> f64 {
            let readings = readings.iter();
            readings
                .map(|r| centre_mm[idx] + r.tick.place_mm[idx] - r.read_mm[idx])
                .sum()
        };
        let begin = readings.first().map(|reading| reading.at);
        let point = |reading: &AtFeed| CirclePoint {
            at_mm: reading.read_mm,
            time_s: begin.map_or(0.0, |begin| (reading.at - begin).as_secs_f64()),
        };
        Recorded {
            centre_mm,
            apart: Apart {
                zero: (instrument, segment.plane, segment.setup_id, segment.zero_id),
                sum_mm: [0, 1].map(along),
                n: readings.len(),
            },
            circle: CircleRecording {
                segment,
                points: readings.iter().map(point).collect(),
                turn,
                compensated: self.compensated,
                instrument,
            },
        }
    }
}

impl Recorded {
    /// With points from the nominal centre.
    fn framed(self, shift_mm: [f64; 2]) -> CircleRecording {
        let mut circle = self.circle;
        if circle.instrument == Instrument::GridEncoder {
            for point in &mut circle.points {
                let at_mm = point.at_mm;
                point.at_mm = [0, 1].map(|idx| at_mm[idx] + shift_mm[idx] - self.centre_mm[idx]);
            }
        }
        circle
    }
}

#[cfg(test)]
mod tests;
