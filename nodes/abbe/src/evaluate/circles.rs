//! Circles over the plate of a grid encoder: the readings while the command was on the circle.
//!
//! The grid counts from where it was zeroed. A recording is shifted by the mean of commanded minus read
//! place, which takes the centre offset of the setting-up out; what is left of it the evaluations fit.
//! Run-in and run-out are left out: there the command is not at its feed.

use metrology::Axis;
use metrology::sample::{AxisState, GridSample, Sense, TestKind, TestPlane, TestSegment};
use metrology::stamp::{Host, Stamp};

/// The command is on the circle when it is this close to it, mm.
const ON_CIRCLE_MM: f64 = 2e-3;
/// Share of the feed below which the command is still running in.
const AT_FEED: f64 = 0.98;

/// One reading on the circle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CirclePoint {
    /// Place from the nominal centre along u and v, mm.
    pub at_mm: [f64; 2],
    /// Time since the beginning of the recording, s.
    pub time_s: f64,
}

/// One circle, recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct CircleRecording {
    /// The test.
    pub segment: TestSegment,
    /// Readings in the order of time.
    pub points: Vec<CirclePoint>,
    /// Whether anything was added to the commands.
    pub compensated: bool,
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

#[derive(Clone, Copy, Debug)]
struct Tick {
    at: Stamp<Host>,
    /// Command from the centre along u and v, mm.
    place_mm: [f64; 2],
    speed_mm_s: f64,
}

#[derive(Debug)]
struct Current {
    segment: TestSegment,
    axes: [Axis; 2],
    tick: Option<Tick>,
    /// Readings with the command of their tick.
    pairs: Vec<(CirclePoint, [f64; 2])>,
    began: Option<Stamp<Host>>,
    compensated: bool,
}

/// Collects the circles of a recording.
#[derive(Debug, Default)]
pub struct Circles {
    current: Option<Current>,
    done: Vec<CircleRecording>,
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
                tick: None,
                pairs: Vec::new(),
                began: None,
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
        let Some(current) = &mut self.current else {
            return;
        };
        let place_mm = current
            .axes
            .map(|axis| state.commanded[axis] - current.segment.centre_mm[axis.index()]);
        let speed_mm_s = current.tick.map_or(0.0, |before| {
            let dt_s = (state.at - before.at).as_secs_f64();
            let way_mm = (place_mm[0] - before.place_mm[0]).hypot(place_mm[1] - before.place_mm[1]);
            if dt_s > 0.0 {
                way_mm / dt_s
            } else {
                before.speed_mm_s
            }
        });
        current.tick = Some(Tick {
            at: state.at,
            place_mm,
            speed_mm_s,
        });
    }

    /// One reading.
    pub fn grid(&mut self, sample: &GridSample) {
        let Some(current) = &mut self.current else {
            return;
        };
        let (Some(tick), true) = (current.tick, sample.plane == current.segment.plane) else {
            return;
        };
        let [u, v] = tick.place_mm;
        let on_circle = (u.hypot(v) - current.segment.radius_mm).abs() < ON_CIRCLE_MM;
        let at_feed = tick.speed_mm_s >= AT_FEED * current.segment.feed_mm_s;
        if !(on_circle && at_feed && sample.zero_id == current.segment.zero_id) {
            return;
        }
        let began = *current.began.get_or_insert(sample.at);
        let point = CirclePoint {
            at_mm: [sample.u_mm, sample.v_mm],
            time_s: (sample.at - began).as_secs_f64(),
        };
        current.pairs.push((point, tick.place_mm));
    }

    /// The circles, in the order of the recording.
    #[must_use]
    pub fn recordings(self) -> Vec<CircleRecording> {
        self.done
    }
}

impl Current {
    fn finished(self) -> CircleRecording {
        let n = self.pairs.len().max(1) as f64;
        let shift_mm: [f64; 2] = [0, 1].map(|idx| {
            let differences = self
                .pairs
                .iter()
                .map(|(point, place)| place[idx] - point.at_mm[idx]);
            differences.sum::<f64>() / n
        });
        let shifted = |(point, _): (CirclePoint, [f64; 2])| CirclePoint {
            at_mm: [point.at_mm[0] + shift_mm[0], point.at_mm[1] + shift_mm[1]],
            ..point
        };
        CircleRecording {
            segment: self.segment,
            points: self.pairs.into_iter().map(shifted).collect(),
            compensated: self.compensated,
        }
    }
}
