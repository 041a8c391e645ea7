//! Circles over the plate of a grid encoder, or with a ballbar: the readings while the command was on the circle.
//!
//! The grid counts from where it was zeroed. A recording is shifted by the mean of commanded minus read
//! place, which takes the centre offset of the setting-up out; what is left of it the evaluations fit.
//! Run-in and run-out are left out: there the command is not at its feed.
//!
//! A length that is read during a circle is that of a ballbar, from the centre: it lies at the angle of the command, and
//! counts from the centre of its mount, for nothing tells where that is. Where the plate was read too, the plate counts.

use metrology::Axis;
use metrology::sample::{
    AxisState, GridSample, LengthSample, Sense, TestKind, TestPlane, TestSegment,
};
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
    /// Readings of the plate with the command of their tick.
    pairs: Vec<(CirclePoint, [f64; 2])>,
    /// Readings of a ballbar.
    radial: Vec<CirclePoint>,
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
                radial: Vec::new(),
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
            let dt_s = (state.received_at - before.at).as_secs_f64();
            let way_mm = (place_mm[0] - before.place_mm[0]).hypot(place_mm[1] - before.place_mm[1]);
            if dt_s > 0.0 {
                way_mm / dt_s
            } else {
                before.speed_mm_s
            }
        });
        current.tick = Some(Tick {
            at: state.received_at,
            place_mm,
            speed_mm_s,
        });
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
            let time_s = current.time_s(sample.at);
            let at_mm = [sample.u_mm, sample.v_mm];
            let point = CirclePoint { at_mm, time_s };
            current.pairs.push((point, tick.place_mm));
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
            let time_s = current.time_s(sample.at);
            let [u, v] = tick.place_mm;
            let at_mm = [u, v].map(|along| along / u.hypot(v) * sample.displacement_mm);
            current.radial.push(CirclePoint { at_mm, time_s });
        }
    }

    /// The circles, in the order of the recording.
    #[must_use]
    pub fn recordings(self) -> Vec<CircleRecording> {
        self.done
    }
}

impl Current {
    /// The command, where a reading counts: on the circle at its feed.
    fn counting(&self) -> Option<Tick> {
        self.tick.filter(|tick| {
            let [u, v] = tick.place_mm;
            (u.hypot(v) - self.segment.radius_mm).abs() < ON_CIRCLE_MM
                && tick.speed_mm_s >= AT_FEED * self.segment.feed_mm_s
        })
    }

    /// Time since the first reading that counts, s.
    fn time_s(&mut self, at: Stamp<Host>) -> f64 {
        (at - *self.began.get_or_insert(at)).as_secs_f64()
    }

    fn finished(self) -> CircleRecording {
        if self.pairs.is_empty() && !self.radial.is_empty() {
            return CircleRecording {
                segment: self.segment,
                points: self.radial,
                compensated: self.compensated,
                instrument: Instrument::Ballbar,
            };
        }
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
            instrument: Instrument::GridEncoder,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use metrology::{AxisSet, PerAxis};
    use nalgebra::Vector3;

    fn segment(begin: bool) -> TestSegment {
        TestSegment {
            at: Stamp::from_nanos(0),
            run: 3,
            begin,
            kind: TestKind::Circle,
            plane: TestPlane::Yz,
            centre_mm: Vector3::new(1.0, 20.0, 30.0),
            radius_mm: 50.0,
            feed_mm_s: 50.0,
            sense: Sense::CounterClockwise,
            repeat: 0,
            stylus: String::new(),
            tool_offset_mm: Vector3::zeros(),
            stations: 0,
            zero_id: 7,
            setup_id: 1,
            cold: false,
            features: Vec::new(),
            completed: !begin,
        }
    }

    /// A circle at 50 mm/s in ticks of 10 ms, run in along a radius; the plate lies 3 mm off. Without a number of its zero
    /// it is read by a ballbar.
    fn recorded(zero_id: impl Into<Option<u32>>) -> Vec<CircleRecording> {
        let zero_id = zero_id.into();
        let mut circles = Circles::default();
        circles.segment(&segment(true));
        let place = |tick: i64| {
            if tick < 40 {
                (f64::from(tick as i32) * 1.25, 0.0)
            } else {
                let angle = f64::from((tick - 40) as i32) * 0.01;
                (50.0 * angle.cos(), 50.0 * angle.sin())
            }
        };
        for tick in 0..(40 + 629) {
            let (u, v) = place(tick);
            let mut commanded = PerAxis::default();
            commanded[Axis::X] = 1.0;
            commanded[Axis::Y] = 20.0 + u;
            commanded[Axis::Z] = 30.0 + v;
            let at = Stamp::from_nanos(tick * 10_000_000);
            circles.axes(&AxisState {
                received_at: at,
                controller_at: Stamp::from_nanos(tick * 10_000_000),
                axes: AxisSet::XYZ,
                commanded,
                motor: commanded,
                scale: PerAxis([f64::NAN; 6]),
                velocity: PerAxis::default(),
            });
            // An oval of 2 µm, on a plate that was zeroed 3 mm beside the centre.
            let stretch = 1.0 + 4e-5;
            match zero_id {
                Some(zero_id) => circles.grid(&GridSample {
                    at,
                    plane: TestPlane::Yz,
                    u_mm: u * stretch + 3.0,
                    v_mm: v - 1.0,
                    zero_id,
                }),
                None => circles.length(&LengthSample {
                    at,
                    axis: Axis::Y,
                    displacement_mm: (u * stretch).hypot(v),
                    zero_id: 1,
                }),
            }
        }
        circles.segment(&segment(false));
        circles.recordings()
    }

    #[test]
    fn readings_on_the_circle_at_feed_are_kept_about_the_nominal_centre() {
        for (recordings, instrument) in [
            (recorded(7), Instrument::GridEncoder),
            (recorded(None), Instrument::Ballbar),
        ] {
            assert_eq!(recordings.len(), 1);
            assert_eq!(recordings[0].instrument, instrument);
            let points = &recordings[0].points;
            assert!((620..=630).contains(&points.len()), "{}", points.len());
            let radial = points.iter().map(|p| p.at_mm[0].hypot(p.at_mm[1]) - 50.0);
            let (least, greatest) =
                radial.fold((1.0_f64, -1.0_f64), |(l, g), r| (l.min(r), g.max(r)));
            assert!((greatest - 0.002).abs() < 2e-5, "{greatest}");
            assert!(least.abs() < 2e-5, "{least}");
            assert!(!recordings[0].compensated);
        }
    }

    #[test]
    fn readings_under_another_zero_are_not_of_this_circle() {
        assert!(recorded(8)[0].points.is_empty());
    }
}
