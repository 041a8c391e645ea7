//! A machine without errors, for a programme to be run on before anything is measured.
//!
//! Motors do what the loops demand, axes stand where their motors do, readings are what the command says,
//! temperatures stand still or are those of [`super::warming`], and the ball meets the surfaces that the machine file describes:
//!
//! ```text
//!   dv/dt = u,   dx/dt = v                                                (1)
//!   closed when the ball's centre is within its radius of a surface       (2)
//! ```

use anyhow::{Context, Result};
use fake_cnc::Hardware;
use fake_cnc::plant::{Feedback, GridReading, LengthReading, ProbeEdge};
use machine::file::{ArtefactEntry, AxisEntry, GridPlane};
use machine::{Kinematics, MachineFile};
use metrology::stamp::Span;
use metrology::{Axis, AxisSet, PerAxis};
use nalgebra::Vector3;

use super::warming::{COLD_DEGC, Warming};

/// Temperature of everything, degC.
const IDEAL_TEMPERATURE_DEGC: f64 = COLD_DEGC;
/// Half the thickness that a wall or plate is given, and half the height of a bore or boss, mm.
const HALF_WALL_MM: f64 = 5.0;
/// Distance from a surface within which every period is looked at, mm.
const IDEAL_MARGIN_MM: f64 = 0.5;
/// Halvings of the period in which a contact is looked for.
const HALVINGS: u32 = 24;

/// An artefact as a solid, workpiece frame.
#[derive(Clone, Debug)]
enum Solid {
    /// Block or plate.
    Box {
        middle_mm: Vector3<f64>,
        half_mm: Vector3<f64>,
    },
    /// Sphere.
    Ball {
        middle_mm: Vector3<f64>,
        radius_mm: f64,
    },
    /// Ring or boss about Z: the wall between two radii.
    Ring {
        middle_mm: Vector3<f64>,
        inner_mm: f64,
        outer_mm: f64,
    },
}

impl Solid {
    /// Distance of a point from the surface, negative inside, mm.
    fn distance_mm(&self, point_mm: &Vector3<f64>) -> f64 {
        let to_box =
            |beyond: Vector3<f64>| beyond.map(|b| b.max(0.0)).norm() + beyond.max().min(0.0);
        match self {
            Self::Box { middle_mm, half_mm } => to_box((point_mm - middle_mm).abs() - half_mm),
            Self::Ball {
                middle_mm,
                radius_mm,
            } => (point_mm - middle_mm).norm() - radius_mm,
            Self::Ring {
                middle_mm,
                inner_mm,
                outer_mm,
            } => {
                let from = point_mm - middle_mm;
                let radius_mm = from.xy().norm();
                let within = (inner_mm - radius_mm).max(radius_mm - outer_mm);
                to_box(Vector3::new(within, from.z.abs() - HALF_WALL_MM, f64::MIN))
            }
        }
    }
}

fn solids(machine: &MachineFile) -> Vec<Solid> {
    let blocks = machine.blocks.iter().map(|block| {
        // As large as its touches need: they lie in the middles of its faces.
        let half_mm = Vector3::repeat(block.inset_mm);
        let inwards = Vector3::from(block.approach_sign.map(f64::from));
        Solid::Box {
            middle_mm: Vector3::from(block.corner_mm) + inwards.component_mul(&half_mm),
            half_mm,
        }
    });
    let artefacts = machine.artefacts.iter().map(|artefact| match artefact {
        ArtefactEntry::Sphere {
            centre_mm,
            radius_mm,
            ..
        } => Solid::Ball {
            middle_mm: Vector3::from(*centre_mm),
            radius_mm: *radius_mm,
        },
        ArtefactEntry::Bore {
            centre_mm,
            radius_mm,
            ..
        } => Solid::Ring {
            middle_mm: Vector3::from(*centre_mm),
            inner_mm: *radius_mm,
            outer_mm: radius_mm + 2.0 * HALF_WALL_MM,
        },
        ArtefactEntry::Boss {
            centre_mm,
            radius_mm,
            ..
        } => Solid::Ring {
            middle_mm: Vector3::from(*centre_mm),
            inner_mm: f64::NEG_INFINITY,
            outer_mm: *radius_mm,
        },
        ArtefactEntry::Plane {
            point_mm,
            normal,
            half_side_mm,
            ..
        } => {
            let outward = Vector3::from(*normal);
            let mut half_mm = Vector3::repeat(*half_side_mm);
            half_mm[outward.iamax()] = HALF_WALL_MM;
            Solid::Box {
                middle_mm: Vector3::from(*point_mm) - outward * HALF_WALL_MM,
                half_mm,
            }
        }
    });
    blocks.chain(artefacts).collect()
}

/// What is put up to read positions.
#[derive(Clone, Debug)]
enum Device {
    /// The plate in a plane, about these axis positions.
    Plate {
        plane: GridPlane,
        centre_mm: Vector3<f64>,
        radius_mm: f64,
    },
    /// A beam along a direction.
    Beam { axis: Axis, direction: Vector3<f64> },
}

/// The machine.
#[derive(Clone, Debug)]
pub struct IdealMachine {
    kinematics: Kinematics,
    axes: AxisSet,
    /// Linear axes with a scale.
    scales: AxisSet,
    turns: bool,
    position: PerAxis<f64>,
    velocity: PerAxis<f64>,
    ball_mm: f64,
    solids: Vec<Solid>,
    /// Way that the axes may go before the next look at the solids, mm.
    clear_mm: f64,
    closed: bool,
    edge: Option<ProbeEdge>,
    devices: Vec<(String, Device)>,
    mounted: Option<Device>,
    grid_zero: (u32, Vector3<f64>),
    length_zero: (u32, Vector3<f64>),
    warming: Option<Warming>,
}

impl IdealMachine {
    /// The machine of a file, without errors.
    ///
    /// # Errors
    /// When its chain is none.
    pub fn new(machine: &MachineFile) -> Result<Self> {
        let scales = machine.axes.iter().filter(|(_, entry)| {
            matches!(entry, AxisEntry::Linear(linear) if linear.scale_resolution_um.is_some())
        });
        let plates = machine.grid_encoder.iter().flat_map(|grid| {
            grid.placements.iter().map(|placement| {
                let plate = Device::Plate {
                    plane: placement.plane,
                    centre_mm: placement.axes_at_centre_mm(),
                    radius_mm: grid.radius_mm,
                };
                (placement.id.clone(), plate)
            })
        });
        let beams = machine.length_reference.iter().flat_map(|reference| {
            reference.beams.iter().map(|beam| {
                let device = Device::Beam {
                    axis: beam.main_axis(),
                    direction: beam.direction(),
                };
                (beam.id.clone(), device)
            })
        });
        Ok(Self {
            kinematics: Kinematics::new(machine).context("machine file: chain")?,
            axes: machine.axis_set(),
            scales: scales.fold(AxisSet::EMPTY, |set, (axis, _)| set.with(*axis)),
            turns: machine.axes.keys().any(|axis| !axis.is_linear()),
            position: PerAxis::default(),
            velocity: PerAxis::default(),
            ball_mm: machine.ball_radius_mm(),
            solids: solids(machine),
            clear_mm: 0.0,
            closed: false,
            edge: None,
            devices: plates.chain(beams).collect(),
            mounted: None,
            grid_zero: (0, Vector3::zeros()),
            length_zero: (0, Vector3::zeros()),
            warming: None,
        })
    }

    /// The same, but what moves warms it.
    #[must_use]
    pub fn warming(mut self, machine: &MachineFile) -> Self {
        self.warming = Some(Warming::new(machine));
        self
    }

    /// How far each thermometer has changed, K; none where temperatures stand still.
    pub fn changes_k(&self) -> impl Iterator<Item = (&str, f64)> {
        self.warming.iter().flat_map(Warming::changes_k)
    }

    /// (2): distance of the ball from the nearest surface, mm.
    fn gap_mm(&self, position: &PerAxis<f64>) -> f64 {
        let centre_mm = self.kinematics.ball_in_workpiece_mm(position);
        let solids = self.solids.iter();
        let nearest = solids.map(|solid| solid.distance_mm(&centre_mm));
        nearest.fold(f64::INFINITY, f64::min) - self.ball_mm
    }

    fn look(&mut self, before: &PerAxis<f64>, period: Span) {
        let gap_mm = self.gap_mm(&self.position);
        self.clear_mm = if self.turns {
            0.0
        } else {
            (gap_mm.abs() - IDEAL_MARGIN_MM).max(0.0)
        };
        let closed = gap_mm <= 0.0;
        if closed == self.closed {
            return;
        }
        let at = |share: f64| {
            PerAxis::from_fn(|axis| before[axis] + (self.position[axis] - before[axis]) * share)
        };
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if (self.gap_mm(&at(middle)) <= 0.0) == closed {
                high = middle;
            } else {
                low = middle;
            }
        }
        self.edge = Some(ProbeEdge {
            after_period_start: Span::from_secs_f64(high * period.as_secs_f64()),
            closed,
            motor_at_arrival: at(high),
        });
        self.closed = closed;
    }
}

impl Hardware for IdealMachine {
    fn step(&mut self, demand: &PerAxis<f64>, spindle_rpm: f64, period: Span) -> Feedback {
        let period_s = period.as_secs_f64();
        let before = self.position;
        self.edge = None;
        for axis in self.axes.iter() {
            self.velocity[axis] += demand[axis] * period_s; // (1)
            let way = self.velocity[axis] * period_s;
            self.position[axis] += way;
            self.clear_mm -= way.abs();
        }
        if self.clear_mm <= 0.0 {
            self.look(&before, period);
        }
        if let Some(warming) = &mut self.warming {
            warming.step(&self.velocity, spindle_rpm, period);
        }
        self.feedback()
    }

    fn feedback(&self) -> Feedback {
        Feedback {
            motor: self.position,
            velocity: self.velocity,
            scale: PerAxis::from_fn(|axis| {
                if self.scales.contains(axis) {
                    self.position[axis]
                } else {
                    f64::NAN
                }
            }),
        }
    }

    fn probe_edge(&self) -> Option<ProbeEdge> {
        self.edge
    }

    fn probe_closed(&self) -> bool {
        self.closed
    }

    fn sensor_reading_degc(&mut self, id: &str) -> Option<f64> {
        match &self.warming {
            Some(warming) => warming.reading_degc(id),
            None => Some(IDEAL_TEMPERATURE_DEGC),
        }
    }

    fn settle_at(&mut self, position: &PerAxis<f64>) {
        self.position = *position;
        self.velocity = PerAxis::default();
        self.clear_mm = 0.0;
        self.edge = None;
        self.closed = self.gap_mm(position) <= 0.0;
    }

    fn has_device(&self, name: &str) -> bool {
        self.devices.iter().any(|(known, _)| known == name)
    }

    fn mount(&mut self, name: &str) {
        let device = self.devices.iter().find(|(known, _)| known == name);
        self.mounted = device.map(|(_, device)| device.clone());
    }

    fn zero_grid(&mut self) {
        self.grid_zero = (self.grid_zero.0 + 1, self.position.xyz());
    }

    fn zero_length(&mut self) {
        self.length_zero = (self.length_zero.0 + 1, self.position.xyz());
    }

    fn has_grid(&self) -> bool {
        matches!(self.mounted, Some(Device::Plate { .. }))
    }

    fn has_length(&self) -> bool {
        matches!(self.mounted, Some(Device::Beam { .. }))
    }

    fn grid_reading(&mut self) -> Option<GridReading> {
        let Some(Device::Plate {
            plane,
            centre_mm,
            radius_mm,
        }) = &self.mounted
        else {
            return None;
        };
        let (zero_id, zero_mm) = self.grid_zero;
        let [u, v, _] = plane.axes();
        let here = self.position.xyz();
        let of_centre = |axis: Axis| here[axis.index()] - centre_mm[axis.index()];
        let since_zero = |axis: Axis| here[axis.index()] - zero_mm[axis.index()];
        (zero_id > 0 && of_centre(u).hypot(of_centre(v)) <= *radius_mm).then(|| GridReading {
            plane: (*plane).into(),
            u_mm: since_zero(u),
            v_mm: since_zero(v),
            zero_id,
        })
    }

    fn length_reading(&mut self) -> Option<LengthReading> {
        let Some(Device::Beam { axis, direction }) = &self.mounted else {
            return None;
        };
        let (zero_id, zero_mm) = self.length_zero;
        (zero_id > 0).then(|| LengthReading {
            axis: *axis,
            displacement_mm: (self.position.xyz() - zero_mm).dot(direction),
            zero_id,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solids_are_as_far_away_as_a_ruler_says() {
        let block = Solid::Box {
            middle_mm: Vector3::new(10.0, 0.0, 0.0),
            half_mm: Vector3::repeat(4.0),
        };
        let bore = Solid::Ring {
            middle_mm: Vector3::zeros(),
            inner_mm: 20.0,
            outer_mm: 30.0,
        };
        let boss = Solid::Ring {
            middle_mm: Vector3::zeros(),
            inner_mm: f64::NEG_INFINITY,
            outer_mm: 20.0,
        };
        for (solid, point, wanted_mm) in [
            (&block, Vector3::new(3.0, 0.0, 0.0), 3.0),
            (&block, Vector3::new(3.0, 8.0, 0.0), 5.0),
            (&block, Vector3::new(7.0, 0.0, 0.0), -1.0),
            (&bore, Vector3::new(0.0, 17.0, 0.0), 3.0),
            (&bore, Vector3::new(0.0, 25.0, 0.0), -5.0),
            (&bore, Vector3::new(25.0, 0.0, 7.0), 2.0),
            (&boss, Vector3::new(0.0, -23.0, 0.0), 3.0),
            (&boss, Vector3::new(0.0, 0.0, 4.0), -1.0),
        ] {
            let distance_mm = solid.distance_mm(&point);
            assert!((distance_mm - wanted_mm).abs() < 1e-12, "{solid:?} {point}");
        }
    }
}
