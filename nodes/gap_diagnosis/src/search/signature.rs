//! The signatures of every effect of the catalogue on this recording.
//!
//! # Model
//!
//! An instance is an effect on one target. Its columns are what the twin predicts at the typical size of one
//! amplitude, all others zero, so that the norm of a column is the instance's D at its typical size:
//!
//! ```text
//!   J_a(theta) = P W sim(a = typical, theta),   D = |J beta|              (1)
//! ```
//!
//! Parameters that shape the response are tried over their grids. The wide form has the free amplitudes of
//! the catalogue as further columns: it keeps the name and widens the form. A form may also have some of the
//! amplitudes only, and pays for these.
//!
//! # Holds when
//! The response is proportional to each amplitude; the joint refit checks it and corrects where it is not.

use std::collections::{BTreeMap, BTreeSet};

use machine::MachineFile;
use nalgebra::{DMatrix, DVector};
use twin::effects::{Effect, Kind, Role, Scene, Target};
use twin::{Response, Run};

use crate::noise::normal::Normal;
use crate::noise::stack::Stack;
use crate::search::{resolved, widening};

/// One effect on one target.
#[derive(Clone, Debug)]
pub struct Instance {
    /// Entry of the catalogue.
    pub kind: &'static Kind,
    /// What it acts on.
    pub target: Target,
    /// From which run on it acts; none of an effect that was there all the time.
    pub begins: Option<Begins>,
}

/// The first run of a part of a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Begins {
    /// Its number.
    pub run: u32,
    /// When it begins, seconds since the session's start.
    pub at_s: f64,
    /// Whether touches alone show that something begins there.
    pub is_touched_alone: bool,
}

/// Kinds that wear makes, which begin where touches alone show a change. Of all else that might begin there, much reads alike.
const OF_WEAR: [&str; 2] = ["backlash", "feed_lost_motion"];

/// An effect that acts from a run on.
struct From {
    effect: Box<dyn Effect>,
    begins: Begins,
}

impl Effect for From {
    fn add_to(&self, scene: &Scene<'_>, response: &mut Response) {
        if begin_s(scene.run).is_some_and(|at_s| at_s >= self.begins.at_s) {
            self.effect.add_to(scene, response);
        }
    }
}

/// When a run begins, seconds since the session's start; none of a run without motion and touches.
pub fn begin_s(run: &Run) -> Option<f64> {
    let moves = run.motion.time_s.first().copied();
    moves.or_else(|| run.touches.first().map(|touch| touch.time_s))
}

/// Kinds that go with time or temperature: when they begin is theirs to say. Readings whose order is not known show none of them.
pub const OWN_TIME: [&str; 13] = [
    "ambient_drift",
    "clock_drift",
    "column_bend",
    "coolant",
    "homing_shift",
    "latency_drift",
    "screw_elongation",
    "spindle_growth",
    "thermal_shift",
    "thermometer_lag",
    "thermometer_noise",
    "thermometer_offset",
    "workpiece_expansion",
];

impl Instance {
    /// All instances of some kinds on a machine.
    pub fn all<'k>(
        machine: &MachineFile,
        kinds: impl Iterator<Item = &'k &'static Kind>,
    ) -> Vec<Self> {
        let of = |kind: &&'static Kind| -> Vec<Self> {
            let kind = *kind;
            let targets = kind.targets_on(machine);
            targets
                .into_iter()
                .map(|target| Self {
                    kind,
                    target,
                    begins: None,
                })
                .collect()
        };
        kinds.flat_map(of).collect()
    }

    /// The same instances, then each that may begin at some time as it begins there.
    pub fn with_begins(all: Vec<Self>, begins: &[Begins]) -> Vec<Self> {
        let from = |at: &Begins| -> Vec<Self> {
            let may = |own: &&Self| {
                let id = &own.kind.id;
                !OWN_TIME.contains(id) && (!at.is_touched_alone || OF_WEAR.contains(id))
            };
            let later = |own: &Self| Self {
                begins: Some(*at),
                ..own.clone()
            };
            all.iter().filter(may).map(later).collect()
        };
        let later: Vec<Self> = begins.iter().flat_map(from).collect();
        [all, later].concat()
    }

    /// E.g. `backlash X`.
    pub fn name(&self) -> String {
        let name = format!("{} {}", self.kind.id, self.target);
        let name = name.trim_end();
        match self.begins {
            Some(begins) => format!("{name} from run {} on", begins.run),
            None => name.to_owned(),
        }
    }

    /// The effect in its plain form at its usual size.
    pub fn at_usual_size(&self) -> Box<dyn Effect> {
        let mut values = self.kind.typical();
        values.resize(self.kind.parameters.len() + self.kind.free.len(), 0.0);
        values[self.kind.parameters.len()..].fill(0.0);
        self.effect(&values)
    }

    /// The effect with some values.
    pub fn effect(&self, values: &[f64]) -> Box<dyn Effect> {
        let effect = (self.kind.build)(self.target.clone(), values);
        match self.begins {
            Some(begins) => Box::new(From { effect, begins }),
            None => effect,
        }
    }
}

/// One form of an instance: shapes fixed, wide or not.
#[derive(Clone, Debug)]
pub struct Form {
    /// The instance.
    pub instance: usize,
    /// All values (parameters, then free ones) with the amplitudes zero.
    pub values: Vec<f64>,
    /// Which of the values are amplitudes with a column here.
    pub amplitudes: Vec<usize>,
    /// The columns, in the order of the amplitudes.
    pub columns: Vec<usize>,
    /// Parameters that are paid for: amplitudes, and shapes with a choice.
    pub price: usize,
    /// Whether the free amplitudes are in it.
    pub wide: bool,
}

/// Instances, forms and columns.
pub struct Library {
    /// Instances.
    pub instances: Vec<Instance>,
    /// Forms.
    pub forms: Vec<Form>,
    /// Columns (1).
    pub columns: Vec<DVector<f64>>,
    /// Whether an instance could be seen at all.
    pub excited: Vec<bool>,
    /// Curves along axes that were read at targets only.
    pub curves: BTreeSet<usize>,
    /// Instances that are not searched, each with those that explain it (`aside`).
    pub aside: BTreeMap<usize, Vec<usize>>,
    /// Instances that are searched, each with those that would explain all of it.
    pub shared: BTreeMap<usize, Vec<usize>>,
}

/// Most grid points of an instance.
const MOST_SHAPES: usize = 24;
/// An effect that would stay below this D at its greatest physical size is not excited.
pub const MIN_D_EXCITED: f64 = 6.0;
/// The slope of a position error along an axis.
const SLOPE: &str = "scale_error";

impl Library {
    /// Signatures of some instances on a stack.
    pub fn new(stack: &Stack<'_>, instances: Vec<Instance>) -> Self {
        let mut signatures = Self {
            excited: vec![false; instances.len()],
            instances,
            forms: vec![],
            columns: vec![],
            curves: BTreeSet::new(),
            aside: BTreeMap::new(),
            shared: BTreeMap::new(),
        };
        for instance in 0..signatures.instances.len() {
            let kind = signatures.instances[instance].kind;
            for values in shapes(kind)
                .into_iter()
                .chain(at_events(kind, &stack.events_s))
            {
                signatures.add(stack, instance, values, false);
            }
        }
        signatures
    }

    /// The plain form of the slope of a curve along an axis: the scale of that axis.
    pub fn slope_of(&self, curve: usize) -> Option<usize> {
        let target = &self.instances[curve].target;
        (0..self.forms.len()).find(|form| {
            let own = &self.instances[self.forms[*form].instance];
            own.kind.id == SLOPE && own.target == *target && !self.forms[*form].wide
        })
    }

    /// Adds one form and gives its place; a form that stays below [`MIN_D_EXCITED`] at its greatest size is left out, and one of a
    /// period that the recording does not resolve.
    pub fn add(
        &mut self,
        stack: &Stack<'_>,
        instance: usize,
        values: Vec<f64>,
        wide: bool,
    ) -> Option<usize> {
        if !resolved::shows(stack, &self.instances[instance], &values) {
            return None;
        }
        let kind = self.instances[instance].kind;
        let parameters = || kind.parameters.iter().chain(kind.free).enumerate();
        let shown = if wide {
            usize::MAX
        } else {
            kind.parameters.len()
        };
        let mut amplitudes = vec![];
        let mut columns = vec![];
        let mut greatest = 0.0_f64;
        for (place, parameter) in parameters().take(shown) {
            let own = &self.instances[instance];
            let is_free = || widening::is_free_here(stack, own, parameter.name);
            if parameter.role != Role::Amplitude || !is_free() {
                continue;
            }
            let mut on = values.clone();
            on[place] = parameter.typical;
            let column = stack.signature_of(&own.name(), &on, &*own.effect(&on));
            let most = parameter.low.abs().max(parameter.high.abs()) / parameter.typical;
            let size = column.norm();
            if !size.is_finite() || size * most < 1e-3 {
                continue;
            }
            greatest = greatest.max(size * most);
            amplitudes.push(place);
            columns.push(column);
        }
        if greatest < MIN_D_EXCITED {
            return None;
        }
        self.excited[instance] = true;
        let choices = kind
            .shapes()
            .filter(|p| p.role.grid().is_some_and(|grid| grid.len() > 1));
        let first = self.columns.len();
        self.forms.push(Form {
            instance,
            values,
            price: amplitudes.len() + choices.count(),
            columns: (first..first + columns.len()).collect(),
            amplitudes,
            wide,
        });
        self.columns.extend(columns);
        Some(self.forms.len() - 1)
    }

    /// Adds a form with some of another one's amplitudes (places in its list): the others are zero and not paid for.
    pub fn add_part(&mut self, whole: usize, wanted: &[usize]) -> usize {
        let form = &self.forms[whole];
        let choices = form.price - form.amplitudes.len();
        let part = Form {
            amplitudes: wanted.iter().map(|k| form.amplitudes[*k]).collect(),
            columns: wanted.iter().map(|k| form.columns[*k]).collect(),
            price: wanted.len() + choices,
            ..form.clone()
        };
        self.forms.push(part);
        self.forms.len() - 1
    }

    /// Number of instances that could be seen.
    pub fn seen(&self) -> usize {
        self.excited.iter().filter(|seen| **seen).count()
    }

    /// Instances that one explains, whether they were set aside for it or not.
    pub fn set_aside_for(&self, instance: usize) -> impl Iterator<Item = usize> {
        let all = self.aside.iter().chain(&self.shared);
        all.filter(move |(_, by)| by.contains(&instance))
            .map(|(aside, _)| *aside)
    }

    /// Gram matrix of all columns.
    pub fn normal(&self, z: &DVector<f64>) -> Normal {
        if self.columns.is_empty() {
            return Normal {
                gram: DMatrix::zeros(0, 0),
                along: DVector::zeros(0),
            };
        }
        Normal::new(&DMatrix::from_columns(&self.columns), z)
    }
}

/// Parameter that is the instant of an event, min since the session began.
pub const INSTANT: &str = "at_min";

/// The same points with the instant at each of some events; none for a kind without an instant.
fn at_events(kind: &Kind, events_s: &[f64]) -> Vec<Vec<f64>> {
    let instant = kind.parameters.iter().position(|own| own.name == INSTANT);
    let Some(instant) = instant else {
        return vec![];
    };
    let mut all = vec![];
    // Later ones are beyond what the parameter may be.
    let most_s = 60.0 * kind.parameters[instant].high;
    for at_s in events_s.iter().filter(|at_s| **at_s <= most_s) {
        for mut values in shapes(kind) {
            values[instant] = at_s / 60.0;
            if !all.contains(&values) {
                all.push(values);
            }
        }
    }
    all
}

/// Values of every point of the shape grids, amplitudes zero.
pub fn shapes(kind: &Kind) -> Vec<Vec<f64>> {
    let grids: Vec<(usize, &[f64])> = kind
        .parameters
        .iter()
        .enumerate()
        .filter_map(|(place, parameter)| Some((place, parameter.role.grid()?)))
        .collect();
    let mut all = vec![vec![0.0; kind.parameters.len() + kind.free.len()]];
    let product: usize = grids.iter().map(|(_, grid)| grid.len()).product();
    let stride = |length: usize| {
        let share = product.div_ceil(MOST_SHAPES);
        if grids.len() > 1 && share > 1 && length > 3 {
            2
        } else {
            1
        }
    };
    for (place, grid) in &grids {
        let chosen: Vec<f64> = grid.iter().copied().step_by(stride(grid.len())).collect();
        all = all
            .iter()
            .flat_map(|values| {
                chosen.iter().map(|at| {
                    let mut values = values.clone();
                    values[*place] = *at;
                    values
                })
            })
            .collect();
    }
    all
}
