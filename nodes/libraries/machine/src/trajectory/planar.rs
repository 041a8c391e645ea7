//! Planar trajectories over the plate of a grid encoder.

use metrology::Axis;
use metrology::sample::Sense;
use nalgebra::{Vector2, Vector3};

use super::contour::{Contour, Element, extremes_mm, reach_mm};
use super::error::TrajectoryError;
use super::shape::{Shape, finite, positive, require};
use super::writer::{Writer, check_feed, linear, place, run_in_mm};
use super::{Arrival, Pace, Trajectory};
use crate::file::{GridPlacement, GridPlane, MachineFile};

/// Way before the first station, so that it too is approached in the direction of motion; more than
/// play and presliding, mm.
const APPROACH_MM: f64 = 2.0;
/// Share of the acceleration that a control uses across a path, equation (3).
const ACROSS: f64 = 0.5;
/// Most stations of one program.
const MOST_STATIONS: u32 = 20_000;

/// What is to be run over a plate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanarOrder<'a> {
    /// Name of the placement in the machine file.
    pub placement: &'a str,
    /// Shape.
    pub shape: Shape,
    /// Centre of the shape from the centre of the plate, along the plane's first and second axis, mm.
    pub offset_mm: [f64; 2],
    /// Feed.
    pub feed_mm_min: f64,
    /// Counter-clockwise (or forwards: [`Sense::None`]) as drawn, or clockwise: backwards.
    pub sense: Sense,
    /// Stationwise or on the fly.
    pub pace: Pace,
    /// How the head comes to the beginning.
    pub arrival: Arrival,
}

/// Writes the program of `order`.
///
/// # Errors
/// Unknown placements, shapes that are none, feeds and curvatures that the axes do not allow, points
/// outside travel or plate.
pub fn planar(file: &MachineFile, order: &PlanarOrder<'_>) -> Result<Trajectory, TrajectoryError> {
    let (placement, radius_mm) = placement(file, order.placement)?;
    let plane = placement.plane;
    finite("offset_mm[0]", order.offset_mm[0])?;
    finite("offset_mm[1]", order.offset_mm[1])?;
    let offset_mm = Vector2::from(order.offset_mm);
    let centre = place(plane, &placement.axes_at_centre_mm(), &offset_mm);
    let contour = match order.sense {
        Sense::Clockwise => order.shape.contour()?.reversed(),
        Sense::None | Sense::CounterClockwise => order.shape.contour()?,
    };
    check_speed(file, plane, &contour, order.feed_mm_min)?;
    let path = Path::new(file, plane, contour, order)?;
    let reach_mm = reach_mm(&path.whole(), &-offset_mm);
    if reach_mm > radius_mm {
        return Err(TrajectoryError::OutsideField {
            placement: placement.id.clone(),
            reach_mm,
            radius_mm,
        });
    }
    let mut writer = Writer::new(file);
    for point in extremes_mm(&path.whole()) {
        writer.check_travel("trajectory", &place(plane, &centre, &point))?;
    }
    let setup = Writer::setup(file, order.arrival, &centre, &placement.id, "grid")?;
    let stops_mm = path.write(&mut writer, plane, &centre, order);
    Ok(Trajectory {
        setup,
        program: writer.finish(),
        kind: order.shape.kind(),
        plane: plane.into(),
        centre_mm: centre,
        radius_mm: order.shape.radius_mm(),
        feed_mm_s: order.feed_mm_min / 60.0,
        sense: order.sense,
        stations: match order.pace {
            Pace::Stationwise { stations, .. } => stations,
            Pace::OnTheFly => 0,
        },
        tool_offset_mm: Vector3::from(placement.tool_offset_mm),
        stops_mm,
    })
}

fn placement<'a>(
    file: &'a MachineFile,
    id: &str,
) -> Result<(&'a GridPlacement, f64), TrajectoryError> {
    let grid = file.grid_encoder.as_ref();
    let found = grid.and_then(|grid| Some((file.grid_placement(id)?, grid.radius_mm)));
    found.ok_or_else(|| TrajectoryError::Unknown {
        what: "placement of a grid encoder",
        name: id.to_owned(),
        known: grid
            .iter()
            .flat_map(|grid| &grid.placements)
            .map(|placement| placement.id.as_str())
            .collect::<Vec<_>>()
            .join(", "),
    })
}

/// Feed against the axes' limits and against the sharpest arc, equation (3).
fn check_speed(
    file: &MachineFile,
    plane: GridPlane,
    contour: &Contour,
    feed_mm_min: f64,
) -> Result<(), TrajectoryError> {
    let [first, second, _] = plane.axes();
    for axis in [first, second] {
        let mut along = Vector3::zeros();
        along[axis.index()] = 1.0;
        check_feed(file, &along, feed_mm_min)?;
    }
    let limit = |axis: Axis| Ok(linear(file, axis)?.acceleration_limit_mm_s2);
    let acceleration_mm_s2 = f64::min(limit(first)?, limit(second)?);
    let needed_mm = (feed_mm_min / 60.0).powi(2) / (ACROSS * acceleration_mm_s2);
    let radius_mm = contour.least_radius_mm();
    if radius_mm < needed_mm {
        return Err(TrajectoryError::CurvatureTooTight {
            radius_mm,
            feed_mm_min,
            needed_mm,
            acceleration_mm_s2,
        });
    }
    Ok(())
}

/// A contour with what leads to it and away from it.
struct Path {
    run_in: Element,
    contour: Contour,
    run_out: Option<Element>,
}

impl Path {
    fn new(
        file: &MachineFile,
        plane: GridPlane,
        contour: Contour,
        order: &PlanarOrder<'_>,
    ) -> Result<Self, TrajectoryError> {
        let [first, second, _] = plane.axes();
        match order.pace {
            Pace::Stationwise { stations, dwell_s } => {
                positive("dwell_s", dwell_s)?;
                require(
                    "stations",
                    f64::from(stations),
                    (2..=MOST_STATIONS).contains(&stations),
                    "must be from 2 to 20000",
                )?;
                Ok(Self {
                    run_in: contour.run_in(APPROACH_MM),
                    contour,
                    run_out: None,
                })
            }
            Pace::OnTheFly => {
                let length_mm = run_in_mm(file, &[first, second], order.feed_mm_min)?;
                Ok(Self {
                    run_in: contour.run_in(length_mm),
                    run_out: Some(contour.run_out(length_mm)),
                    contour,
                })
            }
        }
    }

    fn whole(&self) -> Vec<Element> {
        let mut whole = vec![self.run_in];
        whole.extend(&self.contour.elements);
        whole.extend(self.run_out);
        whole
    }

    /// Writes it; the stops, or the evaluated part's ends.
    fn write(
        &self,
        writer: &mut Writer<'_>,
        plane: GridPlane,
        centre: &Vector3<f64>,
        order: &PlanarOrder<'_>,
    ) -> Vec<Vector3<f64>> {
        let at = |point: Vector2<f64>| place(plane, centre, &point);
        let feed_mm_min = order.feed_mm_min;
        writer.plane(plane);
        writer.rapid(&at(self.run_in.point_mm(0.0)));
        let elements = &self.contour.elements;
        match (order.pace, self.run_out) {
            (Pace::Stationwise { stations, dwell_s }, _) => {
                writer.element(&self.run_in, plane, centre, feed_mm_min);
                let mut stops = Vec::new();
                let mut here = elements[0].point_mm(0.0);
                let parts = self.contour.cut(&self.cuts_mm(stations));
                // What follows the last station of a closed contour is not run.
                for part in parts.iter().take(stations as usize) {
                    for element in part {
                        writer.element(element, plane, centre, feed_mm_min);
                        here = element.point_mm(1.0);
                    }
                    writer.dwell(dwell_s);
                    stops.push(at(here));
                }
                stops
            }
            (Pace::OnTheFly, run_out) => {
                writer.element(&self.run_in, plane, centre, feed_mm_min);
                writer.comment("rate", "full");
                for element in elements {
                    writer.element(element, plane, centre, feed_mm_min);
                }
                writer.comment("rate", "background");
                if let Some(element) = run_out {
                    writer.element(&element, plane, centre, feed_mm_min);
                }
                let end = elements[elements.len() - 1].point_mm(1.0);
                vec![at(elements[0].point_mm(0.0)), at(end)]
            }
        }
    }

    /// Distances of the stations from the contour's beginning, mm.
    fn cuts_mm(&self, stations: u32) -> Vec<f64> {
        let parts = if self.contour.is_closed {
            stations
        } else {
            stations - 1
        };
        let step_mm = self.contour.length_mm() / f64::from(parts);
        (0..stations).map(|k| f64::from(k) * step_mm).collect()
    }
}
