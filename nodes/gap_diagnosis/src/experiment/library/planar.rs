//! Circles and lines, where a plate, a ballbar or a beam can read them.

use metrology::Axis;
use metrology::sample::{Sense, TestPlane};
use nalgebra::Vector3;
use twin::simulate::plate_axes;
use twin::{Channel, Instrument};

use super::{SAME_PLACE_MIN, Shop};
use crate::experiment::{Experiment, Pass, circle_words, short};
use crate::search::nuisance::plane_name;

/// A place where circles or lines can be read.
pub(super) struct Stand {
    /// Placement, where the plane alone does not tell which.
    pub name: String,
    pub instrument: Instrument,
    pub plane: TestPlane,
    pub centre: Vector3<f64>,
    pub reach_mm: f64,
    pub setup_min: f64,
}

impl Shop<'_> {
    /// Planar instruments where the session had them, then where the machine file puts them.
    pub(super) fn stands(&self) -> Vec<Stand> {
        let mut stands = Vec::<Stand>::new();
        for run in &self.session.runs {
            let reads = |wanted: Instrument| {
                run.readings
                    .iter()
                    .any(|r| r.channel.instrument() == wanted)
            };
            let instruments = [Instrument::Grid, Instrument::Radial];
            let Some(instrument) = instruments.into_iter().find(|i| reads(*i)) else {
                continue;
            };
            let segment = &run.segment;
            let known = |stand: &&mut Stand| {
                stand.instrument == instrument
                    && stand.plane == segment.plane
                    && (stand.centre - segment.centre_mm).norm() < 1.0
            };
            match stands.iter_mut().find(known) {
                Some(stand) => stand.reach_mm = stand.reach_mm.max(segment.radius_mm),
                None if segment.radius_mm > 0.0 => stands.push(Stand {
                    name: self.one_of_several(segment.plane, segment.centre_mm),
                    instrument,
                    plane: segment.plane,
                    centre: segment.centre_mm,
                    reach_mm: segment.radius_mm,
                    setup_min: SAME_PLACE_MIN,
                }),
                None => {}
            }
        }
        self.add_placements(&mut stands);
        stands
    }

    /// The placement of a centre, where the machine file has another one in its plane.
    fn one_of_several(&self, plane: TestPlane, centre: Vector3<f64>) -> String {
        let grid = self.machine.grid_encoder.iter();
        let mut in_plane = grid
            .flat_map(|grid| &grid.placements)
            .filter(|placement| TestPlane::from(placement.plane) == plane);
        if in_plane.clone().count() < 2 {
            return String::new();
        }
        in_plane
            .find(|placement| (placement.axes_at_centre_mm() - centre).norm() < 1.0)
            .map_or_else(String::new, |placement| placement.id.clone())
    }

    fn add_placements(&self, stands: &mut Vec<Stand>) {
        let Some(grid) = &self.machine.grid_encoder else {
            return;
        };
        for stand in stands
            .iter_mut()
            .filter(|s| s.instrument == Instrument::Grid)
        {
            stand.reach_mm = stand.reach_mm.max(0.9 * grid.radius_mm);
        }
        for placement in &grid.placements {
            let (plane, centre) = (
                TestPlane::from(placement.plane),
                placement.axes_at_centre_mm(),
            );
            let is_known = stands.iter().any(|stand| {
                stand.instrument == Instrument::Grid
                    && stand.plane == plane
                    && (stand.centre - centre).norm() < 1.0
            });
            if !is_known {
                stands.push(Stand {
                    name: placement.id.clone(),
                    instrument: Instrument::Grid,
                    plane,
                    centre,
                    reach_mm: 0.9 * grid.radius_mm,
                    setup_min: self.setup_min(Instrument::Grid),
                });
            }
        }
    }

    /// The feed and radius that the session's circles had first, or a middle one.
    pub(super) fn usual_circle(&self, stand: &Stand) -> (f64, f64) {
        let own = self.session.runs.iter().map(|run| &run.segment);
        let mut circles = own.filter(|s| s.radius_mm > 0.0 && s.feed_mm_s > 0.0);
        circles
            .next()
            .map_or((0.5 * stand.reach_mm, 2000.0 / 60.0), |s| {
                (s.radius_mm, s.feed_mm_s)
            })
    }

    pub(super) fn circles(&self) -> Vec<Experiment> {
        let mut all = Vec::new();
        for (place, stand) in self.stands.iter().enumerate() {
            let (usual_mm, usual_mm_s) = self.usual_circle(stand);
            let is_ballbar = stand.instrument == Instrument::Radial;
            let radii: Vec<f64> = match (place, is_ballbar) {
                (0, false) => vec![0.5, 1.0, 1.6],
                (0, true) => vec![0.5, 1.0, 2.0],
                _ => vec![1.0],
            };
            let feeds: Vec<f64> = if place == 0 {
                vec![0.5, 1.0, 2.0]
            } else {
                vec![1.0]
            };
            for radius_mm in radii
                .iter()
                .map(|share| (share * usual_mm).round().max(1.0))
            {
                if !is_ballbar && radius_mm > stand.reach_mm {
                    continue;
                }
                let kept = feeds
                    .iter()
                    .map(|share| share * usual_mm_s)
                    .filter(|feed_mm_s| self.is_alike(radius_mm / feed_mm_s));
                for feed_mm_s in kept {
                    all.push(self.circle(stand, radius_mm, &[feed_mm_s]));
                }
            }
            all.push(self.circle(stand, usual_mm, &[usual_mm_s, 2.0 * usual_mm_s]));
        }
        all
    }

    /// Whether a circle of this radius over feed is about as quick as one that the session ran: the noise of a
    /// station is known for stations of that time only.
    fn is_alike(&self, seconds: f64) -> bool {
        let segments = self.session.runs.iter().map(|run| &run.segment);
        let mut known = segments
            .filter(|s| s.radius_mm > 0.0 && s.feed_mm_s > 0.0)
            .peekable();
        let alike = |own: f64| (0.45..=2.2).contains(&(seconds / own));
        known.peek().is_none() || known.any(|s| alike(s.radius_mm / s.feed_mm_s))
    }

    pub(super) fn circle(&self, stand: &Stand, radius_mm: f64, feeds_mm_s: &[f64]) -> Experiment {
        let passes = feeds_mm_s.iter().flat_map(|feed_mm_s| {
            [Sense::CounterClockwise, Sense::Clockwise].map(|sense| Pass::Circle {
                instrument: stand.instrument,
                plane: stand.plane,
                centre_mm: stand.centre.into(),
                radius_mm,
                feed_mm_s: *feed_mm_s,
                sense,
            })
        });
        let first = feeds_mm_s.first().copied().unwrap_or(0.0);
        let more: String = feeds_mm_s
            .iter()
            .skip(1)
            .map(|feed| format!(" and F{}", short(feed * 60.0)))
            .collect();
        Experiment {
            title: format!(
                "circle {}{more} both senses{}",
                circle_words(stand.plane, radius_mm, first),
                at_words(stand)
            ),
            passes: passes.collect(),
            setup_min: stand.setup_min,
        }
    }

    pub(super) fn lines(&self) -> Vec<Experiment> {
        let mut all = Vec::new();
        for stand in self
            .stands
            .iter()
            .filter(|s| s.instrument == Instrument::Grid)
        {
            for axis in plate_axes(stand.plane).into_iter().flatten() {
                let mut along = Vector3::zeros();
                along[axis.index()] = 0.9 * stand.reach_mm;
                let ends = [stand.centre - along, stand.centre + along];
                let place = plate_words(stand);
                all.extend(self.on(
                    stand.instrument,
                    stand.plane,
                    axis,
                    ends,
                    stand.setup_min,
                    &place,
                ));
                let mut small = Vector3::zeros();
                small[axis.index()] = 4.0;
                all.push(steps(
                    stand,
                    &place,
                    axis,
                    [stand.centre - small, stand.centre + small],
                ));
            }
        }
        let beams = self
            .machine
            .length_reference
            .iter()
            .flat_map(|length| &length.beams);
        for beam in beams {
            let ends = [Vector3::from(beam.from_mm), Vector3::from(beam.to_mm)];
            let was_used = self.session.runs.iter().any(|run| {
                run.readings
                    .iter()
                    .any(|r| r.channel == Channel::Length(beam.main_axis()))
            });
            let setup_min = if was_used {
                SAME_PLACE_MIN
            } else {
                self.setup_min(Instrument::Length)
            };
            all.extend(self.on(
                Instrument::Length,
                TestPlane::None,
                beam.main_axis(),
                ends,
                setup_min,
                &format!("along beam {}", beam.id),
            ));
        }
        all
    }

    /// Lines moving at two feeds, and with stops.
    fn on(
        &self,
        instrument: Instrument,
        plane: TestPlane,
        axis: Axis,
        [from, to]: [Vector3<f64>; 2],
        setup_min: f64,
        place: &str,
    ) -> Vec<Experiment> {
        let line = |feed_mm_s: f64, stops: u32, dwell_s: f64| Pass::Line {
            instrument,
            plane,
            axis,
            from_mm: from.into(),
            to_mm: to.into(),
            feed_mm_s,
            stops,
            dwell_s,
        };
        let feeds = [1000.0 / 60.0, 4000.0 / 60.0];
        vec![
            Experiment {
                title: format!("line {axis} F1000 and F4000 there and back {place}"),
                passes: feeds.map(|feed| line(feed, 0, 0.5)).to_vec(),
                setup_min,
            },
            Experiment {
                title: format!("positioning {axis} F2000, 20 stops of 2 s each way {place}"),
                passes: vec![line(2000.0 / 60.0, 20, 2.0)],
                setup_min,
            },
        ]
    }
}

/// Small steps with a dwell at each: a reversal followed by nothing but time.
fn steps(stand: &Stand, place: &str, axis: Axis, [from, to]: [Vector3<f64>; 2]) -> Experiment {
    Experiment {
        title: format!("steps of 0.4 mm along {axis} with 2 s dwell, there and back {place}"),
        passes: vec![Pass::Line {
            instrument: stand.instrument,
            plane: stand.plane,
            axis,
            from_mm: from.into(),
            to_mm: to.into(),
            feed_mm_s: 500.0 / 60.0,
            stops: 20,
            dwell_s: 2.0,
        }],
        setup_min: stand.setup_min,
    }
}

/// `on the XY plate`: two planes read every axis.
fn plate_words(stand: &Stand) -> String {
    format!(
        "on the {} plate{}",
        plane_name(stand.plane),
        at_words(stand)
    )
}

fn at_words(stand: &Stand) -> String {
    if stand.name.is_empty() {
        String::new()
    } else {
        format!(" at {}", stand.name)
    }
}
