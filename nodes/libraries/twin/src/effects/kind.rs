//! What the catalogue says of an effect: name, targets, parameters, excitation, wider forms.

use std::fmt;

use metrology::{Axis, ErrorComponent};

use super::{Effect, linear_axes};
use crate::{Instrument, TwinError};
use machine::chain::Chain;
use machine::file::{EffectEntry, MachineFile, SensorPlace};
use machine::volumetric::components_of;

/// An entry of the catalogue.
#[derive(Debug)]
pub struct Kind {
    /// Its id, the name of its file.
    pub id: &'static str,
    /// What a metrologist calls it.
    pub title: &'static str,
    /// What it can act on.
    pub targets: Targets,
    /// Parameters of its physics, amplitudes first. All are required in a machine file.
    pub parameters: &'static [Parameter],
    /// Amplitudes of the wider form (GAP 1.4), zero where a file does not give them. Others than [`Role::Amplitude`] are off at
    /// zero: what shapes a scatter, and the ends of the part of the travel that a curve is over.
    pub free: &'static [Parameter],
    /// Whether it moves the mean of readings or only their scatter.
    pub moment: Moment,
    /// Share by which its size may differ from its mean between conditions by its physics, 1; 0: one size always.
    pub wanders: f64,
    /// What a recording must contain to show it, in words: "a reversal of the axis".
    pub needs: &'static str,
    /// Makes it; values in the order of `parameters`, then of `free`, in the units of the file.
    pub build: fn(Target, &[f64]) -> Box<dyn Effect>,
}

/// What effects of a kind can act on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Targets {
    /// Each linear axis.
    LinearAxes,
    /// Each rotary axis.
    RotaryAxes,
    /// Each pair of linear axes, in the order of the alphabet: XY, XZ, YZ.
    LinearPairs,
    /// Each linear axis and each direction across it, e.g. `YX`: straightness in Y of X.
    Across,
    /// Each linear axis and each direction of turning, e.g. `CX`: yaw of X.
    Turning,
    /// Each linear axis in the direction of gravity, e.g. `ZY`.
    Sagging,
    /// Each component of location of a rotary axis, e.g. `X0C`.
    RotaryLocations,
    /// Each error motion of a rotary axis, e.g. `XC`.
    RotaryMotions,
    /// The machine as a whole; the entry names no axis.
    Machine,
    /// The machine as a whole, by the first thermometer of its spindle; where it has thermometers at the front and at the
    /// rear of it, by the first at the rear as well, which the entry then names.
    Spindle,
    /// Each thermometer of the machine file.
    Thermometers,
    /// Each of these instruments.
    Instruments(&'static [Instrument]),
}

/// One thing that an effect acts on.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Target {
    /// One axis.
    Axis(Axis),
    /// Two linear axes.
    Pair(Axis, Axis),
    /// A component of ISO 230-1: straightness, angular error, location.
    Component(ErrorComponent),
    /// The machine.
    Machine,
    /// A thermometer.
    Thermometer(String),
    /// An instrument.
    Instrument(Instrument),
}

/// Mean or scatter.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Moment {
    /// The effect moves readings in a repeatable way.
    Mean,
    /// The effect only scatters them (random phase, jitter).
    Variance,
}

/// How a parameter enters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Role {
    /// The response is proportional to it (of [`Moment::Variance`]: to its square).
    Amplitude,
    /// It shapes the response; these values are tried before it is refined.
    Shape {
        /// Grid, in the parameter's unit, growing.
        grid: &'static [f64],
    },
    /// It shapes the response as the number of periods over a lead of its axis: besides the values of the grid that is
    /// tried which a line in the readings tells.
    Frequency {
        /// Grid, growing.
        grid: &'static [f64],
    },
}

impl Role {
    /// Values that are tried of what shapes the response.
    #[must_use]
    pub const fn grid(self) -> Option<&'static [f64]> {
        match self {
            Self::Amplitude => None,
            Self::Shape { grid } | Self::Frequency { grid } => Some(grid),
        }
    }
}

/// One parameter, in the unit of the machine file (its name ends in it).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Parameter {
    /// Key in the machine file.
    pub name: &'static str,
    /// How it enters.
    pub role: Role,
    /// Least physical value.
    pub low: f64,
    /// Greatest physical value.
    pub high: f64,
    /// Typical magnitude, the scale of its prior.
    pub typical: f64,
    /// Whether it is a height of a curve that its effect may have any form of: of a wide form such heights are as much
    /// the effect as its own parameters, while others only widen these.
    pub is_ordinate: bool,
    /// Whether it is a share of its effect's first parameter that takes another form: the size of the effect is the sum.
    pub is_share: bool,
}

impl Parameter {
    /// A share of the effect's size that has a form of its own, at most `limit` in magnitude.
    #[must_use]
    pub const fn share(name: &'static str, limit: f64, typical: f64) -> Self {
        let mut share = Self::ordinate(name, limit, typical);
        share.is_share = true;
        share
    }

    /// A height of a curve of any form, of either sign, at most `limit` in magnitude.
    #[must_use]
    pub const fn ordinate(name: &'static str, limit: f64, typical: f64) -> Self {
        let mut height = Self::amplitude(name, limit, typical);
        height.is_ordinate = true;
        height
    }

    /// An amplitude of either sign, at most `limit` in magnitude.
    #[must_use]
    pub const fn amplitude(name: &'static str, limit: f64, typical: f64) -> Self {
        Self {
            name,
            role: Role::Amplitude,
            low: -limit,
            high: limit,
            typical,
            is_ordinate: false,
            is_share: false,
        }
    }

    /// An amplitude that has a sign.
    #[must_use]
    pub const fn size(name: &'static str, high: f64, typical: f64) -> Self {
        Self {
            name,
            role: Role::Amplitude,
            low: 0.0,
            high,
            typical,
            is_ordinate: false,
            is_share: false,
        }
    }

    /// A number of periods over a lead between two physical limits, tried at the values of a grid and wherever a line is.
    #[must_use]
    pub const fn frequency(
        name: &'static str,
        limits: [f64; 2],
        typical: f64,
        grid: &'static [f64],
    ) -> Self {
        let mut frequency = Self::shape(name, limits, typical, grid);
        frequency.role = Role::Frequency { grid };
        frequency
    }

    /// A parameter of shape between two physical limits, tried at the values of a grid.
    #[must_use]
    pub const fn shape(
        name: &'static str,
        [low, high]: [f64; 2],
        typical: f64,
        grid: &'static [f64],
    ) -> Self {
        Self {
            name,
            role: Role::Shape { grid },
            low,
            high,
            typical,
            is_ordinate: false,
            is_share: false,
        }
    }
}

impl Target {
    /// The axis, of an effect whose targets are axes.
    pub(super) fn axis(&self) -> Axis {
        match self {
            Self::Axis(axis) => *axis,
            other => unreachable!("{other:?}: the kind acts on axes only"),
        }
    }

    /// The instrument, of an effect whose targets are instruments.
    pub(super) fn instrument(&self) -> Instrument {
        match self {
            Self::Instrument(instrument) => *instrument,
            other => unreachable!("{other:?}: the kind acts on instruments only"),
        }
    }

    /// The thermometer, of an effect whose targets are thermometers.
    pub(super) fn thermometer(&self) -> String {
        match self {
            Self::Thermometer(id) => id.clone(),
            other => unreachable!("{other:?}: the kind acts on thermometers only"),
        }
    }

    /// The component, of an effect whose targets are components.
    pub(super) fn component(&self) -> ErrorComponent {
        match self {
            Self::Component(component) => *component,
            other => unreachable!("{other:?}: the kind acts on components only"),
        }
    }

    /// The two axes, of an effect whose targets are pairs.
    pub(super) fn pair(&self) -> (Axis, Axis) {
        match self {
            Self::Pair(a, b) => (*a, *b),
            other => unreachable!("{other:?}: the kind acts on pairs only"),
        }
    }
}

impl Kind {
    /// Everything on the machine that the effect can act on.
    #[must_use]
    pub fn targets_on(&self, machine: &MachineFile) -> Vec<Target> {
        let locations = || {
            machine
                .chain
                .parse::<Chain>()
                .map_or_else(|_| vec![], |chain| components_of(&chain))
        };
        let linear = linear_axes(machine);
        let rotary = || {
            Axis::ROTARY
                .into_iter()
                .filter(|axis| machine.rotary_axis(*axis).is_some())
        };
        let named = |components: Vec<ErrorComponent>| {
            components.into_iter().map(Target::Component).collect()
        };
        let motions = |wanted: fn(&ErrorComponent) -> bool| {
            linear
                .iter()
                .flat_map(|of| ErrorComponent::motions_of(*of))
                .filter(wanted)
                .collect()
        };
        match self.targets {
            Targets::LinearAxes => linear.into_iter().map(Target::Axis).collect(),
            Targets::RotaryAxes => rotary().map(Target::Axis).collect(),
            Targets::LinearPairs => linear
                .iter()
                .flat_map(|a| {
                    linear
                        .iter()
                        .filter(move |b| a < b)
                        .map(|b| Target::Pair(*a, *b))
                })
                .collect(),
            Targets::Across => named(motions(|c| !c.is_angular() && c.direction != c.of)),
            Targets::Sagging => named(motions(|c| c.direction == Axis::Z && c.of != Axis::Z)),
            Targets::RotaryMotions => {
                let of_axes = rotary().flat_map(ErrorComponent::motions_of);
                of_axes.map(Target::Component).collect()
            }
            Targets::Turning => named(motions(|c| c.is_angular())),
            Targets::RotaryLocations => named(
                locations()
                    .into_iter()
                    .filter(|c| c.is_location && !c.of.is_linear())
                    .collect(),
            ),
            Targets::Machine => vec![Target::Machine],
            Targets::Spindle => {
                let rear = rear_beside_front(machine).map(Target::Thermometer);
                std::iter::once(Target::Machine).chain(rear).collect()
            }
            Targets::Thermometers => machine
                .temperature_sensors
                .iter()
                .map(|sensor| Target::Thermometer(sensor.id.clone()))
                .collect(),
            Targets::Instruments(all) => all.iter().copied().map(Target::Instrument).collect(),
        }
    }

    /// Typical values of its parameters and zeros for the wider form, in the order of [`Kind::build`].
    #[must_use]
    pub fn typical(&self) -> Vec<f64> {
        let physics = self.parameters.iter().map(|p| p.typical);
        physics.chain(self.free.iter().map(|_| 0.0)).collect()
    }

    /// The entry of a machine file that names it, its target and its values (in the order of
    /// [`Kind::build`]); amplitudes of the wider form that are zero are left out.
    #[must_use]
    pub fn entry(&self, target: &Target, values: &[f64]) -> EffectEntry {
        let named = self.parameters.iter().chain(self.free).zip(values);
        let is_written = |place: usize, value: f64| place < self.parameters.len() || value != 0.0;
        EffectEntry {
            kind: self.id.to_owned(),
            axis: Some(target.to_string()).filter(|name| !name.is_empty()),
            parameters: named
                .enumerate()
                .filter(|(place, (_, value))| is_written(*place, **value))
                .map(|(_, (p, value))| (p.name.to_owned(), *value))
                .collect(),
        }
    }

    /// Amplitudes among the parameters, then those of the wider form.
    pub fn amplitudes(&self) -> impl Iterator<Item = &'static Parameter> {
        self.parameters
            .iter()
            .chain(self.free)
            .filter(|p| p.role == Role::Amplitude)
    }

    /// Parameters that shape the response.
    pub fn shapes(&self) -> impl Iterator<Item = &'static Parameter> {
        self.parameters.iter().filter(|p| p.role != Role::Amplitude)
    }

    /// The target that an entry names.
    pub(super) fn target_of(
        &self,
        machine: &MachineFile,
        index: usize,
        entry: &EffectEntry,
    ) -> Result<Target, TwinError> {
        let possible = self.targets_on(machine);
        let named = entry.axis.as_deref().unwrap_or("");
        possible
            .iter()
            .find(|target| target.to_string() == named)
            .cloned()
            .ok_or_else(|| TwinError::Target {
                index,
                kind: entry.kind.clone(),
                target: named.to_owned(),
                possible: possible
                    .iter()
                    .map(|t| format!("`{t}`"))
                    .collect::<Vec<_>>()
                    .join(", "),
            })
    }

    /// The values that an entry gives, in the order that [`Kind::build`] wants.
    pub(super) fn values_of(
        &self,
        index: usize,
        entry: &EffectEntry,
    ) -> Result<Vec<f64>, TwinError> {
        let kind = || entry.kind.clone();
        let all = || self.parameters.iter().chain(self.free);
        if let Some(name) = entry
            .parameters
            .keys()
            .find(|name| all().all(|p| p.name != *name))
        {
            return Err(TwinError::UnknownParameter {
                index,
                kind: kind(),
                name: name.clone(),
                known: all().map(|p| p.name).collect::<Vec<_>>().join(", "),
            });
        }
        let value_of = |p: &Parameter| match entry.parameters.get(p.name) {
            None if self.free.contains(p) => Ok(0.0),
            None => Err(TwinError::MissingParameter {
                index,
                kind: kind(),
                name: p.name.to_owned(),
            }),
            Some(value) if (p.low..=p.high).contains(value) => Ok(*value),
            Some(value) => Err(TwinError::Range {
                index,
                kind: kind(),
                name: p.name.to_owned(),
                value: *value,
                low: p.low,
                high: p.high,
            }),
        };
        all().map(value_of).collect()
    }
}

/// The first thermometer at the rear of a spindle that has one at its front too.
fn rear_beside_front(machine: &MachineFile) -> Option<String> {
    let at = |place: SensorPlace| {
        let mut sensors = machine.temperature_sensors.iter();
        sensors.find(|sensor| sensor.place == place)
    };
    at(SensorPlace::SpindleFront)?;
    at(SensorPlace::SpindleRear).map(|sensor| sensor.id.clone())
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Axis(axis) => write!(f, "{axis}"),
            Self::Pair(a, b) => write!(f, "{a}{b}"),
            Self::Component(component) => {
                let name = component.to_string();
                f.write_str(name.strip_prefix('E').unwrap_or(&name))
            }
            Self::Machine => Ok(()),
            Self::Thermometer(id) => f.write_str(id),
            Self::Instrument(instrument) => write!(f, "{instrument}"),
        }
    }
}
